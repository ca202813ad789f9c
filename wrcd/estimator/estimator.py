"""From measurements to adhesion, for all axles at once."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from wrcd.estimator.bank import Bank, BoolArray, at_speed, scheduled_speed
from wrcd.estimator.design import MODELS, Design, FloatArray, IntArray
from wrcd.estimator.fuzzy import Fuzzy
from wrcd.estimator.gate import Gate
from wrcd.estimator.identity import Identity
from wrcd.estimator.offset import Offset
from wrcd.estimator.window import Window

CHANGE_TICKS = 4
OFFSET_WINDOWS = 2  # memory of the sensors' offsets, in windows
LEAST_CONTRADICTION_PP = 2.0
LEAST_TORQUE = 0.003  # torque ratio: less is coasting, and says nothing
LEAST_TRACK = 0.03  # of the noise's power: less from the track is not told from none


@dataclass(frozen=True, slots=True)
class Tick:
    """What one tick brought: z and present (2, n), |torque| / (2 N r0) (n,), speed. NaN where nothing is known."""

    number: int
    z: FloatArray
    present: BoolArray
    torque_ratio: FloatArray
    speed_m_s: float


class EstimateDoubt(IntEnum):
    """What speaks against an estimate itself, whatever its inputs are like."""

    NONE = 0
    NO_RULE = 1  # too few rules fire
    BEYOND_TRAINING = 2  # the rules' inputs are further out than any they were made from
    HARSH = 3  # vibration or joints beyond what the rules bear


@dataclass(frozen=True, slots=True)
class Estimate:
    """Per axle (n,), NaN where unknown. Adhesion in percent, half_width in percentage points (90 % interval)."""

    residuals: FloatArray  # (n, 4)
    torque_ratio: FloatArray
    inputs: FloatArray  # (n, 6) what the rules were given
    fuzzy: FloatArray  # 0 … 100
    firing: FloatArray  # total weight of the rules; below 0.05 there is no answer
    rule: IntArray  # that weighs most, from 1; 0 none
    rule_share: FloatArray
    winner: IntArray  # model from 1 whose residual (as the rules see it) is lowest in its own range; 0 none
    mu_available_pct: FloatArray
    half_width_pp: FloatArray
    saturated: BoolArray
    contradicted: BoolArray  # more is in use than the rules, with their interval, say there is: one of them is wrong
    doubt: IntArray  # an EstimateDoubt: what speaks against the estimate itself


def rule_inputs(design: Design, residuals: FloatArray, torque_ratio: FloatArray, speed_m_s: float) -> FloatArray:
    """(n, 6) for residuals (n, 4): log10 of residuals 1 to 3 over residual 4, of residual 4, torque ratio and speed.

    The share of the sensors' noise is taken off first: what is left goes with the track's roughness alike in all four.
    Model 4, in the linear region, takes its present size; what the others make of the same track tells the contact.
    """
    noise = at_speed(design.noise, design.speeds_m_s, speed_m_s)
    logs = np.log10(np.sqrt(np.maximum(residuals**2 - noise**2, LEAST_TRACK * noise**2)))
    torque = np.log10(np.maximum(torque_ratio, LEAST_TORQUE))
    return np.column_stack((logs[:, :-1] - logs[:, -1:], logs[:, -1], torque, np.full(len(logs), np.log10(speed_m_s))))


class Estimator:
    """bank step -> residual RMS -> fuzzy -> adhesion. Never raises on data: what is unknown comes out as NaN.

    Every CHANGE_TICKS ticks the newest part of the window is compared with the rest; where the rail has changed, the
    rest is forgotten, so that the estimate follows in a fraction of the window and says so by a wider interval.
    """

    STATE = (
        "_bank", "_offset", "_gate", "_window", "_speed_m_s", "_whole", "used", "outlier", "good",
        "upset", "outliers", "identity",
    )  # fmt: skip

    def __init__(self, design: Design, axles: int) -> None:
        self.design = design
        self.axles = axles
        self._bank = Bank(design, axles)
        self._offset = Offset(OFFSET_WINDOWS * design.window_ticks, axles)
        self._gate = Gate(axles)
        self._window = Window(design.window_ticks, design.recent_ticks, axles)
        self._fuzzy = Fuzzy(design)
        self.identity = Identity(design.noise_rms, design.tick_s, axles)
        self._speed_m_s = float(design.speeds_m_s[0])
        self._low = np.array([s.centres[0] for s in design.residual_sets])
        self._width = np.array([s.centres[-1] - s.centres[0] for s in design.residual_sets])
        # of the newest tick: which axles' measurements it made use of, and which it left out as absurd
        self.used: BoolArray = np.zeros(axles, dtype=bool)
        self.outlier: BoolArray = np.zeros(axles, dtype=bool)
        self._whole: BoolArray = np.zeros(axles, dtype=bool)  # whether the newest tick brought every measurement
        self.good: BoolArray = np.zeros(axles, dtype=bool)  # whether it went into the window
        self.upset: BoolArray = np.zeros(axles, dtype=bool)
        self.outliers = 0  # samples left out so far

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._whole[axle] = False
        self._offset.reset(axle)
        self._gate.reset(axle)
        self._bank.reset(axle)
        self._window.reset(axle)
        self.identity.reset(axle)

    def step(self, tick: Tick) -> FloatArray:
        """Run the bank for one tick and remember its residuals. Returns the innovations (4, 2, n).

        A tick without both channels, or with an absurd innovation in either, is predicted over. Where absurd ones go
        on, or a filter is not finite, the axle is upset: call reset() for it.
        """
        # one channel alone is not enough: with its part of a gain made for two, a filter would be unstable
        whole = np.logical_and.reduce(tick.present)
        bank, offset = self._bank.x, self._offset.known
        e, w = self._filter(tick, whole)
        absurd = self._gate.absurd(e, whole)
        self.outlier = np.logical_or.reduce(absurd)
        used = whole & ~self.outlier
        if self.outlier.any():
            self.outliers += int(absurd.sum())
            self._bank.x, self._offset.known = bank, offset
            e, w = self._filter(tick, used)
        self.upset = self._gate.learn(e, used, absurd) | ~np.isfinite(self._bank.x).all(axis=(0, 1))
        self.used = used
        self.identity.step(tick.z, used, tick.speed_m_s)
        # the first innovation after a gap is that of several ticks at once, larger than others: it stays out. So a
        # sensor that is slower than the ticks, for which no gain here is made, never gives an estimate
        self.good = used & self._whole & np.isfinite(tick.torque_ratio) & ~self.upset
        self._whole = used
        self._window.put(tick.number, w, self.good, tick.torque_ratio)
        self._speed_m_s = tick.speed_m_s
        if tick.number % CHANGE_TICKS == 0:
            self._window.forget_old(self.design.changes)
        return e

    def _filter(self, tick: Tick, axles: BoolArray) -> tuple[FloatArray, FloatArray]:
        """The bank with the measurements of some axles (n,)."""
        present = np.broadcast_to(axles, tick.present.shape)
        return self._bank.step(self._offset.take(tick.z, present), present, tick.speed_m_s)

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        d = self.design
        residuals = self._window.residuals()
        ratio = self._window.torque_ratio()
        inputs = rule_inputs(d, residuals, ratio, scheduled_speed(self._speed_m_s, d.speeds_m_s))
        inference = self._fuzzy.infer(inputs)
        mu = np.clip(np.polyval(d.polynomial, inference.output), *d.adhesion_range_pct)
        # what is in use is available: the estimate cannot lie below it
        recent = self._window.recent_torque_ratio()
        used = 100.0 * np.where(np.isnan(recent), ratio, recent)
        said = mu
        mu = np.where(np.isnan(mu), np.nan, np.minimum(np.fmax(mu, used), 100.0))
        fits = (inputs[:, :MODELS] - self._low) / self._width
        nearest = np.argmin(np.where(np.isnan(fits), np.inf, fits), axis=1) + 1
        with np.errstate(invalid="ignore"):
            saturated = used >= d.saturated_share * mu
        wider = 1.0 + (d.short_spread - 1.0) * (1.0 - self._window.share())
        half_width = inference.spread * wider * mu
        return Estimate(
            residuals=residuals,
            torque_ratio=ratio,
            inputs=inputs,
            fuzzy=inference.output,
            firing=inference.firing,
            rule=inference.rule,
            rule_share=inference.rule_share,
            winner=np.where(np.isnan(fits).any(axis=1), 0, nearest),
            mu_available_pct=mu,
            half_width_pp=half_width,
            saturated=saturated,
            contradicted=used > said + np.maximum(half_width, LEAST_CONTRADICTION_PP),
            doubt=np.where(np.isnan(said), EstimateDoubt.NO_RULE, EstimateDoubt.NONE),
        )
