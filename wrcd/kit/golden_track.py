"""A track for the estimator's golden vectors: what the sensors of a train bring, without a train."""

import math
from random import Random

import numpy as np

from wrcd.core.design import Design, FloatArray
from wrcd.core.records import Ticks
from wrcd.core.terms import CHANNELS

FIRST_TICK, TICKS = 1001, 800
# Ticks from which the rail is another one, and at which something happens.
_DROP, _PULSES, _GAP, _ONE_LOST, _OUTLIER, _RUN, _NO_TORQUE = 480, range(90, 800, 130), 300, 350, 400, 640, 720
_GAP_TICKS, _RUN_TICKS = 8, 6
_BEFORE, _AFTER = 3, 2  # models of the bank: high adhesion, low
_SIZE, _MOST_RAD_S = 0.5, 0.005  # of the innovations, over what the models expect: a smooth track; of a yaw rate's
_SPEED_M_S, _SPEED_PER_TICK = 20.0, 0.002  # over nodes of the bank's matrices
_MAX_GROWTH = 1.001  # of a model's state in a tick: the track must end before a wheelset that hunts runs away
_OFFSETS, _LIMITS = np.array([[0.001], [0.2]]), np.array([[0.5], [20.0]])  # rad/s, m/s2
_PULSE_M_S2, _OUTLIER_RAD_S, _RATIO, _RATIO_AFTER = 5.0, 0.3, 0.06, 0.045


def track(design: Design, axles: int, seed: int = 1) -> Ticks:
    """Consecutive ticks: each axle as one of the bank's models expects it, after a drop of adhesion as another one.

    With rail joints, lost measurements, an outlier, so many in a row that the last axle is reset, an unknown torque.
    """
    random = Random(seed)
    grows = np.abs(np.linalg.eigvals(design.Phi[:, (_BEFORE, _AFTER)])).max(axis=(1, 2)) > _MAX_GROWTH
    place = int(np.where(grows, np.inf, np.abs(design.speeds_m_s - _SPEED_M_S)).argmin())
    speeds = [round(float(design.speeds_m_s[place]) + _SPEED_PER_TICK * k, 4) for k in range(TICKS)]
    x = np.zeros((design.states, axles))
    z, ratio = np.empty((TICKS, CHANNELS, axles)), np.empty((TICKS, axles))
    for k in range(TICKS):
        model = _BEFORE if k < _DROP else _AFTER
        Phi, K, H, whiten = (a[place, model] for a in (design.Phi, design.K, design.H, design.whiten))
        size = min(_SIZE, _MOST_RAD_S * whiten[0, 0])
        e = np.linalg.solve(whiten, [[random.gauss(0.0, size) for _ in range(axles)] for _ in range(CHANNELS)])
        z[k] = H @ x + e + _OFFSETS
        x = Phi @ (x + K @ e)
        ratio[k] = [(_RATIO if k < _DROP else _RATIO_AFTER) + random.gauss(0.0, 0.0005) for _ in range(axles)]
    for axle in range(axles):
        for at in _PULSES:
            z[at + axle : at + axle + 3, 1, axle] += (_PULSE_M_S2, -_PULSE_M_S2, 0.5 * _PULSE_M_S2)
    z[_GAP : _GAP + _GAP_TICKS, :, 0] = z[_ONE_LOST, 1, 0] = ratio[_NO_TORQUE, 0] = math.nan
    z[_OUTLIER, 0, 0] += _OUTLIER_RAD_S
    z[_RUN : _RUN + _RUN_TICKS, 0, -1] += _OUTLIER_RAD_S
    z = np.clip(z, -_LIMITS, _LIMITS).round(6)
    return Ticks(FIRST_TICK, z, np.isfinite(z), ratio.round(6), speeds)


def shown(values: FloatArray) -> str:
    """Numbers in C, in braces as the array has its axes."""
    if values.ndim:
        return "{" + ", ".join(map(shown, values)) + "}"
    return f"{float(values):.12g}".replace("nan", "NAN").replace("inf", "INFINITY")
