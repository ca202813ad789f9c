"""From measurements to adhesion, for all axles at once."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from wrcd.estimator.bank import Bank, BoolArray, scheduled_speed
from wrcd.estimator.design import MODELS, Design, FloatArray, IntArray
from wrcd.estimator.fuzzy import LOW_FIRING, Fuzzy, Inference
from wrcd.estimator.gate import Gate
from wrcd.estimator.identity import BLOCK_S, Identity
from wrcd.estimator.joints import HOLD_TICKS, MAX_PULSE, Joints
from wrcd.estimator.noise import NoiseLevel
from wrcd.estimator.offset import Offset
from wrcd.estimator.rule_inputs import Past, excitation, rule_inputs
from wrcd.estimator.sections import Sections
from wrcd.estimator.speed import SpeedFilter
from wrcd.estimator.window import (
    BLOCK_TICKS,
    RATIO,
    RATIO_N,
    Statistics,
    Window,
    mean_ratio,
    newest,
    raw_power,
    statistics,
)

OFFSET_WINDOWS = 2  # memory of the sensors' offsets, in windows
NOW_S = 0.06  # the torque of so long is the torque of the moment
# A torque of the moment that differs by this share and this ratio from what it was is a change, of the drive or of the
# rail: the window from before is dropped. The first is against the STEP_S before, the second against all of the rest: a
# driver's slow turning of the torque leaves the window longer than a slide does.
STEP_S = 0.16
TORQUE_STEP, TORQUE_STEP_RATIO = 0.15, 0.004
TORQUE_TURN, TORQUE_TURN_RATIO = 0.15, 0.01
# A window grows beyond its usual length over parts of PART_S whose torque differs from the moment's by less.
PART_S, LIKE_TORQUE, LIKE_TORQUE_RATIO = 0.1, 0.10, 0.002
# Where the usual window's own word differs from the long one's by so many half-widths (as logarithms), it counts.
# On the way there it counts in part: one late frame must not make the answer hop from one to the other.
FALL_BACK_BELOW, FALL_BACK_ABOVE = 0.4, 0.7
NEWEST_SHARE = 0.5  # of the newest part's half-width that the interval is made to reach down to
# More in use than the rules say there is: beyond the interval, and by this share of what they say, one is wrong.
CONTRADICTION_SHARE, CONTRADICTION_PP = 0.2, 0.3
HARSH_SHARE = 0.7  # of the window that must be far from pulses
SILENT, SILENT_S = 1.07, 0.4  # all four residuals below so many times the noise, over at least so long: no track
# Half-width over the estimate from which on it says nothing; and the least way that a wheelset must have run to tell.
VAGUE, MIN_M = 0.6, 2.9
BEYOND_WIDER = 2.0  # the half-width grows by this factor for each range that an input lies outside the sets


class EstimateDoubt(IntEnum):
    """What of the estimate itself keeps it from being believed."""

    NONE = 0
    NO_RULE = 1  # too few rules fire
    BEYOND_TRAINING = 2  # residuals unlike any that the rules were made from
    HARSH = 3  # so many pulses that little of the window is left
    SILENT = 4  # the sensors give their noise alone
    VAGUE = 5  # the interval is too wide to say anything, or the window too short


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
    inputs: FloatArray  # (n, COLUMNS) what the rules were given
    fuzzy: FloatArray  # 0 … 100
    firing: FloatArray  # total weight of the rules; below 0.05 there is no answer
    rule: IntArray  # that weighs most, from 1; 0 none
    rule_share: FloatArray
    winner: IntArray  # model from 1 whose residual (as the rules see it) is lowest in its own range; 0 none
    mu_available_pct: FloatArray
    half_width_pp: FloatArray
    used_pct: FloatArray  # of the moment
    saturated: BoolArray
    contradicted: BoolArray  # more is in use than the rules, with their interval, say there is: one of them is wrong
    doubt: IntArray  # an EstimateDoubt: what speaks against the estimate itself
    window_s: FloatArray  # length of the window that the answer is from


@dataclass(frozen=True, slots=True)
class Answer:
    """What the rules say of one window of every axle (n,): adhesion, not below what is in use, and its half-width as a
    share of it; said_pct is without what is in use."""

    blocks: IntArray
    said_pct: FloatArray
    mu_pct: FloatArray
    spread: FloatArray
    inputs: FloatArray


class Estimator:
    """bank step -> residual RMS -> fuzzy -> adhesion. Never raises on data: what is unknown comes out as NaN.

    Every block of ticks the newest part of the window is compared with the rest; where the rail or the torque has
    changed, the rest is dropped, so that the estimate follows in a fraction of the window and says so by a wider
    interval. While nothing changes the window grows to twice its usual length.
    """

    STATE = (
        "_bank", "_offset", "_gate", "_window", "_speed", "_lowpass", "_joints", "_noise", "_speed_m_s", "_whole",
        "_delayed", "_delayed_live", "_delayed_clear", "started", "used", "outlier", "good", "upset", "outliers",
        "identity", "_saturated",
    )  # fmt: skip
    TRANSIENT = ("near_pulse", "live", "calm")

    def __init__(self, design: Design, axles: int) -> None:
        self.design = design
        self.axles = axles
        self._bank = Bank(design, axles)
        self._offset = Offset(OFFSET_WINDOWS * design.window_ticks, axles)
        self._gate = Gate(axles)
        self._speed = SpeedFilter(design.tick_s)
        self._joints = Joints(design.highpass, float(design.noise_rms[1]), axles)
        self._noise = NoiseLevel(design.noise_rms, axles)
        self._lowpass = Sections(design.lowpass, 2 * MODELS, axles)
        self._longest = -(-design.longest_ticks // BLOCK_TICKS)
        self._window = Window(self._longest, axles)
        self._fuzzy = Fuzzy(design)
        self.identity = Identity((float(design.noise_rms[0]), float(design.noise_rms[1])), design.tick_s, axles)
        self._speed_m_s = float(design.speeds_m_s[0])
        self._low = np.array([s.centres[0] for s in design.residual_sets])
        self._width = np.array([s.centres[-1] - s.centres[0] for s in design.residual_sets])
        # of the newest tick: which axles' measurements it made use of, and which it left out as absurd
        self.used: BoolArray = np.zeros(axles, dtype=bool)
        self.outlier: BoolArray = np.zeros(axles, dtype=bool)
        self._whole: BoolArray = np.zeros(axles, dtype=bool)  # whether the newest tick brought every measurement
        self.good: BoolArray = np.zeros(axles, dtype=bool)  # whether it can go into the window
        self.upset: BoolArray = np.zeros(axles, dtype=bool)
        self.near_pulse: BoolArray = np.zeros(axles, dtype=bool)
        self.calm: BoolArray = np.zeros(axles, dtype=bool)  # and that one is far from any pulse
        self.live: BoolArray = np.zeros(
            axles, dtype=bool
        )  # whether the window was given an innovation, HOLD_TICKS late
        self.outliers = 0  # samples left out so far
        # innovations wait HOLD_TICKS, oldest first, until it is known whether a pulse follows
        self._delayed: FloatArray = np.zeros((HOLD_TICKS, MODELS, 2, axles))
        self._delayed_live: BoolArray = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._delayed_clear: BoolArray = np.zeros((HOLD_TICKS, axles), dtype=bool)
        self._saturated: BoolArray = np.zeros(axles, dtype=bool)  # a while ago
        self.started: BoolArray = np.zeros(axles, dtype=bool)  # whether a measurement was used since the last reset
        self._usual = -(-design.window_ticks // BLOCK_TICKS)
        self._recent = max(2, round(design.recent_ticks / BLOCK_TICKS))
        self._now = max(1, round(NOW_S / design.tick_s / BLOCK_TICKS))
        self._judged_ticks = round(BLOCK_S / design.tick_s)
        self._step = max(1, round(STEP_S / design.tick_s / BLOCK_TICKS))
        self._part = max(1, round(PART_S / design.tick_s / BLOCK_TICKS))
        self._min_ticks = 0.5 * self._recent * BLOCK_TICKS

    def reset(self, axle: int) -> None:
        """Start an axle anew: after a gap, a step of time, or a standstill."""
        self._whole[axle] = self.started[axle] = self._saturated[axle] = False
        self._delayed[..., axle] = 0.0
        self._delayed_live[:, axle] = self._delayed_clear[:, axle] = False
        for part in (
            self._offset, self._gate, self._bank, self._joints, self._noise, self._lowpass, self._window, self.identity
        ):  # fmt: skip
            part.reset(axle)
        if not self.started.any():  # the speed is all axles': it goes on while one of them does
            self._speed.reset()

    def step(self, tick: Tick) -> FloatArray:
        """Run the bank for one tick and remember its residuals. Returns the innovations (4, 2, n).

        A tick without both channels, or with an absurd innovation in either, is predicted over. Where absurd ones go
        on, or a filter is not finite, the axle is upset: call reset() for it.
        """
        self._speed_m_s = speed = self._speed.step(tick.speed_m_s)
        # one channel alone is not enough: with its part of a gain made for two, a filter would be unstable
        whole = np.logical_and.reduce(tick.present)
        bank, offset = self._bank.x, self._offset.known
        small = np.logical_and.reduce(np.abs(self._offset.without(tick.z)) <= MAX_PULSE[:, None])
        pulse, near = self._joints.step(tick.z[1], whole & small)
        e, w = self._filter(tick, whole, near, speed)
        swings = self._joints.recovering & small
        absurd = self._gate.outliers(e, tick.z[0], whole & ~swings)
        self.outlier = np.logical_or.reduce(absurd)
        used = whole & ~self.outlier
        if self.outlier.any():
            self.outliers += int(absurd.sum())
            self._bank.x, self._offset.known = bank, offset
            e, w = self._filter(tick, used, near, speed)
        self.upset = self._gate.learn(e, tick.z[0], used & ~swings, absurd) | ~np.isfinite(self._bank.x).all(
            axis=(0, 1)
        )
        self._noise.step(tick.z, used & ~near)
        self.used = used
        self.identity.step(tick.z, used & ~near, speed, self._saturated)
        self.near_pulse = near
        self.started |= used
        # the first innovation after a gap is that of several ticks at once, larger than others: it stays out. So a
        # sensor that is slower than the ticks, for which no gain here is made, never gives an estimate
        self.good = used & self._whole & np.isfinite(tick.torque_ratio) & ~self.upset
        self._whole = used
        self._put(tick, w, pulse, near)
        if self.design.form == "wrcd" and (tick.number + 1) % BLOCK_TICKS == 0:
            self._drop_what_was_before_a_change()
        if (tick.number + 1) % self._judged_ticks == 0:
            self._saturated = Estimator.estimate(self).saturated
        return e

    def _filter(self, tick: Tick, axles: BoolArray, near: BoolArray, speed_m_s: float) -> tuple[FloatArray, FloatArray]:
        """The bank with the measurements of some axles (n,); those near a pulse teach no offset."""
        present = np.broadcast_to(axles, tick.present.shape)
        z = self._offset.take(tick.z, np.broadcast_to(axles & ~near, tick.present.shape))
        return self._bank.step(z, present, speed_m_s)

    def _put(self, tick: Tick, w: FloatArray, pulse: BoolArray, near: BoolArray) -> None:
        """Innovations enter the window HOLD_TICKS late, those about a pulse and those not used as zeros."""
        self._delayed_clear &= ~pulse
        raw, live = self._delayed[0], self._delayed_live[0] & self._delayed_clear[0]
        self._delayed = np.concatenate((self._delayed[1:], w[None]))
        self._delayed_live = np.concatenate((self._delayed_live[1:], self.good[None]))
        self._delayed_clear = np.concatenate((self._delayed_clear[1:], ~near[None]))
        raw = np.where(live, raw, 0.0)
        w = self._lowpass.step(raw.reshape(-1, self.axles)).reshape(raw.shape) if self.design.form == "wrcd" else raw
        self.live = live
        self.calm = live & ~self._joints.recovering
        self._window.put(tick.number, w, raw, self.started, live, self.calm, tick.torque_ratio)

    def steps(self) -> FloatArray:
        """Of the newest part of the window against the rest: decades between the residuals (n, 4), NaN where either
        holds too little."""
        return self._decades(self._window.plain(0, self._recent), self._window.plain(self._recent, self._usual))

    def _decades(self, new: FloatArray, rest: FloatArray) -> FloatArray:
        """(n, 4) between the residuals of plain sums; NaN where either holds too little."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return 0.5 * np.log10(raw_power(new, self._min_ticks) / raw_power(rest, self._min_ticks))

    def _past(self, used: FloatArray, now: FloatArray) -> Past:
        """Of windows (m,) of the axles, all of them with one length after all with another."""
        times = len(used) // self.axles
        window, half = self._window, self._usual // 2
        decades = self._decades(window.kept(0, self._recent), window.kept(self._recent, self._recent + half))
        lowest, highest = window.torque_range(half)
        return Past(
            used, np.tile(now, times), np.tile(lowest, times), np.tile(highest, times), np.tile(decades, (times, 1))
        )  # fmt: skip

    def _drop_what_was_before_a_change(self) -> None:
        """Compare the newest part of the window with the rest: residuals and torque."""
        decades, now = self.steps(), self.torque_now()
        just = mean_ratio(self._window.plain(self._now, self._now + self._step))
        rest = mean_ratio(self._window.plain(self._recent, self._usual))
        with np.errstate(invalid="ignore"):
            changed = np.any(np.abs(decades) > self.limits_of_change(self._speed_m_s), axis=1)
            torque = np.abs(now - just) > TORQUE_STEP * np.maximum(now, just) + TORQUE_STEP_RATIO
            torque |= np.abs(now - rest) > TORQUE_TURN * np.maximum(now, rest) + TORQUE_TURN_RATIO
            changed |= torque & np.isfinite(decades[:, 0])
        if changed.any():
            self._window.truncate(self._recent, changed)

    def limits_of_change(self, speed_m_s: float) -> FloatArray:
        """(4,) decades at a speed."""
        d = self.design
        return np.array([np.interp(speed_m_s, d.change_speeds_m_s, limits) for limits in d.changes.T])

    def estimate(self) -> Estimate:
        """The adhesion that the window's residuals and torque speak for."""
        d = self.design
        filled = self._window.filled()
        usual = np.minimum(filled, self._usual)
        now = self.torque_now()
        used = 100.0 * now
        if d.form == "paper":
            (best,), inference, chosen = self._answers([usual], now)
            spread, doubt = best.spread, np.zeros(self.axles, dtype=np.int64)
        else:
            lengths = [self._alike(now, usual, filled), usual, np.minimum(filled, self._recent)]
            (long, short, recent), inference, chosen = self._answers(lengths, now)
            back = _back(long, short)
            best = _between(back, long, short)
            rows = np.where(back > 0.5, 1, 0) * self.axles + np.arange(self.axles)
            inference, chosen = inference.take(rows), chosen.take(rows)
            spread = best.spread
            # the newest part may know of a drop that the window as a whole does not show yet: reach down to it
            reach = best.mu_pct - recent.mu_pct * (1.0 - NEWEST_SHARE * recent.spread)
            with np.errstate(invalid="ignore"):
                spread = np.where(reach > spread * best.mu_pct, reach / best.mu_pct, spread)
            spread, doubt = self._doubted(spread, best, inference, chosen)
        mu = best.mu_pct
        fits = (best.inputs[:, :MODELS] - self._low) / self._width
        nearest = np.argmin(np.where(np.isnan(fits), np.inf, fits), axis=1) + 1
        with np.errstate(invalid="ignore"):
            half_width = np.maximum(spread * mu, used - best.said_pct)
            margin = np.maximum(spread * best.said_pct, CONTRADICTION_SHARE * best.said_pct + CONTRADICTION_PP)
            saturated = used >= d.saturated_share * mu
            contradicted = used > best.said_pct + margin
        return Estimate(
            residuals=chosen.residuals,
            torque_ratio=chosen.ratio,
            inputs=best.inputs,
            fuzzy=inference.output,
            firing=inference.firing,
            rule=inference.rule,
            rule_share=inference.rule_share,
            winner=np.where(np.isnan(fits).any(axis=1), 0, nearest),
            mu_available_pct=mu,
            half_width_pp=half_width,
            used_pct=used,
            saturated=saturated,
            contradicted=contradicted,
            doubt=doubt,
            window_s=chosen.ticks * d.tick_s,
        )

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        return mean_ratio(self._window.plain(0, self._now))

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> tuple[FloatArray, Statistics]:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,), and the windows' statistics.

        m may be several times the axles: all of them with one length after all with another. now is (n,). In a window
        shorter than the usual one the torque has changed: that of the moment counts.
        """
        s = statistics(newest(self._window.cumulative(), blocks), self._min_ticks)
        times = len(blocks) // self.axles
        used = np.where(blocks < self._usual, np.tile(now, times), s.ratio) if self.design.form == "wrcd" else s.ratio
        speed = scheduled_speed(self._speed_m_s, self.design.speeds_m_s)
        noise = np.tile(self._noise.sensor_factor(), times)
        return rule_inputs(self.design, s, self._past(used, now), noise, speed), s

    def _answers(self, lengths: list[IntArray], now: FloatArray) -> tuple[list[Answer], Inference, Statistics]:
        """One for each of the windows' lengths (n,); inference and statistics of all, one after another."""
        d, n = self.design, self.axles
        inputs, s = self.inputs_of(np.concatenate(lengths), now)
        inference = self._fuzzy.infer(inputs)
        said = np.clip(np.polyval(d.polynomial, inference.output), *d.adhesion_range_pct)
        out = []
        for i, blocks in enumerate(lengths):
            rows = slice(i * n, (i + 1) * n)
            mine = said[rows]
            # what is in use is available: the estimate cannot lie below it
            mu = np.where(np.isnan(mine), np.nan, np.minimum(np.fmax(mine, 100.0 * now), 100.0))
            out.append(Answer(blocks, mine, mu, inference.spread[rows], inputs[rows]))
        return out, inference, s

    def _alike(self, now: FloatArray, usual: IntArray, filled: IntArray) -> IntArray:
        """(n,): blocks over which the torque has been as it is now; at least the usual window."""
        cumulative = self._window.cumulative()
        edges = np.arange(0, len(cumulative), self._part)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.diff(cumulative[edges, RATIO], axis=0) / np.diff(cumulative[edges, RATIO_N], axis=0)
            like = np.abs(ratio - now) <= LIKE_TORQUE * now + LIKE_TORQUE_RATIO
        parts = np.where(like.all(axis=0), len(like), np.argmin(like, axis=0))
        return np.asarray(np.clip(parts * self._part, usual, filled))

    def _doubted(
        self, spread: FloatArray, best: Answer, inference: Inference, s: Statistics
    ) -> tuple[FloatArray, IntArray]:
        """The spread, wider where few rules fire or the inputs are unusual; and what is too much of it, a Doubt."""
        d = self.design
        outside = np.maximum(d.low - best.inputs, best.inputs - d.high) / np.maximum(d.high - d.low, 1e-9)
        # coasting, a long window and quiet sensors are no news: only the residuals can be unlike any that were seen
        far = np.clip(outside[:, :MODELS].max(axis=1), 0.0, None)
        loud = excitation(d, s, self._noise.sensor_factor(), scheduled_speed(self._speed_m_s, d.speeds_m_s))
        with np.errstate(invalid="ignore"):
            few = np.clip(LOW_FIRING / np.maximum(inference.firing, 1e-9), 1.0, 3.0)
            spread = spread * few * (1.0 + BEYOND_WIDER * far)
            reasons = {
                EstimateDoubt.SILENT: (loud < SILENT) & (s.ticks * d.tick_s >= SILENT_S),
                EstimateDoubt.HARSH: s.live_share < HARSH_SHARE,
                EstimateDoubt.BEYOND_TRAINING: far > d.beyond,
                EstimateDoubt.NO_RULE: inference.rule == 0,
                EstimateDoubt.VAGUE: (spread > VAGUE) | (s.ticks * d.tick_s * self._speed_m_s < MIN_M),
            }
            doubt = np.select(list(reasons.values()), list(reasons), EstimateDoubt.NONE)
        return spread, doubt.astype(np.int64)


def _back(long: Answer, short: Answer) -> FloatArray:
    """(n,): how far the answer of the usual window counts, 0 … 1: by one half where it differs from the long one's by
    so many half-widths, down or up."""
    with np.errstate(invalid="ignore"):
        apart = np.log(short.mu_pct / long.mu_pct) / short.spread
        back = np.clip(0.5 * np.fmax(apart / FALL_BACK_ABOVE, -apart / FALL_BACK_BELOW), 0.0, 1.0)
    return np.where((long.blocks > short.blocks) & np.isfinite(back), back, 0.0)


def _between(share: FloatArray, first: Answer, second: Answer) -> Answer:
    """Of every axle the first (share 0), the second (1) or an answer between them; window and inputs are of the one
    that counts for more."""

    def take(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.where(share == 0.0, a, (1.0 - share) * a + share * b)

    most = share > 0.5
    return Answer(
        np.where(most, second.blocks, first.blocks),
        take(first.said_pct, second.said_pct),
        take(first.mu_pct, second.mu_pct),
        take(first.spread, second.spread),
        np.where(most[:, None], second.inputs, first.inputs),
    )
