"""The nonlinear wheelset, equations (1)-(12) of the paper, for the axles under one vehicle.

On a curve y and psi are those relative to the track: y from its centre line, psi from its tangent. A right-hand
curve of curvature k turns this frame at -v k (counter-clockwise seen from above is positive). From that follow:

- the wheelset turns at psi' - v k. That is the yaw rate in (1) and (2), whose part L_g k is the creep that the longer
  outer rail makes, and that is what the gyro reads. (8) gains I_w d(v k)/dt, which only transition curves make;
- (9), written in the turning frame, has F_c = m_w (v2 k - g cant), to the left. An accelerometer feels neither gravity
  nor a turning frame but the contact forces: y'' - F_c / m_w, steady minus the uncompensated lateral acceleration.

Wheel loads stay equal. Of what holds the wheelset there are two forms:

- the paper's lone wheelset: the frame of its yaw spring stands along the track, and the vehicle's own centrifugal force
  does not reach it, for there is no suspension and no flange that could carry it;
- a bogie (`Bogie`): two wheelsets under a frame under half a car body. y and psi of frame and body are relative to the
  track at the bogie's centre, whose curvature and cant are the mean of those at its wheelsets. In a curve the frame's
  end over a wheelset, s from the centre, stands k s2/2 beside the centre line and k s turned to its tangent. The body's
  yaw follows the track's tangent.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.compiled import compiled
from sim_ecu.physics.contact import Contact, contact, kalker_c11
from sim_ecu.physics.rail import CANT, CURVATURE, CURVATURE_SLOPE, RAIL_COLUMNS

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
GRAVITY = 9.80665

# Creepage is the slip speed over the forward speed; below this speed (m/s) it is taken over this one, so that a
# start from standstill stays finite. No estimate is made that slow.
ROLLING_START = 1.0


@dataclass(frozen=True, slots=True)
class Bogie:
    """What holds two wheelsets: frame, suspensions, half a car body. Primary figures are of a wheelset, the rest of a
    bogie. The defaults are a multiple unit's, of the usual size, and this project's choice."""

    frame_mass_kg: float = 2500.0
    frame_yaw_inertia_kg_m2: float = 3500.0
    semi_wheelbase_m: float = 1.25
    primary_lateral_N_m: float = 4.0e6
    primary_lateral_damping_N_s_m: float = 2.0e4
    primary_yaw_N_m_rad: float = 5.0e6
    primary_yaw_damping_N_m_s_rad: float = 1.0e4
    body_mass_kg: float = 25_000.0  # half of a car body
    secondary_lateral_N_m: float = 4.5e5
    secondary_lateral_damping_N_s_m: float = 6.0e4
    secondary_yaw_N_m_rad: float = 2.0e5
    secondary_yaw_damping_N_m_s_rad: float = 5.0e5
    # A wheelset further from the middle of the track than this is pushed back by its flange.
    flange_clearance_m: float = 0.007
    flange_N_m: float = 1.0e7

    @property
    def wheelbase_m(self) -> float:
        """From axle to axle."""
        return 2 * self.semi_wheelbase_m

    def carried_kg(self, m_w: float) -> float:
        """The mass M_v that stands on one of its wheelsets, whose own is m_w."""
        return m_w + 0.5 * (self.frame_mass_kg + self.body_mass_kg)


@dataclass(frozen=True, slots=True)
class Wheelset:
    """Parameters of a wheelset and of its share of the vehicle (SI units). The defaults are this project's choice.

    bogie: what holds it; M_v is then what the bogie puts on it. None: k_w to the ground, as in the paper.
    """

    name: str = "default"
    m_w: float = 1250.0  # kg, mass of the wheelset
    I_w: float = 700.0  # kg m2, yaw inertia
    r_0: float = 0.5  # m, nominal wheel radius
    L_g: float = 0.75  # m, half gauge
    gamma: float = 0.15  # conicity
    k_w: float = 5.0e6  # N m/rad, yaw stiffness
    M_v: float = 15_000.0  # kg, vehicle mass carried by the wheelset
    I_R: float = 134.2  # kg m2, driven (right) wheel with its drive
    I_L: float = 64.2  # kg m2, other wheel
    k_s: float = 6.063e6  # N m/rad, torsional stiffness of the shaft
    C_s: float = 2000.0  # N m s/rad, its damping
    a: float = 6.0e-3  # m, semi-axis of the contact ellipse along rolling
    b: float = 5.0e-3  # m, the other one
    G: float = 82.0e9  # Pa, shear modulus
    resistance_0: float = 220.0  # N, running resistance at standstill
    resistance_2: float = 1.0  # N s2/m2, its part with the speed squared
    bogie: Bogie | None = None

    @property
    def normal_N(self) -> float:
        """Load N of one wheel."""
        return self.M_v * GRAVITY / 2

    @property
    def contact(self) -> Contact:
        """Contact constants of one wheel."""
        return contact(self.normal_N, self.a, self.b, self.G, kalker_c11(self.a, self.b))

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> "Wheelset":
        """Return the wheelset of a document, as `dataclasses.asdict` writes it. Raises TypeError for other names."""
        bogie = given.get("bogie")
        return cls(**{**given, "bogie": None if bogie is None else Bogie(**bogie)})

    def numbers(self) -> dict[str, float]:
        """Every parameter but the name and the bogie."""
        return {k: v for k, v in asdict(self).items() if k not in ("name", "bogie")}


class Constants(NamedTuple):
    """The same for the compiled functions."""

    m_w: float
    I_w: float
    r_0: float
    L_g: float
    gamma: float
    k_w: float
    M_v: float
    I_R: float
    I_L: float
    k_s: float
    C_s: float
    resistance_0: float
    resistance_2: float
    N: float
    F_g: float  # N/m, gravitational stiffness 2 N gamma / L_g
    roll: float  # 1/s2, what the roll of a displaced wheelset adds to its accelerometer: g gamma / L_g
    torque_limit: float  # N m, what the drive can do at all
    arm: float  # m, of a bogie's wheelset ahead of its centre; the rest is Bogie's, in its order
    m_f: float
    I_f: float
    k_y: float
    c_y: float
    k_psi: float
    c_psi: float
    m_b: float
    k_sec: float
    c_sec: float
    k_spsi: float
    c_spsi: float
    clearance: float
    flange: float


def constants(w: Wheelset, leading: bool = True) -> Constants:
    """Pack a wheelset for the compiled functions; leading: whether it is its bogie's first one."""
    n = w.normal_N
    held = {} if w.bogie is None else asdict(w.bogie)
    arm = held.pop("semi_wheelbase_m", 0.0)
    return Constants(
        w.m_w, w.I_w, w.r_0, w.L_g, w.gamma, w.k_w, w.M_v, w.I_R, w.I_L, w.k_s, w.C_s, w.resistance_0,
        w.resistance_2, n, 2 * n * w.gamma / w.L_g, GRAVITY * w.gamma / w.L_g, 2 * n * w.r_0 * 0.6,
        arm if leading else -arm, *(held.values() or [0.0] * 13),
    )  # fmt: skip


# State of an axle; the vehicle's v and distance come after it. Then, with a bogie's first axle, those of its frame and
# of the half body.
Y, YDOT, PSI, PSIDOT, W_R, W_L, THETA = range(7)
AXLE_STATES = 7
FRAME_Y, FRAME_YDOT, FRAME_PSI, FRAME_PSIDOT, BODY_Y, BODY_YDOT = range(6)
BOGIE_STATES = 6
BOGIE = AXLE_STATES + 2  # where they begin
STATES = BOGIE + BOGIE_STATES
# What one sample interval gives for an axle. What a sensor on the bogie's frame over the axle would read is 0 where
# there is no bogie.
YAW_RATE, LAT_ACCEL, TORQUE, SLIP, MU_USED, MU_AVAILABLE, CREEP_AT_PEAK, ROLL_RATE, FRAME_YAW_RATE, FRAME_LAT_ACCEL = (
    range(10)
)
OUTPUTS = 10


class Command(NamedTuple):
    """What drives each axle during one sample interval, arrays of shape (samples, axles); NaN means not given."""

    torque: FloatArray  # N m, demand
    utilisation: FloatArray  # demand as a share of the torque that the rail could carry just now
    creep: FloatArray  # wanted creep; the drive's torque follows from it
    creep_of_peak: FloatArray  # the same as a share of the creep at the curve's peak
    limit_of_peak: FloatArray  # creep limit of the traction controller, as a share of the peak's creep


# The equations are evaluated for LANES axles at once, so that the processor works on several where one would wait for
# its own exp and atan. All their numbers are rows of one block of memory, LANES long, at offsets that the compiler
# sees: so it can use vector instructions, which round as the scalar ones do. An axle's results do not depend on its
# neighbours.
LANES = 8
CONSTANTS = len(Constants._fields) + len(Contact._fields)
X, D = 0, STATES * LANES  # the state at which the equations are taken, and its derivatives
P = 2 * STATES * LANES  # Constants, then Contact
R = P + CONSTANTS * LANES  # what `rail_at` gives
TRACK = R + RAIL_COLUMNS * LANES  # y_t, m; then cross-level (rad, adds to the cant) and gauge (m, wider than nominal)
LEVEL, GAUGE = TRACK + LANES, TRACK + 2 * LANES
DRIVE = TRACK + 3 * LANES  # torque, N m
HELD = DRIVE + LANES  # acceleration that replaces (7), m/s2; NaN: none does
# F_xR + F_xL in N; what gyro and accelerometer read, on the axle box and on the frame over it
FORCE, YAW, ACCEL, FRAME_YAW, FRAME_ACCEL = (HELD + (1 + k) * LANES for k in range(5))
_WORK = HELD + 6 * LANES
BLOCK = _WORK + 21 * LANES  # what the equations need; the integration has rows of its own behind
_LAM_XL, _LAM_XR, _LAM_Y, _LAM_L, _LAM_R, _EXP_L, _EXP_R, _TOP_L, _TOP_R, _BOW_L, _BOW_R, _ATAN_L, _ATAN_R = (
    _WORK + k * LANES for k in range(13)
)
# force and moment of the primary suspension on a wheelset; of a bogie's first axle those on the frame, and the mean of
# what its wheelsets run on; what pulls a train's first axle
_PRIMARY_Y, _PRIMARY_PSI, _FRAME_F, _FRAME_M, _MEAN_K, _MEAN_SLOPE, _MEAN_CANT, _PULL = (
    _WORK + k * LANES for k in range(13, 21)
)
(
    _M_W, _I_W, _R_0, _L_G, _GAMMA, _K_W, _M_V, _I_R, _I_L, _K_S, _C_S, _RES_0, _RES_2, _N, _F_G, _ROLL, _LIMIT,
    _ARM, _M_F, _I_F, _K_Y, _C_Y, _K_PSI, _C_PSI, _M_B, _K_SEC, _C_SEC, _K_SPSI, _C_SPSI, _CLEARANCE, _FLANGE,
) = (P + k * LANES for k in range(len(Constants._fields)))  # fmt: skip
_NORMAL, _STIFFNESS = (P + (len(Constants._fields) + k) * LANES for k in range(2))
_MU_0, _A, _B, _K_A, _K_SLIP = (R + k * LANES for k in range(5))
_CURVATURE, _CANT, _SLOPE = (R + k * LANES for k in (CURVATURE, CANT, CURVATURE_SLOPE))
(
    _Y, _YDOT, _PSI, _PSIDOT, _W_R, _W_L, _THETA, _V, _DISTANCE,
    _FRAME_Y, _FRAME_YDOT, _FRAME_PSI, _FRAME_PSIDOT, _BODY_Y, _BODY_YDOT,
) = (X + k * LANES for k in range(STATES))  # fmt: skip


@compiled
def _suspension(b: FloatArray, n: int, leader: IntArray) -> None:
    """What holds each wheelset, from X: a spring to the ground, or the frame of its bogie; and what the frame feels."""
    for j in range(n):
        b[_FRAME_F + j] = b[_FRAME_M + j] = b[_MEAN_K + j] = b[_MEAN_SLOPE + j] = b[_MEAN_CANT + j] = 0.0
    for j in range(n):
        i = leader[j]
        if i < 0:
            b[_PRIMARY_Y + j], b[_PRIMARY_PSI + j] = 0.0, -b[_K_W + j] * b[_PSI + j]
            continue
        s, k, v = b[_ARM + j], b[_CURVATURE + j], b[_V + j]
        slope = v * b[_SLOPE + j]
        apart = b[_FRAME_Y + i] + s * b[_FRAME_PSI + i] + 0.5 * s * s * k - b[_Y + j]
        speed = b[_FRAME_YDOT + i] + s * b[_FRAME_PSIDOT + i] + 0.5 * s * s * slope - b[_YDOT + j]
        turned = b[_FRAME_PSI + i] + s * k - b[_PSI + j]
        turning = b[_FRAME_PSIDOT + i] + s * slope - b[_PSIDOT + j]
        force = b[_K_Y + j] * apart + b[_C_Y + j] * speed
        moment = b[_K_PSI + j] * turned + b[_C_PSI + j] * turning
        b[_FRAME_F + i] -= force
        b[_FRAME_M + i] -= s * force + moment
        b[_MEAN_K + i] += 0.5 * k
        b[_MEAN_SLOPE + i] += 0.5 * b[_SLOPE + j]
        b[_MEAN_CANT + i] += 0.5 * (b[_CANT + j] + b[LEVEL + j])
        beside = b[_Y + j] - b[TRACK + j]
        if abs(beside) > b[_CLEARANCE + j]:
            force -= b[_FLANGE + j] * (beside - math.copysign(b[_CLEARANCE + j], beside))
        b[_PRIMARY_Y + j], b[_PRIMARY_PSI + j] = force, moment


@compiled
def _frames(b: FloatArray, n: int, leader: IntArray) -> None:
    """Frame and half body of each bogie, and what sensors on it read: from X, `_suspension` and D of the speed."""
    for j in range(n):
        i = leader[j]
        if i < 0:
            continue
        v, k = b[_V + i], b[_MEAN_K + i]
        uncompensated = v * v * k - GRAVITY * b[_MEAN_CANT + i]
        secondary = b[_K_SEC + i] * (b[_BODY_Y + i] - b[_FRAME_Y + i])
        secondary += b[_C_SEC + i] * (b[_BODY_YDOT + i] - b[_FRAME_YDOT + i])
        held = b[_K_SPSI + i] * b[_FRAME_PSI + i] + b[_C_SPSI + i] * b[_FRAME_PSIDOT + i]
        y2 = (b[_FRAME_F + i] + secondary) / b[_M_F + i]
        psi2 = (b[_FRAME_M + i] - held) / b[_I_F + i]
        if i == j:
            b[D + _FRAME_Y + i] = b[_FRAME_YDOT + i]
            b[D + _FRAME_YDOT + i] = y2 + uncompensated
            b[D + _FRAME_PSI + i] = b[_FRAME_PSIDOT + i]
            b[D + _FRAME_PSIDOT + i] = psi2 + v * v * b[_MEAN_SLOPE + i] + b[D + _V + i] * k
            b[D + _BODY_Y + i] = b[_BODY_YDOT + i]
            b[D + _BODY_YDOT + i] = -secondary / b[_M_B + i] + uncompensated
        b[FRAME_YAW + j] = b[_FRAME_PSIDOT + i] - v * k
        b[FRAME_ACCEL + j] = y2 + b[_ARM + j] * psi2


@compiled
def derivatives(b: FloatArray, n: int, leader: IntArray, head: IntArray, size: IntArray) -> None:
    """Equations (1)-(12) for the first n lanes of a block: from X, P, R, TRACK, LEVEL, GAUGE, DRIVE, HELD to D, FORCE
    and what the sensors read, YAW, ACCEL, FRAME_YAW, FRAME_ACCEL.

    y is positive to the left, yaw counter-clockwise seen from above, torque positive in the direction of travel.
    leader (LANES,): the lane of the first axle of an axle's bogie, -1 without one; head (LANES,): that of its train,
    whose forces (7) shares; size (LANES,): how many axles the train has.
    """
    for j in range(n):
        v = b[_V + j]
        u = max(v, ROLLING_START)
        a = b[_L_G + j] * (b[_PSIDOT + j] - v * b[_CURVATURE + j]) / u
        a += b[_GAMMA + j] * (b[_Y + j] - b[TRACK + j]) / b[_R_0 + j]
        wide = 0.5 * b[_GAMMA + j] * b[GAUGE + j] / b[_R_0 + j]  # a wider gauge meets both wheels at smaller radii
        lam_xL = (b[_R_0 + j] * b[_W_L + j] - v) / u + a - wide  # (1)
        lam_xR = (b[_R_0 + j] * b[_W_R + j] - v) / u - a - wide  # (2)
        lam_y = b[_YDOT + j] / u - b[_PSI + j]  # (3)
        lam_L = np.sqrt(lam_xL * lam_xL + lam_y * lam_y)  # (4)
        lam_R = np.sqrt(lam_xR * lam_xR + lam_y * lam_y)
        b[_LAM_XL + j], b[_LAM_XR + j], b[_LAM_Y + j] = lam_xL, lam_xR, lam_y
        b[_LAM_L + j], b[_LAM_R + j] = lam_L, lam_R
        b[_EXP_L + j] = -b[_B + j] * (lam_L * u)
        b[_EXP_R + j] = -b[_B + j] * (lam_R * u)
    # `contact.traction_ratio` of both wheels, in three parts: between them stand functions that are no vectors
    for j in range(n):
        b[_EXP_L + j] = math.exp(b[_EXP_L + j])
        b[_EXP_R + j] = math.exp(b[_EXP_R + j])
    for j in range(n):
        mu_L = b[_MU_0 + j] * ((1.0 - b[_A + j]) * b[_EXP_L + j] + b[_A + j])
        mu_R = b[_MU_0 + j] * ((1.0 - b[_A + j]) * b[_EXP_R + j] + b[_A + j])
        eps_L = b[_STIFFNESS + j] * b[_LAM_L + j] / (b[_NORMAL + j] * mu_L)
        eps_R = b[_STIFFNESS + j] * b[_LAM_R + j] / (b[_NORMAL + j] * mu_R)
        kae_L, kae_R = b[_K_A + j] * eps_L, b[_K_A + j] * eps_R
        b[_TOP_L + j], b[_TOP_R + j] = 2.0 * mu_L / math.pi, 2.0 * mu_R / math.pi
        b[_BOW_L + j], b[_BOW_R + j] = kae_L / (1.0 + kae_L * kae_L), kae_R / (1.0 + kae_R * kae_R)
        b[_ATAN_L + j], b[_ATAN_R + j] = b[_K_SLIP + j] * eps_L, b[_K_SLIP + j] * eps_R
    for j in range(n):
        b[_ATAN_L + j] = math.atan(b[_ATAN_L + j])
        b[_ATAN_R + j] = math.atan(b[_ATAN_R + j])
    _suspension(b, n, leader)
    for j in range(n):
        v = b[_V + j]
        # F = mu N (5), split along the creepage (6); at zero creep the direction does not matter
        q_L = b[_N + j] * (b[_TOP_L + j] * (b[_BOW_L + j] + b[_ATAN_L + j])) / max(b[_LAM_L + j], 1e-12)
        q_R = b[_N + j] * (b[_TOP_R + j] * (b[_BOW_R + j] + b[_ATAN_R + j])) / max(b[_LAM_R + j], 1e-12)
        F_xL, F_xR = q_L * b[_LAM_XL + j], q_R * b[_LAM_XR + j]
        F_y = (q_L + q_R) * b[_LAM_Y + j]
        F_g = -b[_F_G + j] * (b[_Y + j] - b[TRACK + j])
        uncompensated = v * v * b[_CURVATURE + j] - GRAVITY * (b[_CANT + j] + b[LEVEL + j])
        F_c = b[_M_W + j] * uncompensated
        T_s = b[_K_S + j] * b[_THETA + j] + b[_C_S + j] * (b[_W_R + j] - b[_W_L + j])  # (12)
        y2 = (-F_y + F_c + F_g + b[_PRIMARY_Y + j]) / b[_M_W + j]  # (9)
        psi2 = ((F_xR - F_xL) * b[_L_G + j] + b[_PRIMARY_PSI + j]) / b[_I_W + j]  # (8)
        b[D + _Y + j] = b[_YDOT + j]
        b[D + _YDOT + j] = y2
        b[D + _PSI + j] = b[_PSIDOT + j]
        b[D + _PSIDOT + j] = psi2 + v * v * b[_SLOPE + j]
        b[D + _W_R + j] = (b[DRIVE + j] - T_s - b[_R_0 + j] * F_xR) / b[_I_R + j]  # (10)
        b[D + _W_L + j] = (T_s - b[_R_0 + j] * F_xL) / b[_I_L + j]  # (11)
        b[D + _THETA + j] = b[_W_R + j] - b[_W_L + j]
        b[D + _V + j] = b[HELD + j]
        b[D + _DISTANCE + j] = v
        b[FORCE + j] = F_xR + F_xL
        b[YAW + j] = b[_PSIDOT + j] - v * b[_CURVATURE + j]
        b[ACCEL + j] = y2 - uncompensated + b[_ROLL + j] * (b[_Y + j] - b[TRACK + j])
    for j in range(n):
        b[_PULL + j] = 0.0
    for j in range(n):
        b[_PULL + head[j]] += b[FORCE + j]
    for j in range(n):
        if np.isnan(b[HELD + j]):
            v = b[_V + j]
            resistance = (b[_RES_0 + j] + b[_RES_2 + j] * v * v) * min(v / 0.1, 1.0)
            b[D + _V + j] = b[_PULL + head[j]] / (size[j] * b[_M_V + j]) - resistance / b[_M_V + j]  # (7)
    for j in range(n):
        b[D + _PSIDOT + j] += b[D + _V + j] * b[_CURVATURE + j]
    _frames(b, n, leader)


LONE = np.full(LANES, -1), np.arange(LANES), np.ones(LANES, dtype=np.int64)  # leader, head and size of lone wheelsets


def axle_derivatives(
    x: FloatArray, v: float, y_t: float, torque: float, r: FloatArray, p: Constants, c: Contact, out: FloatArray
) -> tuple[float, float]:
    """`derivatives` of one axle at a held speed: writes d(state)/dt (7,) to out, returns F_xR + F_xL (N) and what the
    accelerometer reads (m/s2). r is what `rail_at` gives."""
    b = np.zeros(BLOCK)
    rows = b.reshape(-1, LANES)[:, 0]
    rows[X : X + AXLE_STATES], rows[_V // LANES], rows[TRACK // LANES], rows[DRIVE // LANES] = x, v, y_t, torque
    rows[P // LANES : P // LANES + CONSTANTS] = *p, *c
    rows[R // LANES : R // LANES + len(r)] = r
    derivatives(b, 1, *LONE)
    out[:] = rows[D // LANES : D // LANES + AXLE_STATES]
    return float(b[FORCE]), float(b[ACCEL])
