"""The reference engine: four filterpy.KalmanFilter per axle and scikit-fuzzy. Slow, plain, and no code in common
with the engine on the train; only the design's numbers are the same."""

from collections import deque
from collections.abc import Iterable

import numpy as np
import skfuzzy
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from sim_ecu.design.gains import Gains, steady_state
from sim_ecu.design.source import Source
from wrcd.estimator.design import Design

FloatArray = NDArray[np.float64]


class Schedule:
    """The design's matrices at a speed: linear over the grid, the speed rounded to 0.1 m/s and held within it."""

    def __init__(self, design: Design) -> None:
        self._ends = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        tables = (design.Phi, design.K, design.H, design.whiten, design.noise)
        self._lines = [make_interp_spline(design.speeds_m_s, t, k=1) for t in tables]

    def at(self, speed_m_s: float) -> list[FloatArray]:
        """Phi, K, H, the whitening matrix and the noise's residual of the four models."""
        v = self.rounded(speed_m_s)
        return [line(v) for line in self._lines]

    def rounded(self, speed_m_s: float) -> float:
        """The speed that counts."""
        return float(min(max(np.round(speed_m_s / 0.1) * 0.1, self._ends[0]), self._ends[1]))


class RunningMean:
    """Mean of each channel of one axle: of everything so far, then exponentially over a number of ticks."""

    def __init__(self, ticks: int) -> None:
        self._most = ticks
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet."""
        self._seen, self._mean = [0, 0], [0.0, 0.0]

    def take_off(self, z: FloatArray, used: bool) -> FloatArray:
        """The measurement (2,) without its mean."""
        for i in range(2):
            if used:
                self._seen[i] = min(self._seen[i] + 1, self._most)
                self._mean[i] += (float(z[i]) - self._mean[i]) / self._seen[i]
        return np.asarray(z - np.array(self._mean))


class Filters:
    """Four filters of one axle with the design's gains."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Four filters that know nothing."""
        self._filters = [KalmanFilter(dim_x=5, dim_z=2) for _ in range(4)]
        for f in self._filters:
            f.x = np.zeros(5)

    def step(self, z: FloatArray, used: bool, matrices: list[FloatArray]) -> FloatArray:
        """Innovations (4, 2) of one tick; what is not used counts as predicted."""
        out = np.empty((4, 2))
        for m, f in enumerate(self._filters):
            f.F, f.K, f.H = matrices[0][m], matrices[1][m], matrices[2][m]
            f.update_steadystate(z if used else f.H @ f.x)
            out[m] = f.y
            f.predict_steadystate()
        return out


class LiveFilters:
    """Four filters of one axle that carry their covariances."""

    def __init__(self, source: "Models") -> None:
        self._source = source
        self.reset()

    def reset(self) -> None:
        """Start from the steady covariance of the first speed seen."""
        self._filters: list[KalmanFilter] | None = None

    def step(self, z: FloatArray, used: bool, speed_m_s: float) -> FloatArray:
        """Innovations (4, 2) of one tick; one that is not used is predicted over."""
        models = self._source.at(speed_m_s)
        if self._filters is None:
            self._filters = [KalmanFilter(dim_x=5, dim_z=2) for _ in models]
            for f, g in zip(self._filters, models, strict=True):
                f.x, f.P = np.zeros(5), g.P.copy()
        out = np.zeros((4, 2))
        for m, (f, g) in enumerate(zip(self._filters, models, strict=True)):
            if used:
                out[m] = z - g.H @ f.x
                f.update(z, R=g.R, H=g.H)
            f.predict(F=g.Phi, Q=g.Q)
        return out


class Models:
    """The continuous models behind a design, discretised at any speed."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._noise = (source.sensors.yaw_rate.noise_rms, source.sensors.lat_accel.noise_rms)
        self._ends = float(source.design.speeds_m_s[0]), float(source.design.speeds_m_s[-1])
        self._known: dict[float, list[Gains]] = {}

    def at(self, speed_m_s: float) -> list[Gains]:
        """The four models at a speed rounded to 0.1 m/s, without the grid of the design file."""
        v = float(min(max(np.round(speed_m_s / 0.1) * 0.1, self._ends[0]), self._ends[1]))
        if v not in self._known:
            s = self._source
            self._known[v] = [steady_state(s.wheelset, p, v, s.design.tick_s, self._noise) for p in s.points]
        return self._known[v]


class SlidingWindow:
    """The last ticks of one axle as plain lists."""

    def __init__(self, design: Design) -> None:
        self._ticks, self._recent = design.window_ticks, design.recent_ticks
        self._limits = design.changes
        self._rows: deque[tuple[int, FloatArray, float]] = deque()

    def reset(self) -> None:
        """Forget them."""
        self._rows.clear()

    def put(self, tick: int, whitened: FloatArray, good: bool, ratio: float) -> None:
        """One tick; a tick without data leaves nothing behind. Every fourth tick a change of rail is looked for."""
        if good:
            self._rows.append((tick, whitened, ratio))
        while self._rows and self._rows[0][0] <= tick - self._ticks:
            self._rows.popleft()
        if tick % 4 == 0:
            new = [row for row in self._rows if row[0] > tick - self._recent]
            old = [row for row in self._rows if row[0] <= tick - self._recent]
            if 2 * min(len(new), len(old)) >= self._recent:
                step = np.log10(residuals(new)) - np.log10(residuals(old))
                if np.any(np.abs(step) > self._limits):
                    self._rows = deque(new)

    def inputs(self, noise: FloatArray, speed_m_s: float) -> FloatArray | None:
        """What the rules are given (6,), or None with too little data. noise (4,): what the sensors alone leave."""
        if 2 * len(self._rows) < self._recent:
            return None
        ratio = max(float(np.mean([row[2] for row in self._rows])), 0.003)
        track = np.array([max(r * r - n * n, 0.03 * n * n) for r, n in zip(residuals(self._rows), noise, strict=True)])
        power = np.append(track[:3] / track[3], track[3])
        return np.concatenate((0.5 * np.log10(power), [np.log10(ratio), np.log10(speed_m_s)]))


def residuals(rows: Iterable[tuple[int, FloatArray, float]]) -> FloatArray:
    """RMS of each model's whitened innovations about a straight line (4,)."""
    rows = list(rows)
    w = np.array([row[1].ravel() for row in rows])  # (ticks, 8)
    t = np.array([row[0] for row in rows], dtype=np.float64)
    line = np.polynomial.polynomial.polyfit(t - t[0], w, 1 if len(rows) > 1 else 0)
    rest = w - np.polynomial.polynomial.polyval(t - t[0], line).T
    return np.asarray(np.maximum(np.sqrt(np.square(rest).mean(axis=0).reshape(4, 2).mean(axis=1)), 1e-6))


class FuzzyReference:
    """The rule base rule by rule: scikit-fuzzy's membership functions, the product of the degrees, the weighted mean.

    Not by skfuzzy.control: a rule's output is linear in the inputs, which its consequents cannot say; as seven
    consequents beside each other (a constant and six slopes) it takes minutes for what this does in milliseconds.
    """

    def __init__(self, design: Design) -> None:
        self._design = design
        self._functions = []
        for sets in design.sets:
            c, last = sets.centres, len(sets.centres) - 1
            self._functions.append(
                [skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]) for j in range(len(c))]
            )

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy outputs (n,) for inputs (n, 6); NaN where no rule speaks at all."""
        return np.array([self._output(row) for row in inputs])

    def _output(self, row: FloatArray) -> float:
        d = self._design
        held = [min(max(float(x), s.centres[0]), s.centres[-1]) for x, s in zip(row, d.sets, strict=True)]
        above = total = 0.0
        for rule, base, slopes in zip(d.rules, d.bases, d.slopes, strict=True):
            weight, says = 1.0, float(base)
            for x, sets, functions, k, slope in zip(held, d.sets, self._functions, rule, slopes, strict=True):
                weight *= float(skfuzzy.interp_membership(sets.centres, functions[k], x))
                says += float(slope) * (x - float(sets.centres[k]))
            above, total = above + weight * says, total + weight
        return min(max(above / total, 0.0), 100.0) if total > 0 else float("nan")
