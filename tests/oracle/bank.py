"""The bank's oracle: four of filterpy's Kalman filters for every axle, and the filtered speed."""

import math
from bisect import bisect_left

import numpy as np
from filterpy.kalman import KalmanFilter

from wrcd.core.design import BoolArray, Design, FloatArray
from wrcd.core.terms import CHANNELS, MODELS

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


SPEED_STEP = 0.1  # m/s: matrices are made at multiples of this, and are linear between them


class Schedule:
    """The design's matrices at a speed, held within its grid: those of the predictor are linear between nodes, and
    there linear over the grid."""

    def __init__(self, design: Design) -> None:
        self._ends = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        corrected = np.einsum("vmij,vmjk->vmik", design.Phi, design.K)  # what a measurement adds to the next state
        predictor = design.Phi - np.einsum("vmij,vmjk->vmik", corrected, design.H)
        tables = predictor, corrected, design.H, design.whiten
        self._tables = [SpeedTable(table, design.speeds_m_s) for table in tables]
        self._nodes: dict[int, list[FloatArray]] = {}

    def at(self, speed_m_s: float) -> tuple[FloatArray, ...]:
        """Of the four models A, B and H, and what whitens their innovations: W, and W H. W H is interpolated by itself:
        of W and H at a speed it would be another."""
        at = min(max(speed_m_s, self._ends[0]), self._ends[1]) / SPEED_STEP
        below = int(at)
        share = at - below
        both = zip(self._node(below), self._node(below + 1), strict=True)
        return tuple((1.0 - share) * low + share * high for low, high in both)

    def _node(self, number: int) -> list[FloatArray]:
        if number not in self._nodes:
            A, B, H, W = (table.at(number * SPEED_STEP) for table in self._tables)
            self._nodes[number] = [A, B, H, W, W @ H]
        return self._nodes[number]


class Bank:
    """Innovations of 4 models x n axles, by filters with the design's steady-state gains.

    Per model, with x the state predicted for this tick and z = [yaw rate, lateral acceleration]:

        e  = z - H x            innovation
        x' = A x + B z          state predicted for the next tick: A = F (I - K H), B = F K
        w  = V L^-1 e           innovation in units of its own expected size, S = L L', V the channels' weights

    The filters predict in one step, with A as transition and z as control, and correct with no gain: A and B
    are linear between the design's speeds, F and K are not. With F = A + B H and K = F^-1 B the rules' output differs
    by up to 1.1e-9 from the estimator's on fuzzed ticks, so by up to 8e-10: rounding of states that H makes large.
    """

    def __init__(self, design: Design, axles: int) -> None:
        self._schedule, self._axles = Schedule(design), range(axles)
        self._filters = [
            [KalmanFilter(dim_x=design.states, dim_z=CHANNELS) for _ in range(MODELS)] for _ in self._axles
        ]
        self._before = np.zeros((axles, MODELS, design.states))
        for axle in self._axles:
            self.reset(axle)

    def reset(self, axle: int) -> None:
        """Forget what an axle's filters know."""
        for f in self._filters[axle]:
            f.x = np.zeros(f.dim_x)

    def step(self, z: FloatArray, present: BoolArray, speed_m_s: float) -> tuple[FloatArray, FloatArray]:
        """One tick: z (2, n), of the axles (n,) that are present. Returns innovations e and whitened innovations w,
        both (4, 2, n); zero where an axle is predicted over."""
        A, B, H, W, WH = self._schedule.at(speed_m_s)
        e, w = np.zeros((2, MODELS, CHANNELS, len(self._axles)))
        for axle in self._axles:
            for m, f in enumerate(self._filters[axle]):
                f.F, f.B, f.H = A[m], B[m], H[m]
                self._before[axle, m] = f.x
                expected = f.H @ f.x
                measured = z[:, axle] if present[axle] else expected
                f.update_steadystate(measured)
                if present[axle]:
                    e[m, :, axle], w[m, :, axle] = f.y, W[m] @ measured - WH[m] @ f.x
                f.predict_steadystate(measured, f.B)
        return e, w

    def leave_out(self, axle: int) -> None:
        """Predict an axle over the newest tick, whose measurement was used."""
        for f, x in zip(self._filters[axle], self._before[axle], strict=True):
            f.x = x.copy()
            f.predict_steadystate(f.H @ f.x, f.B)

    def finite(self, axle: int) -> bool:
        """Whether every filter of an axle has a state."""
        return all(bool(np.isfinite(f.x).all()) for f in self._filters[axle])
