"""Sums up what each gyro and accelerometer say, and doubts the pairs that a test of doubts.py speaks against."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray, IntArray
from wrcd.estimator.doubts import (
    BANDS_HZ,
    CROSS,
    FINE,
    LAT,
    LONE,
    LOW,
    LOW_MEAN,
    MEAN,
    MIDDLE,
    MIN_SILENT_BLOCKS,
    POWER,
    PRECEDENCE,
    RAW,
    ROWS,
    SATURATED,
    SILENT_EXCESS,
    SPEED,
    STILL_SILENT_EXCESS,
    YAW,
    Bounds,
    Doubt,
    DoubtFigures,
    Evidence,
    dead_alone,
    doubts,
    evidence,
    figures,
    in_curve,
    reversed_odds,
    silent,
)
from wrcd.estimator.recursion import exponential, smoothed, unrolled

SECONDS = 10  # that are judged
MIN_SECONDS = 9  # before which nothing is
MIN_SHARE = 0.5  # of a second's ticks that an axle must have data in
# By so much two pairs' correlations in 3 to 10 Hz must grow if their accelerometers changed places, both together. Of
# 5 700 sound pairs in fours (nominal, robust, rough, harsh, slow, coasting, in slip cycles, after drops; on tracks of
# their own and on a train's) none is above 0.3; of 120 swapped ones on one track 96 % are above 0.4, saturated or not.
CROSSED = 0.4


@dataclass(init=False, repr=False, eq=False)
class Wiring:
    """Correlations of every axle's yaw rate with every axle's lateral acceleration, second by second.

    A pair's own correlation alone tells less: a saturated wheelset swings by itself, and goes with no other's sensor
    either.
    """

    _cross: FloatArray  # of the second that is not full yet: gyro, accelerometer
    _power: FloatArray
    _used: FloatArray  # ticks with data
    _seconds: FloatArray  # the newest first
    _ticks: int = 0

    def __init__(self, tick_s: float, axles: int) -> None:
        self._second_ticks = round(1.0 / tick_s)
        self._cross = np.zeros((axles, axles))
        self._power = np.zeros((CHANNELS, axles))
        self._used = np.zeros(axles)
        self._seconds = np.full((SECONDS, axles, axles), np.nan)

    def reset(self, axle: int) -> None:
        """Nothing of an axle's second counts that a gap breaks."""
        self._cross[axle] = self._cross[:, axle] = self._power[:, axle] = 0.0
        self._used[axle] = -self._second_ticks
        if (self._used <= 0.0).all():
            self._used[:] = 0.0
            self._ticks = 0

    @property
    def left(self) -> int:
        """Ticks until a second is full."""
        return self._second_ticks - self._ticks

    def add(self, y: FloatArray, power: FloatArray, used: BoolArray | None) -> None:
        """m ticks of both signals in 3 to 10 Hz (m, 2, n) that no second ends within, and the sums of their squares
        (2, n); used (n,) where not all axles have data."""
        if used is not None and not used.any():
            return
        m = len(y)
        known = y if used is None else y * used
        self._cross = self._cross + known[:, YAW].T @ known[:, LAT]
        self._power = self._power + (power if used is None else power * used)
        self._used = self._used + (float(m) if used is None else float(m) * used)
        self._ticks += m
        if self._ticks >= self._second_ticks:
            self._close()

    def _close(self) -> None:
        """A second is full."""
        known = self._used >= MIN_SHARE * self._second_ticks
        with np.errstate(invalid="ignore", divide="ignore"):
            r = self._cross / np.sqrt(self._power[YAW][:, None] * self._power[LAT])
        r[~(known[:, None] & known)] = np.nan
        self._seconds = np.concatenate((r[None], self._seconds[:-1]))
        self._cross, self._power, self._used = (np.zeros_like(a) for a in (self._cross, self._power, self._used))
        self._ticks = 0

    def partners(self) -> IntArray:
        """(n,): the axle with which each would go together better if they changed accelerometers; -1 none."""
        known = np.isfinite(self._seconds)
        count = known.sum(axis=0)
        mean = np.where(known, self._seconds, 0.0).sum(axis=0) / np.maximum(count, 1)
        mean[count < MIN_SECONDS] = np.nan
        own = np.maximum(np.diagonal(mean), 0.0)  # in a bogie a sound pair near the peak may be against each other
        gain = mean + mean.T - own[:, None] - own
        gain[np.isnan(gain)] = 0.0
        best = gain.argmax(axis=1)
        return np.where(gain[np.arange(len(best)), best] > CROSSED, best, -1)


BLOCK_S = 0.25  # evidence is summed up over blocks of ticks with data
SECOND = 4  # blocks
BLOCKS = 10 * SECOND  # that a pair is judged by
MIN_BLOCKS = 9 * SECOND  # before which it is not
SILENT_BLOCKS = SECOND  # that silence is judged by; three where there are no more yet: a window that has just filled
# up must not be Valid on dead sensors
BEFORE_BLOCKS = SILENT_BLOCKS + 5 * SECOND  # in which a sensor may have been loud before it fell silent
ALONE_BLOCKS = 2 * SECOND  # for which a sensor stays dead that fell silent beside a live one
OFFSET_S = 2.0  # memory of the running mean that is taken off
FOURTH_DIFFERENCE = (1.0, -4.0, 6.0, -4.0, 1.0)
MAX_NOISE_RATIO = 1e6  # times the noise: what is further off does not count for more


@dataclass(init=False, repr=False, eq=False)
class Filters:
    """First-order Butterworth filters at BANDS_HZ (bilinear) and the fourth difference, one matrix product a tick.

    White noise of power one leaves power one in each output.
    """

    _state: FloatArray
    OUTPUTS = len(BANDS_HZ) + 1

    def __init__(self, tick_s: float, axles: int) -> None:
        bands = len(BANDS_HZ)
        delays = len(FOURTH_DIFFERENCE) - 1
        first, second, delayed = (1 + np.arange(k) for k in (bands, bands, delays))
        second, delayed = second + bands, delayed + 2 * bands
        # rows: outputs, then what the states become; columns: the input, then the states
        M = np.zeros((self.OUTPUTS + 2 * bands + delays, 1 + 2 * bands + delays))
        to = self.OUTPUTS - 1  # from a state's column to its row
        for k, (low, high) in enumerate(BANDS_HZ):
            b, a = _low_pass(high, tick_s) if low == 0.0 else _band_pass(low, high, tick_s)
            # transposed direct form II: y = b0 x + s1; s1' = b1 x - a1 y + s2; s2' = b2 x - a2 y
            M[k, [0, first[k]]] = b[0], 1.0
            M[to + first[k], [0, first[k], second[k]]] = b[1] - a[1] * b[0], -a[1], 1.0
            M[to + second[k], [0, first[k]]] = b[2] - a[2] * b[0], -a[2]
            M[k] /= math.sqrt(b[0])  # of white noise's power such a filter leaves b0
        difference = np.array(FOURTH_DIFFERENCE)
        M[bands, [0, *delayed]] = difference / np.linalg.norm(difference)
        M[to + delayed, [0, *delayed[:-1]]] = 1.0
        self._steps = unrolled(M, self.OUTPUTS)
        self._state = np.zeros((M.shape[1] - 1, CHANNELS * axles))

    def reset(self, axle: int) -> None:
        """Forget an axle's past."""
        n = self._state.shape[1] // CHANNELS
        self._state[:, axle::n] = 0.0

    def step(self, x: FloatArray, used: BoolArray | None = None) -> FloatArray:
        """m ticks of x (m, 2, n); used (n,) where not all axles have data. Returns (m, OUTPUTS, 2, n)."""
        m = len(x)
        out = self._steps[m] @ np.concatenate((x.reshape(m, -1), self._state))
        state = out[m * self.OUTPUTS :]
        self._state = state if used is None else np.where(np.tile(used, CHANNELS), state, self._state)
        y: FloatArray = out[: m * self.OUTPUTS].reshape(m, self.OUTPUTS, *x.shape[1:])
        return y


def _low_pass(corner_hz: float, tick_s: float) -> tuple[FloatArray, FloatArray]:
    w = math.tan(math.pi * corner_hz * tick_s)
    return np.array([w, w, 0.0]) / (1.0 + w), np.array([1.0, (w - 1.0) / (w + 1.0), 0.0])


def _band_pass(low_hz: float, high_hz: float, tick_s: float) -> tuple[FloatArray, FloatArray]:
    low, high = (math.tan(math.pi * f * tick_s) for f in (low_hz, high_hz))
    width, square = high - low, low * high
    whole = 1.0 + width + square
    return np.array([width, 0.0, -width]) / whole, np.array([whole, 2.0 * (square - 1.0), 1.0 - width + square]) / whole


@dataclass(init=False, repr=False, eq=False)
class Identity:
    """Sums up what each pair of sensors says, and doubts it where a test speaks against it.

    A doubt stays until its test has been quiet for as long as it takes to find it, whatever breaks in between: what is
    known of the wires holds across gaps and standstills.
    """

    _filters: Filters
    _mean: FloatArray
    _offset_ticks: FloatArray  # that the mean is of
    _sums: FloatArray  # of the block that is not full yet
    _ticks: FloatArray
    _blocks: FloatArray  # the newest first
    _filled: IntArray  # blocks so far
    _held: IntArray  # blocks for which a doubt stays
    _wiring: Wiring
    _figures: FloatArray  # that each was found by

    def __init__(self, noise_rms: tuple[float, float], tick_s: float, axles: int, bounds: Bounds = LONE) -> None:
        self._bounds = bounds
        self._unit: FloatArray = np.array(noise_rms)[:, None]
        self._scale = (*noise_rms, tick_s)  # what the pairs' sums are in
        self._block_ticks = max(2, round(BLOCK_S / tick_s))
        self._max_offset_ticks = OFFSET_S / tick_s
        self._filters = Filters(tick_s, axles)
        self._mean = np.zeros((CHANNELS, axles))
        self._offset_ticks = np.zeros(axles)
        self._sums = np.zeros((ROWS, axles))
        self._ticks = np.zeros(axles)
        self._blocks = np.zeros((BLOCKS, ROWS, axles))
        self._filled = np.zeros(axles, dtype=np.int64)
        self._wiring = Wiring(tick_s, axles)
        self._held = np.zeros((len(Doubt), axles), dtype=np.int64)
        self._figures = np.zeros((len(Doubt), len(DoubtFigures._fields), axles))
        self._smoothing = exponential(1.0 / self._max_offset_ticks)

    @property
    def doubt(self) -> IntArray:
        """What speaks against each pair (n,): a Doubt."""
        if not self._held.any():
            return np.full(self._held.shape[1], Doubt.NONE, dtype=np.int64)
        held = self._held[list(PRECEDENCE)] > 0
        out: IntArray = np.where(held.any(axis=0), np.array(PRECEDENCE)[held.argmax(axis=0)], Doubt.NONE)
        return out

    def reset(self, axle: int) -> None:
        """Start an axle's filters and its block anew, after a gap; what was found out before stays."""
        self._filters.reset(axle)
        self._mean[:, axle] = self._offset_ticks[axle] = 0.0
        self._sums[:, axle] = 0.0
        self._ticks[axle] = 0.0
        self._wiring.reset(axle)

    def step(self, z: FloatArray, used: BoolArray, speed_m_s: float, saturated: BoolArray) -> None:
        """One tick of raw measurements z (2, n), of the axles (n,) whose measurements are used; which are saturated."""
        x = np.where(used, np.clip(z / self._unit, -MAX_NOISE_RATIO, MAX_NOISE_RATIO), 0.0)
        self._offset_ticks = np.minimum(self._offset_ticks + used, self._max_offset_ticks)
        self._mean = self._mean + np.where(used, (x - self._mean) / np.maximum(self._offset_ticks, 1.0), 0.0)
        mask = None if used.all() else used
        x = x - self._mean
        self._add(x[None], self._filters.step(x[None], mask), mask, (speed_m_s,), saturated)

    @property
    def settled(self) -> BoolArray:
        """(n,): which axles' mean is of the last seconds only."""
        return np.asarray(self._offset_ticks >= self._max_offset_ticks)

    def step_settled(
        self, z: FloatArray, used: BoolArray | None, speeds_m_s: Sequence[float], saturated: BoolArray
    ) -> None:
        """m ticks z (m, 2, n) of axles that are settled; used (n,) where not all of them have data."""
        m = len(z)
        x = np.minimum(np.maximum(z / self._unit, -MAX_NOISE_RATIO), MAX_NOISE_RATIO)
        mean = smoothed(self._smoothing, self._mean, x)
        self._mean = mean[-1].copy()
        x -= mean[1:]
        y = self._filters.step(x)
        first = 0
        while first < m:  # no block and no second of the wiring ends within what is summed up at once
            left = int(min(self._block_ticks - self._ticks.max(), self._wiring.left))
            end = min(m, first + left)
            self._add(x[first:end], y[first:end], used, speeds_m_s[first:end], saturated)
            first = end

    def _add(
        self, x: FloatArray, y: FloatArray, used: BoolArray | None, speeds_m_s: Sequence[float], saturated: BoolArray
    ) -> None:
        """Sum up m ticks."""
        m, n = len(x), x.shape[2]
        square = y * y
        new = np.empty((ROWS, n))
        powers = np.add.reduce(square, axis=0)
        bands = len(BANDS_HZ)
        new[POWER] = powers[:bands].reshape(-1, n)
        new[CROSS] = np.add.reduce(y[:, :bands, YAW] * y[:, :bands, LAT], axis=0)
        new[FINE] = powers[bands]
        new[LOW_MEAN] = np.add.reduce(y[:, LOW], axis=0)
        new[MEAN] = np.add.reduce(x, axis=0)
        new[RAW] = np.add.reduce(x * x, axis=0)
        new[SPEED] = sum(speeds_m_s)
        np.multiply(saturated, float(m), out=new[SATURATED])
        if used is None:
            self._sums = self._sums + new
            self._ticks = self._ticks + float(m)
        else:
            self._sums = self._sums + np.where(used, new, 0.0)
            self._ticks = self._ticks + float(m) * used
        self._wiring.add(y[:, MIDDLE], powers[MIDDLE], used)
        full = self._ticks >= self._block_ticks
        if full.any():
            self._put(full)
            self._judge(full)

    def _put(self, full: BoolArray) -> None:
        """A block of some axles (n,) is full."""
        self._blocks[1:, :, full] = self._blocks[:-1, :, full]
        self._blocks[0][:, full] = self._sums[:, full] / self._block_ticks
        self._filled = self._filled + full
        self._sums = np.where(full, 0.0, self._sums)
        self._ticks = np.where(full, 0.0, self._ticks)

    def _judge(self, full: BoolArray) -> None:
        """A doubt is held from when its test speaks until the test has been quiet for as long as it looks back."""
        self._held = np.maximum(self._held - full, 0)
        for axle in np.flatnonzero(full & (self._filled >= MIN_SILENT_BLOCKS)).tolist():
            filled = int(self._filled[axle])
            known = filled > SILENT_BLOCKS and not self._held[Doubt.SILENT, axle]
            # of the first second, in which a train sets off and filters settle, nothing is concluded
            before = self._blocks[SILENT_BLOCKS : min(filled - SECOND, BEFORE_BLOCKS), :, axle]
            newest = self._blocks[: min(filled, SILENT_BLOCKS), :, axle]
            if silent(newest, before, SILENT_EXCESS if known else STILL_SILENT_EXCESS):
                self._hold(Doubt.SILENT, axle, SILENT_BLOCKS, evidence(newest.mean(axis=0)[None]))
            if filled >= 2 * SECOND:
                second = evidence(newest.mean(axis=0)[None])
                dead = dead_alone(second, float(self._unit[YAW, 0]), float(self._unit[LAT, 0]), self._bounds)
                if dead:
                    self._hold(dead, axle, ALONE_BLOCKS, second)
            if filled < MIN_BLOCKS and filled % SECOND == 0:
                early = self._seconds(filled, axle)
                if reversed_odds(early, in_curve(early, *self._scale)) > self._bounds.reversed:
                    self._hold(Doubt.REVERSED, axle, 2 * SECOND, early)  # until it is looked at again
            # once a second, each axle at another tick
            if filled >= MIN_BLOCKS and (filled - axle) % SECOND == 0:
                seconds = self._seconds(min(filled, BLOCKS), axle)
                found = doubts(seconds, *self._scale, self._bounds)
                partner = int(self._wiring.partners()[axle])
                if partner >= 0:
                    found.add(Doubt.UNRELATED)
                for doubt in found:
                    self._hold(doubt, axle, BLOCKS, seconds, partner if doubt is Doubt.UNRELATED else -1)

    def _seconds(self, blocks: int, axle: int) -> Evidence:
        """Of an axle's newest blocks, as whole seconds."""
        whole = blocks // SECOND
        return evidence(self._blocks[: whole * SECOND, :, axle].reshape(whole, SECOND, ROWS).mean(axis=1))

    def _hold(self, doubt: Doubt, axle: int, blocks: int, e: Evidence, partner: int = -1) -> None:
        """Doubt a pair for so many blocks at least, and keep what it was found by."""
        if not self._held[doubt, axle]:
            self._figures[doubt, :, axle] = figures(e, self._unit[0, 0], self._unit[1, 0], partner)
        self._held[doubt, axle] = max(self._held[doubt, axle], blocks)

    def figures(self, doubt: Doubt, axle: int) -> DoubtFigures:
        """What a doubt of a pair was found by."""
        return DoubtFigures(*self._figures[doubt, :, axle].tolist())
