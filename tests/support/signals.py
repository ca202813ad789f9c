"""What a gyro and an accelerometer say on a real track, for tests that make their frames themselves."""

import math
from functools import cache

import numpy as np

from sim_ecu.design.cases import Condition, simulate
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import LAT_ACCEL, TORQUE, YAW_RATE, Wheelset
from wrcd.core.design import FloatArray
from wrcd.core.records import Ticks

SETTLE_S = 2.0  # the torque comes up, and the wheelset finds its track


@cache
def measured(
    curve: str = "B",
    torque_Nm: float = 10_000.0,
    speed_m_s: float = 25.0,
    seconds: float = 64.0,
    seed: int = 1,
    sensors: str = "mems",
    tick_s: float = 0.005,
) -> FloatArray:
    """z (ticks, 2) in rad/s and m/s2 of the default wheelset on a middling track, at held speed and torque."""
    w = Wheelset()
    most = peak(speed_m_s, w.contact, *CURVES[curve].row())[1] * 2 * w.normal_N * w.r_0
    condition = Condition(speed_m_s, CURVES[curve], SPECTRA["good"].scaled(2.0), torque_Nm / most, math.nan, seed)
    y = simulate(w, condition, SETTLE_S + seconds, tick_s).outputs[round(SETTLE_S / tick_s) :, 0]
    z = _sensed(y, sensors, seed)
    z.setflags(write=False)
    return z


def _sensed(y: FloatArray, sensors: str, seed: int) -> FloatArray:
    kind, rng = SENSOR_SETS[sensors], np.random.default_rng(seed)
    return np.column_stack((kind.yaw_rate.measure(y[:, YAW_RATE], rng), kind.lat_accel.measure(y[:, LAT_ACCEL], rng)))


HUNTS_FROM_S = 4.5  # `hunting`: a second and a half after the drop


@cache
def hunting(seconds: float = 8.0, tick_s: float = 0.005) -> Ticks:
    """Ticks of a wheelset at 37 m/s that goes from dry rail to curve C under more torque than that
    carries, after 3 s. From then on it swings with its yaw spring, at 13 Hz and by 0.1 rad/s and more."""
    w, speed_m_s, seed = Wheelset(), 37.0, 4
    drop = Condition(
        speed_m_s, CURVES["C"], SPECTRA["poor"], 0.8, math.nan, seed, before=CURVES["A"], changes_at_s=3.0,
        limit_of_peak=1.2,
    )  # fmt: skip
    y = simulate(w, drop, seconds, tick_s).outputs[:, 0]
    z = _sensed(y, "mems", seed)
    ratio = np.abs(y[:, TORQUE, None]) / (2 * w.normal_N * w.r_0)
    return Ticks(0, z[..., None], np.ones((len(z), 2, 1), dtype=bool), ratio, [speed_m_s] * len(z))
