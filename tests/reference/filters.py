"""The bank's oracle: four filterpy.KalmanFilter per axle. Slow, plain, and no code in common with the engine on the
train; only the design's numbers are the same."""

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from sim_ecu.design.brief import Recipe
from sim_ecu.design.linear import Gains, steady_state
from wrcd.estimator.design import Design

FloatArray = NDArray[np.float64]

NODE_M_S = 0.1  # matrices are made at multiples of this speed and are linear between them


class Schedule:
    """The design's matrices at a speed, held within its grid: those of the predictor are linear between nodes, and
    there linear over the grid."""

    def __init__(self, design: Design) -> None:
        self._ends = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        corrected = np.einsum("vmij,vmjk->vmik", design.Phi, design.K)  # what a measurement adds to the next state
        predictor = design.Phi - np.einsum("vmij,vmjk->vmik", corrected, design.H)
        tables = (predictor, corrected, design.H)
        self._lines = [make_interp_spline(design.speeds_m_s, t, k=1) for t in tables]

    def _held(self, speed_m_s: float) -> float:
        return min(max(speed_m_s, self._ends[0]), self._ends[1])

    def at(self, speed_m_s: float) -> list[FloatArray]:
        """F, K and H of the four models.

        Interpolated are the matrices of the predictor x' = A x + B z, with A = F (I - K H) and B = F K, and H; F and K
        follow from them.
        """
        v = self._held(speed_m_s)
        below = NODE_M_S * np.floor(v / NODE_M_S)
        share = (v - below) / NODE_M_S
        A, B, H = (
            (1 - share) * low + share * high
            for low, high in zip(self._predictor(below), self._predictor(below + NODE_M_S), strict=True)
        )
        F = A + B @ H
        return [F, np.linalg.solve(F, B), H]

    def _predictor(self, speed_m_s: float) -> tuple[FloatArray, ...]:
        return tuple(line(self._held(speed_m_s)) for line in self._lines)


class Filters:
    """Four filters of one axle with the design's gains. states: of each."""

    def __init__(self, states: int) -> None:
        self._states = states
        self.reset()

    def reset(self) -> None:
        """Four filters that know nothing."""
        self._filters = [KalmanFilter(dim_x=self._states, dim_z=2) for _ in range(4)]
        for f in self._filters:
            f.x = np.zeros(self._states)

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
            self._filters = [KalmanFilter(dim_x=len(g.P), dim_z=2) for g in models]
            for f, g in zip(self._filters, models, strict=True):
                f.x, f.P = np.zeros(len(g.P)), g.P.copy()
        out = np.zeros((4, 2))
        for m, (f, g) in enumerate(zip(self._filters, models, strict=True)):
            if used:
                out[m] = z - g.H @ f.x
                f.update(z, R=g.R, H=g.H)
            f.predict(F=g.Phi, Q=g.Q)
        return out


class Models:
    """The continuous models behind a design, discretised at any speed."""

    def __init__(self, source: Recipe) -> None:
        self._source = source
        self._noise = (source.sensors.yaw_rate.noise_rms, source.sensors.lat_accel.noise_rms)
        self._ends = float(source.design.speeds_m_s[0]), float(source.design.speeds_m_s[-1])
        self._known: dict[float, list[Gains]] = {}

    def at(self, speed_m_s: float) -> list[Gains]:
        """The four models at a speed rounded to 0.1 m/s, without the grid of the design file."""
        v = float(min(max(np.round(speed_m_s / NODE_M_S) * NODE_M_S, self._ends[0]), self._ends[1]))
        if v not in self._known:
            s = self._source
            self._known[v] = [steady_state(s.wheelset, p, v, s.design.tick_s, self._noise) for p in s.points]
        return self._known[v]
