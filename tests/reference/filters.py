"""The reference engine's filters: four filterpy.KalmanFilter per axle, scipy's second-order sections. Slow, plain, and
no code in common with the engine on the train; only the design's numbers are the same."""

from collections import deque

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.signal import sosfilt

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
        tables = (predictor, corrected, design.H, design.whiten)
        self._lines = [make_interp_spline(design.speeds_m_s, t, k=1) for t in tables]
        self._noise = make_interp_spline(design.speeds_m_s, design.noise_power, k=1)

    def held(self, speed_m_s: float) -> float:
        """The speed that counts."""
        return min(max(speed_m_s, self._ends[0]), self._ends[1])

    def at(self, speed_m_s: float) -> list[FloatArray]:
        """F, K, H and the whitening matrix of the four models.

        Interpolated are the matrices of the predictor x' = A x + B z, with A = F (I - K H) and B = F K, and H; F and K
        follow from them.
        """
        v = self.held(speed_m_s)
        below = NODE_M_S * np.floor(v / NODE_M_S)
        share = (v - below) / NODE_M_S
        A, B, H, W = (
            (1 - share) * low + share * high
            for low, high in zip(self._predictor(below), self._predictor(below + NODE_M_S), strict=True)
        )
        F = A + B @ H
        return [F, np.linalg.solve(F, B), H, W]

    def noise_power(self, speed_m_s: float) -> FloatArray:
        """(4, 2): what the sensors' noise leaves in each model's residual."""
        return np.asarray(self._noise(self.held(speed_m_s)))

    def _predictor(self, speed_m_s: float) -> tuple[FloatArray, ...]:
        return tuple(line(self.held(speed_m_s)) for line in self._lines)


class TrackedSpeed:
    """Alpha-beta filter of the vehicle's speed."""

    def __init__(self, tick_s: float) -> None:
        self._gain = 1 - np.exp(-tick_s / 0.3)
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet."""
        self._seen, self._speed, self._rate = 0, 0.0, 0.0

    def step(self, signal_m_s: float) -> float:
        """The filtered speed."""
        if self._seen == 0 or abs(signal_m_s - self._speed) > 1.5:
            self._seen, self._speed, self._rate = 1, signal_m_s, 0.0
            return self._speed
        self._seen += 1
        error = signal_m_s - (self._speed + self._rate)
        self._speed += self._rate + error * max(self._gain, 1 / self._seen)
        if self._seen > 20:
            self._rate += error * self._gain**2 / 2
        return self._speed


class FourthDifferences:
    """Noise of both channels of one axle, relative to the design's."""

    def __init__(self, noise_rms: FloatArray) -> None:
        self._rms = noise_rms
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet: the design's noise, with the weight of 60 samples."""
        self._past: deque[FloatArray] = deque(maxlen=5)
        self._power, self._seen = np.ones(2), 60

    def step(self, z: FloatArray, used: bool) -> None:
        """One measurement (2,); one that is not used breaks the chain."""
        if not used:
            self._past.clear()
            return
        self._past.append(z / self._rms)
        if len(self._past) == 5:
            power = np.diff(np.array(self._past), 4, axis=0)[0] ** 2 / 70
            self._seen = min(self._seen + 1, 400)
            self._power = self._power + (np.minimum(power, 9 * self._power) - self._power) / self._seen

    def factor(self) -> FloatArray:
        """(2,): what of it counts as the sensors' noise."""
        f = np.sqrt(self._power)
        share = np.clip((f - 2.2) / 0.8, 0, 1)
        return np.asarray((1 - share) * np.clip(f, 0.1, 2.2) + share)


class RunningMean:
    """Mean of each channel of one axle: of everything so far, then exponentially over a number of ticks."""

    def __init__(self, ticks: int) -> None:
        self._most = ticks
        self.reset()

    def reset(self) -> None:
        """Nothing seen yet."""
        self._seen, self._mean = [0, 0], [0.0, 0.0]

    def take_off(self, z: FloatArray, teaches: bool) -> FloatArray:
        """The measurement (2,) without its mean."""
        for i in range(2):
            if teaches:
                self._seen[i] = min(self._seen[i] + 1, self._most)
                self._mean[i] += (float(z[i]) - self._mean[i]) / self._seen[i]
        return np.asarray(z - np.array(self._mean))


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


class Band:
    """The low-pass that one axle's eight whitened innovations go through."""

    def __init__(self, sos: FloatArray) -> None:
        self._sos = sos.copy()  # scipy wants to be able to write into it
        self.reset()

    def reset(self) -> None:
        """At rest."""
        self._state = np.zeros((len(self._sos), 2, 8))

    def step(self, w: FloatArray) -> FloatArray:
        """w (4, 2) of one tick."""
        out, self._state = sosfilt(self._sos, w.reshape(1, 8), axis=0, zi=self._state)
        return np.asarray(out.reshape(4, 2))
