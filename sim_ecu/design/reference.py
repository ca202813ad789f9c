"""The reference engine: four filterpy.KalmanFilter per axle and skfuzzy.control. Slow, plain, and no code in common
with the engine on the train; only the design's numbers are the same."""

import json
import warnings
from collections import deque
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
EDGE = 1e-6  # width of the flanks of an output set


class Schedule:
    """The design's matrices at a speed: linear over the grid, the speed rounded to 0.1 m/s and held within it."""

    def __init__(self, design: Design) -> None:
        self._ends = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        tables = (design.Phi, design.K, design.H, design.whiten)
        self._lines = [make_interp_spline(design.speeds_m_s, t, k=1) for t in tables]

    def at(self, speed_m_s: float) -> list[FloatArray]:
        """Phi, K, H and the whitening matrix of the four models."""
        v = min(max(np.round(speed_m_s / 0.1) * 0.1, self._ends[0]), self._ends[1])
        return [line(v) for line in self._lines]


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


class Models:
    """The continuous models behind a design file, discretised at any speed."""

    def __init__(self, design_file: Path) -> None:
        d: dict[str, Any] = json.loads(design_file.read_text(encoding="utf-8"))
        inputs = d["inputs"]
        self._wheelset = Wheelset(**inputs["wheelset"])
        self._noise = (inputs["sensors"]["yaw_rate"]["noise_rms"], inputs["sensors"]["lat_accel"]["noise_rms"])
        self._tick_s = float(d["bank"]["tick_s"])
        self._points = [
            Point(m["name"], CreepCurve(**inputs["curves"][m["curve"]]), m["creep_of_peak"], tuple(m["noise"]))
            for m in d["bank"]["models"]
        ]
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

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._rows: deque[tuple[int, FloatArray, float]] = deque()

    def reset(self) -> None:
        """Forget them."""
        self._rows.clear()

    def put(self, tick: int, whitened: FloatArray, good: bool, ratio: float) -> None:
        """One tick; a tick without data leaves nothing behind."""
        if good:
            self._rows.append((tick, whitened, ratio))
        while self._rows and self._rows[0][0] <= tick - self._ticks:
            self._rows.popleft()

    def inputs(self) -> FloatArray | None:
        """log10 of the four residuals and of the torque ratio (5,), or None without data."""
        if not self._rows:
            return None
        w = np.array([row[1] for row in self._rows])  # (ticks, 4, 2)
        residual = np.maximum(np.sqrt(np.var(w, axis=0).mean(axis=1)), 1e-6)
        ratio = max(float(np.mean([row[2] for row in self._rows])), 1e-6)
        return np.append(np.log10(residual), np.log10(ratio))


class FuzzyReference:
    """The rule base in skfuzzy.control: product of the degrees, accumulated by sum, centroid.

    The output sets are crisp intervals of one width around 0, 5, … 100; cut at a degree their areas are proportional
    to it, so that the centroid is what the engine on the train computes as a weighted mean.
    """

    def __init__(self, design: Design) -> None:
        self._antecedents = []
        for i, sets in enumerate((*design.residual_sets, design.torque_sets)):
            antecedent = control.Antecedent(sets.centres.copy(), f"input{i}")
            last = len(sets.centres) - 1
            for j, name in enumerate(sets.names):
                c = sets.centres
                corners = [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]
                antecedent[name] = skfuzzy.trimf(antecedent.universe, corners)
            self._antecedents.append(antecedent)
        levels = np.unique(design.consequents)
        half = 2.5
        universe = np.concatenate([[v - half, v - half + EDGE, v + half - EDGE, v + half] for v in levels])
        universe = np.unique(np.concatenate((universe, [-half, 100 + half])))
        output = control.Consequent(universe, "output")
        output.accumulation_method = np.add
        for v in levels:
            output[f"{v:g}"] = skfuzzy.trapmf(universe, [v - half, v - half + EDGE, v + half - EDGE, v + half])
        rules = []
        for row, consequent in zip(design.rules, design.consequents, strict=True):
            every = self._antecedents
            names = [sets.names[k] for sets, k in zip((*design.residual_sets, design.torque_sets), row, strict=True)]
            term = (
                every[0][names[0]] & every[1][names[1]] & every[2][names[2]] & every[3][names[3]] & every[4][names[4]]
            )
            rules.append(control.Rule(term, output[f"{consequent:g}"], and_func=np.multiply))
        # the cache of the simulation returns stale outputs: leave it off
        self._simulation = control.ControlSystemSimulation(control.ControlSystem(rules), cache=False)

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy outputs (n,) for inputs (n, 5)."""
        for i in range(inputs.shape[1]):
            self._simulation.input[f"input{i}"] = inputs[:, i].copy()
        with warnings.catch_warnings():
            # scikit-fuzzy calls numpy in a way that numpy has deprecated; the result is the same
            warnings.simplefilter("ignore", DeprecationWarning)
            self._simulation.compute()
        found = self._simulation.output.get("output")
        out: FloatArray = np.full(len(inputs), np.nan) if found is None else np.asarray(found, dtype=np.float64)
        return out
