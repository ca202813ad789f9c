"""The bank: four Kalman filters with steady-state gains for every axle, as one matrix product per tick."""

import math
from bisect import bisect_left

import numpy as np
from numpy.typing import NDArray

from wrcd.estimator.design import CHANNELS, MODELS, Design, FloatArray, closed_loop

MEMORY_S = 0.3  # time constant: long against a cycle of the speed signal, short against a braking
RATE_AFTER_TICKS = 20  # before, the rate of change is not known from the noise
MAX_ERROR_M_S = 1.5  # a signal further away than this is another one: start with it


class SpeedFilter:
    """Alpha-beta filter: tracks the speed and its rate, so that a steady acceleration leaves no lag.

    The signal comes every few ticks, with noise and in steps. Gains and noise tables that followed it would toggle.
    """

    _speed: float = math.nan
    _rate: float = 0.0  # per tick
    _ticks: int = 0  # of this signal, as far as they count

    def __init__(self, tick_s: float) -> None:
        self._alpha = 1.0 - math.exp(-tick_s / MEMORY_S)
        self._beta = 0.5 * self._alpha**2
        self._max_ticks = max(RATE_AFTER_TICKS + 1, math.ceil(1.0 / self._alpha))

    def reset(self) -> None:
        """Start with the next signal."""
        self._speed, self._rate, self._ticks = math.nan, 0.0, 0

    def step(self, speed_m_s: float) -> float:
        """The filtered speed (m/s) at a tick whose newest signal is speed_m_s; NaN if that is not finite."""
        if not math.isfinite(speed_m_s):
            self.reset()
            return math.nan
        if not self._ticks or abs(speed_m_s - self._speed) > MAX_ERROR_M_S:
            self._speed, self._rate, self._ticks = speed_m_s, 0.0, 1
            return speed_m_s
        predicted = self._speed + self._rate
        error = speed_m_s - predicted
        self._ticks = min(self._ticks + 1, self._max_ticks)
        self._speed = predicted + max(self._alpha, 1.0 / self._ticks) * error
        if self._ticks > RATE_AFTER_TICKS:
            self._rate += self._beta * error
        return self._speed


class SpeedTable:
    """A table (v, …), linear between the speeds (v,), held at its ends."""

    def __init__(self, table: FloatArray, speeds_m_s: FloatArray) -> None:
        self._table, self._speeds = table, [float(v) for v in speeds_m_s]

    def at(self, speed_m_s: float) -> FloatArray:
        """The row at a speed."""
        speeds = self._speeds
        v = min(max(speed_m_s, speeds[0]), speeds[-1])
        i = min(max(bisect_left(speeds, v) - 1, 0), len(speeds) - 2)
        t = (v - speeds[i]) / (speeds[i + 1] - speeds[i])
        out: FloatArray = (1.0 - t) * self._table[i] + t * self._table[i + 1]
        return out


BoolArray = NDArray[np.bool_]
SPEED_STEP = 0.1  # m/s: matrices are made at multiples of this, and are linear between them


class Bank:
    """Innovations of 4 models x n axles.

    Per model, with x the state predicted for this tick and z = [yaw rate, lateral acceleration]:

        e  = z - H x            innovation
        x' = Phi (x + K e)      state predicted for the next tick
        w  = V L^-1 e           innovation in units of its own expected size, S = L L', V the channels' weights

    With s states all three are one product of a (s + 4, s + 2) matrix with [x; z]. The matrices are built at nodes
    SPEED_STEP apart, from the design's tables, and interpolated at every tick: a speed that moves about never makes the
    gains toggle.

    Between the design's speeds A = Phi (I - K H) and B = Phi K are linear: with Phi, K and H linear each by itself, a
    filter that is stable at both ends was not so between them, and its residual grew within a minute.
    """

    x: FloatArray

    def __init__(self, design: Design, axles: int) -> None:
        self._states = design.states
        self._range = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        tables = closed_loop(design.Phi, design.K, design.H), design.Phi @ design.K, design.H, design.whiten
        self._tables = [SpeedTable(table, design.speeds_m_s) for table in tables]
        self._fused: dict[int, FloatArray] = {}
        self._between: dict[int, tuple[FloatArray, FloatArray]] = {}
        self.x = np.zeros((MODELS, self._states, axles))

    def reset(self, axle: int) -> None:
        """Forget what an axle's filters know."""
        self.x[:, :, axle] = 0.0

    def step(self, z: FloatArray, present: BoolArray, speed_m_s: float) -> tuple[FloatArray, FloatArray]:
        """One tick: z and present (2, n). Returns innovations e and whitened innovations w, both (4, 2, n).

        A channel that is not present counts as what the model predicts: its innovation is exactly zero.
        """
        states = self._states
        M = self._matrices(speed_m_s)
        zs = np.broadcast_to(z, (MODELS, *z.shape))
        if not present.all():
            zs = np.where(present, zs, -M[:, states : states + CHANNELS, :states] @ self.x)
        out = M @ np.concatenate((self.x, zs), axis=1)
        self.x = out[:, :states]
        e, w = out[:, states : states + CHANNELS], out[:, states + CHANNELS :]
        if not present.all():
            e, w = np.where(present, e, 0.0), np.where(present, w, 0.0)
        return e, w

    def _matrices(self, speed: float) -> FloatArray:
        """(4, s + 4, s + 2) at a speed, held within the grid."""
        low, high = self._range
        at = min(max(speed, low), high) / SPEED_STEP
        node = int(at)
        found = self._between.get(node)
        if found is None:
            below = self._node(node)
            found = self._between[node] = below, self._node(node + 1) - below
        below, rise = found
        out: FloatArray = below + (at - node) * rise
        return out

    def _node(self, number: int) -> FloatArray:
        found = self._fused.get(number)
        if found is None:
            A, B, H, W = (table.at(number * SPEED_STEP) for table in self._tables)
            states = self._states
            # rows: x' = A x + B z; e = z - H x; w = W e
            M = np.zeros((MODELS, states + 2 * CHANNELS, states + CHANNELS))
            M[:, :states, :states] = A
            M[:, :states, states:] = B
            M[:, states : states + CHANNELS, :states] = -H
            M[:, states : states + CHANNELS, states:] = np.eye(CHANNELS)
            M[:, states + CHANNELS :, :states] = -W @ H
            M[:, states + CHANNELS :, states:] = W
            found = self._fused[number] = M
        return found
