"""A bogie as transfer functions: what the track's alignment and cross-level make of both wheelsets' signals.

The rig's equations (docs/explanation/vehicle.md), linear about rolling straight on with some torque. Of the creep force
of one wheel that leaves a slope g11 along the track and a secant g22 across it, alike for both wheelsets. Signals
tell the common scale of masses, springs and creep forces by next to nothing: what is known of the masses anchors it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
GRAVITY = 9.80665
C11 = 4.3  # Kalker's coefficient of a contact ellipse that is a little longer than wide
SIGNALS = ("yaw rate", "lateral acceleration", "roll rate")  # of a wheelset, rad/s, m/s2, rad/s
SOURCES = ("alignment", "cross-level")  # of the track, m and rad
# What a fit may move, each as the log of a factor: the constants that it multiplies, and one standard deviation of what
# is known of it before. Suspensions differ between vehicles by much, masses by little.
SHAFT = "shaft"
PRIOR_SIGMA: Mapping[str, float] = {
    "primary_lateral_N_m": 1.0,
    "primary_lateral_damping_N_s_m": 1.0,
    "primary_yaw_N_m_rad": 1.0,
    "primary_yaw_damping_N_m_s_rad": 1.0,
    "gamma": 0.5,
    "m_w": 0.15,
    "I_w": 0.15,
    "frame_mass_kg": 0.15,
    "frame_yaw_inertia_kg_m2": 0.2,
    "secondary_lateral_N_m": 0.5,
    "secondary_lateral_damping_N_s_m": 0.7,
    "secondary_yaw_N_m_rad": 0.7,
    "secondary_yaw_damping_N_m_s_rad": 1.0,
    "r_0": 0.02,
    SHAFT: 0.15,
}
_OF_SHAFT = ("k_s", "C_s")


@dataclass(frozen=True, slots=True)
class BogieConstants:
    """Two wheelsets under a frame under half a car body; names and units as in a vehicle's file.

    load_N: of one wheel. slope_N: of one wheel's creep force, over (k_A + k_S) of the rail's creep curve.
    """

    m_w: float
    I_w: float
    r_0: float
    L_g: float
    gamma: float
    I_R: float
    I_L: float
    k_s: float
    C_s: float
    load_N: float
    slope_N: float
    frame_mass_kg: float
    frame_yaw_inertia_kg_m2: float
    semi_wheelbase_m: float
    primary_lateral_N_m: float
    primary_lateral_damping_N_s_m: float
    primary_yaw_N_m_rad: float
    primary_yaw_damping_N_m_s_rad: float
    body_mass_kg: float
    secondary_lateral_N_m: float
    secondary_lateral_damping_N_s_m: float
    secondary_yaw_N_m_rad: float
    secondary_yaw_damping_N_m_s_rad: float

    @classmethod
    def of(cls, wheelset: Mapping[str, Any]) -> "BogieConstants":
        """Return those of a wheelset as a design has it. Raises ValueError for a lone one, KeyError where one is
        missing."""
        of_bogie = wheelset["bogie"]
        if of_bogie is None:
            raise ValueError("a lone wheelset has no bogie")
        own = {f.name: float(wheelset[f.name]) for f in fields(cls) if f.name in wheelset}
        held = {f.name: float(of_bogie[f.name]) for f in fields(cls) if f.name in of_bogie}
        slope_N = 0.5 * C11 * wheelset["G"] * wheelset["a"] * wheelset["b"]
        try:
            return cls(**own, **held, load_N=0.5 * GRAVITY * wheelset["M_v"], slope_N=slope_N)
        except TypeError as e:
            raise KeyError(str(e)) from None

    @property
    def wheelbase_m(self) -> float:
        """From axle to axle."""
        return 2 * self.semi_wheelbase_m

    def changed(self, logs: Mapping[str, float]) -> "BogieConstants":
        """Return the constants times e to the power of the given logs, by names of PRIOR_SIGMA; the load stays."""
        values = {}
        for name, log in logs.items():
            for each in _OF_SHAFT if name == SHAFT else (name,):
                values[each] = getattr(self, each) * float(np.exp(log))
        return replace(self, **values)


def response(
    c: BogieConstants, speed_m_s: ArrayLike, g11_N: ArrayLike, g22_N: ArrayLike, frequency_hz: ArrayLike,
    later_s: ArrayLike = 0.0,
) -> ComplexArray:  # fmt: skip
    """Return the transfer functions (F, 2 wheelsets, 3 SIGNALS, 2 SOURCES) at F frequencies.

    speed_m_s, g11_N, g22_N, later_s: (F,) or one number. The track is that under the leading wheelset; the trailing one
    meets it a wheelbase later, and its signals are taken later_s later.
    """
    s: ComplexArray = (2j * np.pi * np.atleast_1d(np.asarray(frequency_hz, np.float64))).astype(np.complex128)
    v, g11, g22, later = (
        np.broadcast_to(np.asarray(a, np.float64), s.shape) for a in (speed_m_s, g11_N, g22_N, later_s)
    )
    delay = np.exp(-s * c.wheelbase_m / v)
    forces, moved = _equations(c, s, v, _slope_of_turning_wheels(c, s, v, g11), g22, delay)
    q = np.linalg.solve(forces, moved)
    out = np.empty((len(s), 2, len(SIGNALS), len(SOURCES)), np.complex128)
    for wheelset, met in enumerate((np.ones_like(s), delay)):
        y, psi = q[:, 2 * wheelset], q[:, 2 * wheelset + 1]
        alignment, level = np.zeros((2, *y.shape), np.complex128)
        alignment[:, 0], level[:, 1] = met, met
        roll = level + c.gamma / c.L_g * (y - alignment)  # a displaced wheelset rolls on its cones
        out[:, wheelset, 0] = s[:, None] * psi
        out[:, wheelset, 1] = (s * s)[:, None] * y + GRAVITY * roll
        out[:, wheelset, 2] = s[:, None] * roll
    out[:, 1] *= np.exp(s * later)[:, None, None]
    return out


def _slope_of_turning_wheels(c: BogieConstants, s: ComplexArray, v: FloatArray, g11: FloatArray) -> ComplexArray:
    """(F,): g11 as it acts on the yaw. Wheels and shaft give way: below 16 Hz that halves it."""
    shaft, creep = c.k_s / s + c.C_s, c.r_0**2 * g11 / v
    right, left = c.I_R * s + shaft + creep, c.I_L * s + shaft + creep
    turns = ((c.I_L + c.I_R) * s + 2 * creep) / (right * left - shaft * shaft)
    return np.asarray(g11 * (1 - 0.5 * creep * turns))


def _equations(
    c: BogieConstants, s: ComplexArray, v: FloatArray, g11: ComplexArray, g22: FloatArray, delay: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """D (F, 7, 7) and B (F, 7, 2) of D q = B (alignment, cross-level), with q = y and psi of the leading wheelset, the
    trailing one and the frame, y of the body."""
    D, B = np.zeros((len(s), 7, 7), np.complex128), np.zeros((len(s), 7, 2), np.complex128)
    k_y, k_psi = (
        c.primary_lateral_N_m + c.primary_lateral_damping_N_s_m * s,
        c.primary_yaw_N_m_rad + c.primary_yaw_damping_N_m_s_rad * s,
    )
    gravity, cones = 2 * c.load_N * c.gamma / c.L_g, 2 * c.L_g * c.gamma * g11 / c.r_0
    frame, turn, body = 4, 5, 6
    for y, arm, met in ((0, c.semi_wheelbase_m, 1.0), (2, -c.semi_wheelbase_m, delay)):
        psi = y + 1
        D[:, y, y] = c.m_w * s * s + 2 * g22 * s / v + gravity + k_y
        D[:, y, psi] = -2 * g22
        D[:, psi, psi] = c.I_w * s * s + 2 * c.L_g**2 * g11 * s / v + k_psi
        D[:, psi, y] = cones
        D[:, y, frame] = D[:, frame, y] = -k_y
        D[:, y, turn] = D[:, turn, y] = -arm * k_y
        D[:, psi, turn] = D[:, turn, psi] = -k_psi
        B[:, y, 0], B[:, y, 1], B[:, psi, 0] = gravity * met, -c.m_w * GRAVITY * met, cones * met
    k_2 = c.secondary_lateral_N_m + c.secondary_lateral_damping_N_s_m * s
    mean = 0.5 * (1 + delay)  # cross-level under frame and body
    D[:, frame, frame] = c.frame_mass_kg * s * s + 2 * k_y + k_2
    D[:, frame, body] = D[:, body, frame] = -k_2
    D[:, body, body] = c.body_mass_kg * s * s + k_2
    D[:, turn, turn] = (
        c.frame_yaw_inertia_kg_m2 * s * s + 2 * (c.semi_wheelbase_m**2 * k_y + k_psi)
        + c.secondary_yaw_N_m_rad + c.secondary_yaw_damping_N_m_s_rad * s
    )  # fmt: skip
    B[:, frame, 1], B[:, body, 1] = -c.frame_mass_kg * GRAVITY * mean, -c.body_mass_kg * GRAVITY * mean
    return D, B
