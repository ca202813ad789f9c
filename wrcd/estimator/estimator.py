"""From measurements to adhesion, for all axles at once."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.bank import Bank, BoolArray, scheduled_speed
from wrcd.estimator.design import Design, FloatArray, IntArray
from wrcd.estimator.fuzzy import Fuzzy
from wrcd.estimator.window import Window

CHANGE_TICKS = 4


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick brought: z and present (2, n), |torque| / (2 N r0) (n,), speed. NaN where nothing is known."""

    number: int
    z: FloatArray
    present: BoolArray
    torque_ratio: FloatArray
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """Per axle (n,), NaN where unknown. Adhesion in percent, half_width in percentage points (90 % interval)."""

    residuals: FloatArray  # (n, 4)
    torque_ratio: FloatArray
    fuzzy: FloatArray  # 0 … 100
    firing: FloatArray  # total weight of the rules; below 0.05 there is no answer
    rule: IntArray  # that weighs most, from 1; 0 none
    rule_share: FloatArray
    winner: IntArray  # model from 1 whose residual is lowest against its own sets; 0 none
    mu_available_pct: FloatArray
    half_width_pp: FloatArray
    saturated: BoolArray


class Estimator:
    """bank step -> residual RMS -> fuzzy -> adhesion. Never raises on data: what is unknown comes out as NaN.

    Every CHANGE_TICKS ticks the newest part of the window is compared with the rest; where the rail has changed, the
    rest is forgotten, so that the estimate follows in a fraction of the window and says so by a wider interval.
    """

    def __init__(self, design: Design, axles: int) -> None:
        self.design = design
        self.axles = axles
        self._bank = Bank(design, axles)
        self._window = Window(design.window_ticks, design.recent_ticks, axles)
        self._fuzzy = Fuzzy(design)
        self._speed_m_s = float(design.speeds_m_s[0])
        self._low = np.array([s.centres[0] for s in design.residual_sets])
        self._width = np.array([s.centres[-1] - s.centres[0] for s in design.residual_sets])

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._bank.reset(axle)
        self._window.reset(axle)

    def step(self, tick: Tick) -> FloatArray:
        """Run the bank for one tick and remember its residuals. Returns the innovations (4, 2, n)."""
        e, w = self._bank.step(tick.z, tick.present, tick.speed_m_s)
        good = tick.present.all(axis=0) & np.isfinite(tick.torque_ratio)
        self._window.put(tick.number, w, good, tick.torque_ratio)
        self._speed_m_s = tick.speed_m_s
        if tick.number % CHANGE_TICKS == 0:
            self._window.forget_old(self.design.changes)
        return e

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        d = self.design
        residuals = self._window.residuals()
        ratio = self._window.torque_ratio()
        logs = np.log10(residuals)
        speed = np.full(self.axles, scheduled_speed(self._speed_m_s, d.speeds_m_s))
        inference = self._fuzzy.infer(np.column_stack((logs, np.log10(np.maximum(ratio, 1e-6)), np.log10(speed))))
        mu = np.clip(np.polyval(d.polynomial, inference.output), *d.adhesion_range_pct)
        # what is in use is available: the estimate cannot lie below it
        used = 100.0 * self._window.recent_torque_ratio()
        mu = np.where(np.isnan(mu), np.nan, np.minimum(np.fmax(mu, used), 100.0))
        nearest = np.argmin(np.where(np.isnan(logs), np.inf, (logs - self._low) / self._width), axis=1) + 1
        with np.errstate(invalid="ignore"):
            saturated = used >= d.saturated_share * mu
        wider = 1.0 + (d.short_spread - 1.0) * (1.0 - self._window.share())
        return Estimate(
            residuals=residuals,
            torque_ratio=ratio,
            fuzzy=inference.output,
            firing=inference.firing,
            rule=inference.rule,
            rule_share=inference.rule_share,
            winner=np.where(np.isnan(logs).any(axis=1), 0, nearest),
            mu_available_pct=mu,
            half_width_pp=inference.spread * wider * mu,
            saturated=saturated,
        )
