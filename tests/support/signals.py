"""What a gyro and an accelerometer say on a real track, for tests that make their frames themselves."""

import math
from functools import cache

import numpy as np

from sim_ecu.design.cases import Condition, simulate
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import LAT_ACCEL, YAW_RATE, Wheelset
from wrcd.estimator.design import FloatArray

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
    w, kind = Wheelset(), SENSOR_SETS[sensors]
    most = peak(speed_m_s, w.contact, *CURVES[curve].row())[1] * 2 * w.normal_N * w.r_0
    roughness = 2.0 * QUALITY["good"]
    condition = Condition(speed_m_s, CURVES[curve], roughness, torque_Nm / most, math.nan, seed)
    y = simulate(w, condition, SETTLE_S + seconds, tick_s).outputs[round(SETTLE_S / tick_s) :, 0]
    rng = np.random.default_rng(seed)
    z = np.column_stack((kind.yaw_rate.measure(y[:, YAW_RATE], rng), kind.lat_accel.measure(y[:, LAT_ACCEL], rng)))
    z.setflags(write=False)
    return z
