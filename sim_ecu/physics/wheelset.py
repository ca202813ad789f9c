"""The nonlinear wheelset, equations (1)-(12) of the paper, for the axles under one vehicle.

On a curve y and psi are those relative to the track: y from its centre line, psi from its tangent. A right-hand
curve of curvature k turns this frame at -v k (counter-clockwise seen from above is positive). From that follow:

- the wheelset turns at psi' - v k. That is the yaw rate in (1) and (2), whose part L_g k is the creep that the longer
  outer rail makes, and that is what the gyro reads. (8) gains I_w d(v k)/dt, which only transition curves make;
- (9), written in the turning frame, has F_c = m_w (v2 k - g cant), to the left. An accelerometer feels neither gravity
  nor a turning frame but the contact forces: y'' - F_c / m_w, steady minus the uncompensated lateral acceleration.

The yaw spring's frame stands along the track, wheel loads stay equal, and the vehicle's own centrifugal force does not
reach the wheelset: the paper's model has no suspension and no flange that could carry it.
"""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.compiled import compiled
from sim_ecu.physics.contact import Contact, contact, kalker_c11, peak, traction_ratio
from sim_ecu.physics.rail import CANT, CURVATURE, CURVATURE_SLOPE, rail_at
from sim_ecu.physics.track import irregularity

FloatArray = NDArray[np.float64]
GRAVITY = 9.80665

# Creepage is the slip speed over the forward speed; below this speed (m/s) it is taken over this one, so that a
# start from standstill stays finite. No estimate is made that slow.
ROLLING_START = 1.0
# Integration step: the longest allowed, and the longest relative to the fastest decay of the contact (RK4 is stable
# to 2.8; 0.35 keeps the outputs within 1e-3 of half that step, see the convergence test).
MAX_STEP_S = 5.0e-4
STEP_TIMES_RATE = 0.35


@dataclass(frozen=True, slots=True)
class Wheelset:
    """Parameters of a wheelset and of its share of the vehicle (SI units). The defaults are this project's choice."""

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

    @property
    def normal_N(self) -> float:
        """Load N of one wheel."""
        return self.M_v * GRAVITY / 2

    @property
    def contact(self) -> Contact:
        """Contact constants of one wheel."""
        return contact(self.normal_N, self.a, self.b, self.G, kalker_c11(self.a, self.b))

    def numbers(self) -> dict[str, float]:
        """Every parameter but the name."""
        return {k: v for k, v in asdict(self).items() if k != "name"}


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


def constants(w: Wheelset) -> Constants:
    """Pack a wheelset for the compiled functions."""
    n = w.normal_N
    return Constants(
        w.m_w, w.I_w, w.r_0, w.L_g, w.gamma, w.k_w, w.M_v, w.I_R, w.I_L, w.k_s, w.C_s, w.resistance_0,
        w.resistance_2, n, 2 * n * w.gamma / w.L_g, GRAVITY * w.gamma / w.L_g, 2 * n * w.r_0 * 0.6,
    )  # fmt: skip


# State of an axle; the vehicle's v and distance are shared.
Y, YDOT, PSI, PSIDOT, W_R, W_L, THETA = range(7)
# What one sample interval gives for an axle.
YAW_RATE, LAT_ACCEL, TORQUE, SLIP, MU_USED, MU_AVAILABLE = range(6)
OUTPUTS = 6


@compiled
def axle_derivatives(
    x: FloatArray, v: float, y_t: float, torque: float, r: FloatArray, p: Constants, c: Contact, out: FloatArray
) -> tuple[float, float]:
    """Equations (1)-(12) for one axle: writes d(state)/dt to out, returns (F_xR + F_xL in N, accelerometer in m/s2).

    y is positive to the left, yaw counter-clockwise seen from above, torque positive in the direction of travel. r is
    what `rail_at` gives. The caller adds to (8) what a change of v times curvature makes, which needs (7).
    """
    u = max(v, ROLLING_START)
    a = p.L_g * (x[PSIDOT] - v * r[CURVATURE]) / u + p.gamma * (x[Y] - y_t) / p.r_0
    lam_xL = (p.r_0 * x[W_L] - v) / u + a  # (1)
    lam_xR = (p.r_0 * x[W_R] - v) / u - a  # (2)
    lam_y = x[YDOT] / u - x[PSI]  # (3)
    lam_L = np.sqrt(lam_xL * lam_xL + lam_y * lam_y)  # (4)
    lam_R = np.sqrt(lam_xR * lam_xR + lam_y * lam_y)
    # F = mu N (5), split along the creepage (6); at zero creep the direction does not matter
    q_L = p.N * traction_ratio(lam_L, u, c, r[0], r[1], r[2], r[3], r[4]) / max(lam_L, 1e-12)
    q_R = p.N * traction_ratio(lam_R, u, c, r[0], r[1], r[2], r[3], r[4]) / max(lam_R, 1e-12)
    F_xL, F_xR = q_L * lam_xL, q_R * lam_xR
    F_y = (q_L + q_R) * lam_y
    F_g = -p.F_g * (x[Y] - y_t)
    uncompensated = v * v * r[CURVATURE] - GRAVITY * r[CANT]
    F_c = p.m_w * uncompensated
    T_s = p.k_s * x[THETA] + p.C_s * (x[W_R] - x[W_L])  # (12)
    out[Y] = x[YDOT]
    out[YDOT] = (-F_y + F_c + F_g) / p.m_w  # (9)
    out[PSI] = x[PSIDOT]
    out[PSIDOT] = ((F_xR - F_xL) * p.L_g - p.k_w * x[PSI]) / p.I_w  # (8)
    out[W_R] = (torque - T_s - p.r_0 * F_xR) / p.I_R  # (10)
    out[W_L] = (T_s - p.r_0 * F_xL) / p.I_L  # (11)
    out[THETA] = x[W_R] - x[W_L]
    return F_xR + F_xL, out[YDOT] - uncompensated + p.roll * (x[Y] - y_t)


@compiled
def train_derivatives(
    state: FloatArray, train: FloatArray, torque: FloatArray, offset: FloatArray, start: FloatArray,
    nodes: tuple[FloatArray, ...], rails: tuple[FloatArray, ...], held_rate: float, p: Constants, c: Contact,
    d_state: FloatArray, d_train: FloatArray, force: FloatArray, yaw_rate: FloatArray, accel: FloatArray,
) -> None:  # fmt: skip
    """All axles and the vehicle: (7) with the axles' forces shared; held_rate (m/s2) replaces (7) unless it is NaN.

    Writes per axle F_xR + F_xL (N) and what gyro (rad/s) and accelerometer (m/s2) read. offset (axles,) is each axle's
    place ahead of the train's distance, start (axles,) that of its track's first node.
    """
    v, distance = train[0], train[1]
    axles = state.shape[0]
    pull = 0.0
    for i in range(axles):
        at = distance + offset[i]
        r = rail_at(rails[i], at)
        y_t = irregularity(nodes[i], at - start[i])
        force[i], accel[i] = axle_derivatives(state[i], v, y_t, torque[i], r, p, c, d_state[i])
        d_state[i, PSIDOT] += v * v * r[CURVATURE_SLOPE]
        yaw_rate[i] = r[CURVATURE]  # until the vehicle's acceleration is known
        pull += force[i]
    d_train[1] = v
    if np.isnan(held_rate):
        resistance = (p.resistance_0 + p.resistance_2 * v * v) * min(v / 0.1, 1.0)
        d_train[0] = pull / (axles * p.M_v) - resistance / p.M_v  # (7)
    else:
        d_train[0] = held_rate
    for i in range(axles):
        d_state[i, PSIDOT] += d_train[0] * yaw_rate[i]
        yaw_rate[i] = state[i, PSIDOT] - v * yaw_rate[i]


class Command(NamedTuple):
    """What drives each axle during one sample interval, arrays of shape (samples, axles); NaN means not given."""

    torque: FloatArray  # N m, demand
    utilisation: FloatArray  # demand as a share of the torque that the rail could carry just now
    creep: FloatArray  # wanted creep; the drive's torque follows from it
    creep_of_peak: FloatArray  # the same as a share of the creep at the curve's peak
    limit_of_peak: FloatArray  # creep limit of the traction controller, as a share of the peak's creep


@compiled
def _drive_torque(
    x: FloatArray, v: float, demand: float, limit: float, integral: float, h: float, p: Constants
) -> tuple[float, float]:
    """Creep controller: the demanded torque unless creep would pass the limit (both signed). Torque, integral.

    No demand is coasting: there is no torque that could be limited.
    """
    if demand == 0.0:
        return 0.0, 0.0
    u = max(v, ROLLING_START)
    inertia = p.I_R + p.I_L
    slip = (p.I_R * x[W_R] + p.I_L * x[W_L]) / inertia * p.r_0 - v
    error = limit * u - slip  # m/s
    gain = inertia / p.r_0 * 40.0  # 40 rad/s: well below the shaft's 374 rad/s
    held = gain * error + integral
    torque = min(demand, held) if limit >= 0 else max(demand, held)
    torque = min(max(torque, -p.torque_limit), p.torque_limit)
    # back-calculation, 50 ms: the integral follows while something else decides the torque
    integral += h * (gain * 12.0 * error - (held - torque) / 0.05)
    return torque, integral


# What is kept of an axle's newest peak: the speed and the curve's five numbers that it is of, and where it lies.
PEAK_CREEP, PEAK_MU = 6, 7
PEAK_COLUMNS = 8


@compiled
def _peak_at(rail: FloatArray, distance_m: float, speed_m_s: float, c: Contact, known: FloatArray) -> None:
    """The peak at a place and a speed, in known (PEAK_COLUMNS,); searched for only where it is another than before."""
    r = rail_at(rail, distance_m)
    same = known[0] == speed_m_s
    for j in range(5):
        same = same and known[1 + j] == r[j]
    if not same:
        known[0], known[1:6] = speed_m_s, r[:5]
        known[PEAK_CREEP], known[PEAK_MU] = peak(speed_m_s, c, r[0], r[1], r[2], r[3], r[4])


@compiled
def simulate(
    state: FloatArray, train: FloatArray, integral: FloatArray, offset: FloatArray, start: FloatArray,
    nodes: tuple[FloatArray, ...], rails: tuple[FloatArray, ...], command: Command, held_speed: FloatArray,
    sample_s: float, step_scale: float, p: Constants, c: Contact, stiffest: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Advance by len(held_speed) sample intervals, in place.

    state (axles, 7), train (v, distance), integral (axles,) are read and left at the end of the last interval.
    offset and start are those of `train_derivatives`.
    held_speed (samples,) is the speed at the end of each interval, NaN where the vehicle moves freely.
    Returns outputs (samples, axles, OUTPUTS), means over the interval except MU_AVAILABLE (at its end), and
    (samples, 2) with v and distance at the end. Runge-Kutta, 4th order, with a step that follows the speed.
    """
    samples, axles = held_speed.shape[0], state.shape[0]
    out = np.zeros((samples, axles, OUTPUTS))
    journey = np.empty((samples, 2))
    k_state = np.empty((4, axles, 7))
    k_train = np.empty((4, 2))
    x, t = np.empty((axles, 7)), np.empty(2)
    peaks = np.zeros((axles, PEAK_COLUMNS))
    force, yaw_rate, accel = np.empty(axles), np.empty(axles), np.empty(axles)
    torque = np.empty(axles)
    demand, limit = np.empty(axles), np.empty(axles)
    weight = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
    lead = np.array([0.0, 0.5, 0.5, 1.0])
    for s in range(samples):
        v = train[0]
        held_rate = (held_speed[s] - v) / sample_s
        for i in range(axles):
            _peak_at(rails[i], train[1] + offset[i], max(v, ROLLING_START), c, peaks[i])
            creep_peak, mu_peak = peaks[i, PEAK_CREEP], peaks[i, PEAK_MU]
            wanted = command.creep[s, i]
            if np.isnan(wanted):
                wanted = command.creep_of_peak[s, i] * creep_peak
            if np.isnan(wanted):
                demand[i] = command.torque[s, i]
                if np.isnan(demand[i]):
                    demand[i] = command.utilisation[s, i] * mu_peak * 2 * p.N * p.r_0
                limit[i] = command.limit_of_peak[s, i] * creep_peak * np.sign(demand[i])
            else:
                demand[i] = p.torque_limit * np.sign(wanted)
                limit[i] = wanted
            # brakes hold, they do not drive backwards: they let go as the wheel stops
            if demand[i] < 0:
                demand[i] *= min(1.0, max(0.0, state[i, W_R] * p.r_0 / 0.5))
        rate = stiffest / max(v, ROLLING_START)
        steps = max(int(np.ceil(sample_s / MAX_STEP_S)), int(np.ceil(sample_s * rate / STEP_TIMES_RATE)))
        steps = int(steps * step_scale)
        h = sample_s / steps
        for _ in range(steps):
            for i in range(axles):
                torque[i], integral[i] = _drive_torque(state[i], train[0], demand[i], limit[i], integral[i], h, p)
            for k in range(4):
                if k == 0:
                    x[:], t[:] = state, train
                else:
                    ahead = lead[k] * h
                    for i in range(axles):
                        for j in range(7):
                            x[i, j] = state[i, j] + ahead * k_state[k - 1, i, j]
                    for j in range(2):
                        t[j] = train[j] + ahead * k_train[k - 1, j]
                train_derivatives(
                    x, t, torque, offset, start, nodes, rails, held_rate, p, c, k_state[k], k_train[k],
                    force, yaw_rate, accel,
                )  # fmt: skip
                for i in range(axles):
                    share = weight[k] / steps
                    out[s, i, YAW_RATE] += share * yaw_rate[i]
                    out[s, i, LAT_ACCEL] += share * accel[i]
                    out[s, i, MU_USED] += share * force[i] / (2 * p.N)
                    slip = 0.5 * p.r_0 * (x[i, W_R] + x[i, W_L]) - t[0]
                    out[s, i, SLIP] += share * slip / max(t[0], ROLLING_START)
            for k in range(4):
                part = h * weight[k]
                for i in range(axles):
                    for j in range(7):
                        state[i, j] += part * k_state[k, i, j]
                for j in range(2):
                    train[j] += part * k_train[k, j]
            train[0] = max(train[0], 0.0)
            for i in range(axles):
                out[s, i, TORQUE] += torque[i] / steps
        for i in range(axles):
            _peak_at(rails[i], train[1] + offset[i], max(train[0], ROLLING_START), c, peaks[i])
            out[s, i, MU_AVAILABLE] = peaks[i, PEAK_MU]
        journey[s, 0], journey[s, 1] = train[0], train[1]
    return out, journey
