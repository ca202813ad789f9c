"""The linear wheelset over friction and torque at one speed, tabulated for the extended Kalman filter."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.linear import model
from sim_ecu.physics.compiled import compiled
from sim_ecu.physics.contact import Contact, curve_between, peak, traction_ratio
from sim_ecu.physics.track import OMEGA_C
from sim_ecu.physics.wheelset import Wheelset

FloatArray = NDArray[np.float64]

# Grid of the tables: theta = ln mu_0, and s = sqrt(1 - utilisation), in which g11 is smooth up to the peak.
THETA = np.linspace(math.log(0.02), math.log(0.7), 40)
ROOT_SPARE = np.linspace(0.0, math.sqrt(0.98), 24)
DOUBLINGS = 10  # of the step in which the discretisation starts


class Table(NamedTuple):
    """The model over (theta, s) at one speed: Phi (25), lateral row of H (5), Q (25) in the last axis."""

    entries: FloatArray  # (theta, s, 55)
    log_peak: FloatArray  # ln of the peak's F/N, (theta,)
    start: float
    step: float
    root_spare: float  # the largest


@compiled
def _operating_points(
    curves: FloatArray, root_spare: FloatArray, speed: float, c: Contact
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """ln of the peak's F/N (theta,), g11 and g22 (theta, s) in N where the curve carries (1 - s^2) of its peak."""
    n, m = len(curves), len(root_spare)
    top, g11, g22 = np.empty(n), np.empty((n, m)), np.empty((n, m))
    for i in range(n):
        mu_0, A, B, k_A, k_S = curves[i]
        creep_peak, mu_peak = peak(speed, c, mu_0, A, B, k_A, k_S)
        top[i] = math.log(mu_peak)
        for j in range(m):
            low, high = (0.0, creep_peak) if j else (creep_peak, creep_peak)
            for _ in range(40):
                mid = 0.5 * (low + high)
                if traction_ratio(mid, speed, c, mu_0, A, B, k_A, k_S) < (1 - root_spare[j] ** 2) * mu_peak:
                    low = mid
                else:
                    high = mid
            up, down = high * 1.0001, high * 0.9999
            rise = traction_ratio(up, speed, c, mu_0, A, B, k_A, k_S)
            rise -= traction_ratio(down, speed, c, mu_0, A, B, k_A, k_S)
            g11[i, j] = c.normal_N * rise / (up - down)
            g22[i, j] = c.normal_N * traction_ratio(high, speed, c, mu_0, A, B, k_A, k_S) / high
    return top, g11, g22


def table(w: Wheelset, speed: float, tick_s: float, noise: tuple[float, float, float]) -> Table:
    """The wheelset's linear model at every operating point of every friction, discretised at one speed.

    The state y_t of the linear model, which no output shows, makes room for y_t': the track's slope is white noise
    through a low-pass at OMEGA_C, as the irregularity's spectrum has it.
    """
    curves = np.array([curve_between(math.exp(t)).row() for t in THETA])
    top, g11, g22 = _operating_points(curves, ROOT_SPARE, speed, w.contact)
    (A_0, G, H_0), (A_1, _, _), (A_2, _, H_2) = (model(w, *g, speed) for g in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
    A = A_0 + g11[..., None, None] * (A_1 - A_0) + g22[..., None, None] * (A_2 - A_0)
    H = H_0[1] + g22[..., None] * (H_2 - H_0)[1]
    A[..., 3:, 3] = -speed * OMEGA_C, -1.0
    G[3:, 0] = speed * OMEGA_C, 0.0
    G = G * np.array([math.sqrt(speed / 25.0), 1.0, 1.0]) * np.array(noise)
    h = tick_s / 2**DOUBLINGS
    step = A * h
    Phi = np.eye(5) + step @ (np.eye(5) + step @ (np.eye(5) + step / 3) / 2)
    half = np.eye(5) + step / 2
    Q = half @ (G @ G.T * h) @ half.swapaxes(-1, -2)
    for _ in range(DOUBLINGS):
        Q = Q + Phi @ Q @ Phi.swapaxes(-1, -2)
        Phi = Phi @ Phi
    shape = (*g11.shape, 25)
    entries = np.concatenate((Phi.reshape(shape), H, Q.reshape(shape)), axis=-1)
    return Table(entries, top, THETA[0], THETA[1] - THETA[0], ROOT_SPARE[-1])


@compiled
def log_peak_at(t: Table, theta: float) -> float:
    """ln of F/N at the peak of a rail of this friction."""
    a = min(max((theta - t.start) / t.step, 0.0), len(t.log_peak) - 1.000001)
    i = int(a)
    value: float = t.log_peak[i] + (a - i) * (t.log_peak[i + 1] - t.log_peak[i])
    return value


@compiled
def min_theta(t: Table, ratio: float) -> float:
    """The friction below which the rail could not carry the torque in use."""
    last = len(t.log_peak) - 1
    wanted = math.log(max(ratio, 1e-9))
    if wanted <= t.log_peak[0]:
        return t.start
    i = 0
    while i < last and t.log_peak[i + 1] < wanted:
        i += 1
    if i == last:
        return t.start + last * t.step
    least: float = t.start + t.step * (i + (wanted - t.log_peak[i]) / (t.log_peak[i + 1] - t.log_peak[i]))
    return least


@compiled
def look_up(t: Table, theta: float, ratio: float, out: FloatArray) -> None:
    """The first len(out) entries where a rail of this friction carries the torque ratio; at its peak if it cannot."""
    a = min(max((theta - t.start) / t.step, 0.0), t.entries.shape[0] - 1.000001)
    spare = math.sqrt(1.0 - min(ratio / math.exp(log_peak_at(t, theta)), 1.0))
    b = min(spare / t.root_spare * (t.entries.shape[1] - 1), t.entries.shape[1] - 1.000001)
    i, j = int(a), int(b)
    a, b = a - i, b - j
    for k in range(len(out)):
        near = (1 - b) * t.entries[i, j, k] + b * t.entries[i, j + 1, k]
        far = (1 - b) * t.entries[i + 1, j, k] + b * t.entries[i + 1, j + 1, k]
        out[k] = (1 - a) * near + a * far
