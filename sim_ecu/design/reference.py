"""The reference engine: four filterpy.KalmanFilter per axle and skfuzzy.control. Slow, plain, and no code in common
with the engine on the train; only the design's numbers are the same."""

import json
import warnings
from collections import deque
from collections.abc import Iterable
from functools import reduce
from operator import and_
from pathlib import Path
from typing import Any

import numpy as np
import skfuzzy
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from skfuzzy import control

from sim_ecu.design.gains import Gains, steady_state
from sim_ecu.design.linear import Point
from sim_ecu.physics.contact import CreepCurve
from sim_ecu.physics.wheelset import Wheelset
from wrcd.estimator.design import Design

FloatArray = NDArray[np.float64]
EDGE = 1e-6  # flanks of an output set, as a share of its width


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

    def take_off(self, z: FloatArray, present: NDArray[np.bool_]) -> FloatArray:
        """The measurement (2,) without its mean."""
        for i in range(2):
            if present[i]:
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

    def step(self, z: FloatArray, present: NDArray[np.bool_], matrices: list[FloatArray]) -> FloatArray:
        """Innovations (4, 2) of one tick; a channel that is missing counts as predicted."""
        out = np.empty((4, 2))
        for m, f in enumerate(self._filters):
            f.F, f.K, f.H = matrices[0][m], matrices[1][m], matrices[2][m]
            f.update_steadystate(np.where(present, z, f.H @ f.x))
            out[m] = f.y
            f.predict_steadystate()
        return out


class LiveFilters:
    """Four filters of one axle that carry their covariances, and use what channels there are."""

    def __init__(self, source: "Models") -> None:
        self._source = source
        self.reset()

    def reset(self) -> None:
        """Start from the steady covariance of the first speed seen."""
        self._filters: list[KalmanFilter] | None = None

    def step(self, z: FloatArray, present: NDArray[np.bool_], speed_m_s: float) -> FloatArray:
        """Innovations (4, 2); zero where a channel is missing."""
        models = self._source.at(speed_m_s)
        if self._filters is None:
            self._filters = [KalmanFilter(dim_x=5, dim_z=2) for _ in models]
            for f, g in zip(self._filters, models, strict=True):
                f.x, f.P = np.zeros(5), g.P.copy()
        out = np.zeros((4, 2))
        for m, (f, g) in enumerate(zip(self._filters, models, strict=True)):
            out[m] = np.where(present, z - g.H @ f.x, 0.0)
            rows = np.flatnonzero(present)
            if len(rows) == 2:
                f.update(z, R=g.R, H=g.H)
            elif len(rows) == 1:
                # one channel: a filter of one measurement
                one = KalmanFilter(dim_x=5, dim_z=1)
                one.x, one.P = f.x, f.P
                one.update(z[rows], R=g.R[np.ix_(rows, rows)], H=g.H[rows])
                f.x, f.P = one.x, one.P
            f.predict(F=g.Phi, Q=g.Q)
        return out


def points(document: dict[str, Any]) -> tuple[Point, ...]:
    """The design points of a design document."""
    return tuple(
        Point(
            str(m["name"]),
            CreepCurve(**m["curve"]),
            float(m["creep_of_peak"]),
            tuple(m["noise"]),
            float(m["yaw_rate_weight"]),
        )
        for m in document["bank"]["models"]
    )


class Models:
    """The continuous models behind a design file, discretised at any speed."""

    def __init__(self, design_file: Path) -> None:
        d: dict[str, Any] = json.loads(design_file.read_text(encoding="utf-8"))
        inputs = d["inputs"]
        self._wheelset = Wheelset(**inputs["wheelset"])
        self._noise = (inputs["sensors"]["yaw_rate"]["noise_rms"], inputs["sensors"]["lat_accel"]["noise_rms"])
        self._tick_s = float(d["bank"]["tick_s"])
        self._points = points(d)
        self._ends = d["bank"]["speeds_m_s"][0], d["bank"]["speeds_m_s"][-1]
        self._known: dict[float, list[Gains]] = {}

    def at(self, speed_m_s: float) -> list[Gains]:
        """The four models at a speed rounded to 0.1 m/s, without the grid of the design file."""
        v = float(min(max(np.round(speed_m_s / 0.1) * 0.1, self._ends[0]), self._ends[1]))
        if v not in self._known:
            self._known[v] = [steady_state(self._wheelset, p, v, self._tick_s, self._noise) for p in self._points]
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
    """The rule base in skfuzzy.control: product of the degrees, accumulated by sum, centroid.

    A rule's output is linear in the inputs, so the mean of the rules is linear in the means of their coefficients.
    Each coefficient is a consequent of its own: its sets are crisp intervals of one width around the values that
    occur; cut at a degree their areas are proportional to it, so that the centroid is the weighted mean.
    """

    def __init__(self, design: Design) -> None:
        self._sets = design.sets
        self._antecedents = []
        for i, sets in enumerate(self._sets):
            antecedent = control.Antecedent(sets.centres.copy(), f"input{i}")
            last = len(sets.centres) - 1
            for j, name in enumerate(sets.names):
                c = sets.centres
                corners = [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]
                antecedent[name] = skfuzzy.trimf(antecedent.universe, corners)
            self._antecedents.append(antecedent)
        self._names = ["constant", *(f"slope{i}" for i in range(len(self._sets)))]
        rows = []
        for rule, base, slopes in zip(design.rules, design.bases, design.slopes, strict=True):
            constant = base - sum(s * sets.centres[k] for s, sets, k in zip(slopes, self._sets, rule, strict=True))
            rows.append([constant, *slopes])
        table = np.round(np.array(rows), 9)  # values that differ by less are one
        consequents = [_crisp(name, np.unique(table[:, i])) for i, name in enumerate(self._names)]
        rules = []
        for rule, row in zip(design.rules, table, strict=True):
            terms = [a[s.names[k]] for a, s, k in zip(self._antecedents, self._sets, rule, strict=True)]
            says = [c[f"{v:.12g}"] for c, v in zip(consequents, row, strict=True)]
            rules.append(control.Rule(reduce(and_, terms), says, and_func=np.multiply))
        # the cache of the simulation returns stale outputs: leave it off
        self._simulation = control.ControlSystemSimulation(control.ControlSystem(rules), cache=False)

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy outputs (n,) for inputs (n, 6)."""
        for i in range(inputs.shape[1]):
            self._simulation.input[f"input{i}"] = inputs[:, i].copy()
        with warnings.catch_warnings():
            # scikit-fuzzy calls numpy in a way that numpy has deprecated; the result is the same
            warnings.simplefilter("ignore", DeprecationWarning)
            self._simulation.compute()
        found = [self._simulation.output.get(name) for name in self._names]
        if any(f is None for f in found):
            return np.full(len(inputs), np.nan)
        out = np.asarray(found[0], dtype=np.float64).copy()
        for i, sets in enumerate(self._sets):
            out += np.asarray(found[i + 1]) * np.clip(inputs[:, i], sets.centres[0], sets.centres[-1])
        return np.clip(out, 0.0, 100.0)


def _crisp(name: str, values: FloatArray) -> control.Consequent:
    """A consequent with an interval of one width, too narrow to touch another's, around every value."""
    half = 0.4 * float(np.diff(values).min(initial=1.0)) if len(values) > 1 else 0.5
    edge = half * EDGE
    corners = [[v - half, v - half + edge, v + half - edge, v + half] for v in values]
    ends = [[values[0] - 2 * half], [values[-1] + 2 * half]]
    out = control.Consequent(np.unique(np.concatenate([*corners, *ends])), name)
    out.accumulation_method = np.add
    for v, c in zip(values, corners, strict=True):
        out[f"{v:.12g}"] = skfuzzy.trapmf(out.universe, c)
    return out
