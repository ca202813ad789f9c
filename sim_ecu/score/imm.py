"""Baseline: filterpy's interacting multiple models over the design's four filters."""

import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter

from sim_ecu.design.gains import Gains, steady_state
from sim_ecu.design.linear import Point
from sim_ecu.physics.contact import peak
from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.score.ticks import FloatArray, Ticks, running_mean

SLOWEST = 3.0  # m/s: matrices are made for whole m/s from here on

# Chosen by mean absolute error on 448 conditions of an earlier design's plan, among 0.25 … 0.99999.
STAY = 0.7  # probability that a model still holds at the next tick; the others share the rest


class Imm:
    """One estimator for each axle. It is slow: every tick is some dozens of small matrix products in Python.

    shares (models,): what each model speaks for, as a share of its own curve's peak at that speed, or None before that
    is fitted. With 1 for all the answer is worse than the torque alone, because the design's process noise is made for
    telling residuals, not for likelihoods. A model near 0 speaks for the torque ratio, the least that there can be.
    """

    def __init__(
        self, wheelset: Wheelset, points: tuple[Point, ...], sensors: SensorSet, tick_s: float, window_s: float,
        shares: FloatArray | None = None,
    ) -> None:  # fmt: skip
        self._shares = np.ones(len(points)) if shares is None else shares
        self._wheelset, self._points, self._tick_s = wheelset, points, tick_s
        self._noise = (sensors.yaw_rate.noise_rms, sensors.lat_accel.noise_rms)
        self._window = round(window_s / tick_s)
        n = len(points)
        self._transition = np.full((n, n), (1.0 - STAY) / (n - 1)) + np.eye(n) * (STAY - (1.0 - STAY) / (n - 1))
        self._known: dict[float, list[Gains]] = {}

    def gains(self, speed_m_s: float) -> list[Gains]:
        """The models' matrices at a speed rounded to 1 m/s."""
        v = max(float(np.round(speed_m_s)), SLOWEST)
        if v not in self._known:
            self._known[v] = [steady_state(self._wheelset, p, v, self._tick_s, self._noise) for p in self._points]
        return self._known[v]

    def probabilities(self, ticks: Ticks) -> FloatArray:
        """Mode probabilities after every tick, (t, n, models). They do not depend on the ticks to come."""
        t, n = ticks.torque_ratio.shape
        out = np.empty((t, n, len(self._points)))
        z = np.where(ticks.present, ticks.z, 0.0)
        for i in range(n):
            gains = self.gains(ticks.speed_m_s[0])
            imm = IMMEstimator([_filter(g) for g in gains], np.ones(len(gains)), self._transition)
            for k in range(t):
                gains = self.gains(ticks.speed_m_s[k])
                for f, g in zip(imm.filters, gains, strict=True):
                    # a row of zeros: a channel that is missing says nothing, and the same of every model
                    f.F, f.Q, f.H = g.Phi, g.Q, g.H * ticks.present[k, :, i, None]
                imm.predict()
                with np.errstate(invalid="ignore", divide="ignore"):
                    imm.update(z[k, :, i])
                if not np.isfinite(imm.mu).all():
                    self._restore(imm, out[k - 1, i] if k else np.full(len(gains), 1.0 / len(gains)))
                out[k, i] = imm.mu
        return out

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Available adhesion in percent, (t, n): levels weighted by the probabilities' means over the window."""
        return np.fmax(self.parts(ticks) @ self._shares, 100.0 * ticks.torque_ratio)

    def parts(self, ticks: Ticks) -> FloatArray:
        """(t, n, models): each model's mean probability over the window times the peak of its curve, percent."""
        mean = running_mean(self.probabilities(ticks), self._window)
        return np.asarray(mean * np.stack([self._peaks(v) for v in ticks.speed_m_s])[:, None, :])

    def _peaks(self, speed_m_s: float) -> FloatArray:
        """The peak of each model's curve, percent."""
        v, c = max(speed_m_s, SLOWEST), self._wheelset.contact
        return np.array([100.0 * peak(v, c, *p.curve.row())[1] for p in self._points])

    def _restore(self, imm: IMMEstimator, mu: FloatArray) -> None:
        """Where every likelihood underflows, the tick says nothing of the models: what was expected of them stands."""
        imm.mu = mu @ self._transition
        imm.cbar = imm.mu @ self._transition
        imm.omega = self._transition * imm.mu[:, None] / imm.cbar


def _filter(g: Gains) -> KalmanFilter:
    f = KalmanFilter(dim_x=len(g.Phi), dim_z=len(g.H))
    f.x, f.P, f.R = np.zeros(len(g.Phi)), g.P.copy(), g.R
    return f
