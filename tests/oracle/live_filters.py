"""Four filterpy.KalmanFilter per axle that carry their covariances, beside steady-state gains."""

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from sim_ecu.design.brief import Recipe
from sim_ecu.design.linear import Gains, steady_state

FloatArray = NDArray[np.float64]

NODE_M_S = 0.1  # models are made at multiples of this speed


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
