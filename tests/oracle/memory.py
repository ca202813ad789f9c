"""The memory's oracle. What the rail was a moment ago: the rules' words so far, and what was in use at the last peak.

While nothing changes, the rules' word on the newest second is fused with those before: a mean of log adhesion in which
each word weighs by its spread, forgotten within seconds. Where the window's own word lies far from the fused one, or
above it for long, or its newest part speaks of another rail, the memory begins anew. After a cut of the window less far
is enough.

What is in use is available. That bound is carried across cuts of the window and changes of torque: it erodes with time
and way. Where the wheelset is saturated on less, the rail has become worse, and the bound is what is in use.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tests.oracle.bank import SpeedTable
from tests.oracle.residuals import Lengths, Window, mean_ratio, raw_power
from wrcd.core.design import BoolArray, Design, FloatArray

# A torque of the moment that differs by this share and this ratio from what it was is a change, of the drive or of the
# rail: the window from before is dropped. The first is against the STEP_S before, the second against all of the rest: a
# driver's slow turning of the torque leaves the window longer than a slide does.
TORQUE_STEP, TORQUE_STEP_RATIO = 0.15, 0.004
TORQUE_TURN, TORQUE_TURN_RATIO = 0.15, 0.01
_TORQUE_SHARES, _TORQUE_RATIOS = (
    np.array([[TORQUE_STEP], [TORQUE_TURN]]),
    np.array([[TORQUE_STEP_RATIO], [TORQUE_TURN_RATIO]]),
)


class ChangeDetector:
    """Compares the newest part of a window with the rest: residuals and torque."""

    def __init__(self, design: Design) -> None:
        self._lengths = Lengths(design)
        self._limits = SpeedTable(design.changes, design.change_speeds_m_s)

    @property
    def recent_blocks(self) -> int:
        """The newest part's."""
        return self._lengths.recent

    def limits(self, speed_m_s: float) -> FloatArray:
        """(4,) decades at a speed."""
        return self._limits.at(speed_m_s)

    def steps(self, window: Window) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above the rest's, NaN where either holds too
        little."""
        k = self._lengths
        return decades(window.plain(0, k.recent), window.plain(k.recent, k.usual), k.min_ticks)

    def changed(self, window: Window, speed_m_s: float) -> BoolArray:
        """(n,): which axles' rail or torque has changed."""
        k = self._lengths
        recent, rest = window.plain(0, k.recent), window.plain(k.recent, k.usual)
        apart = decades(recent, rest, k.min_ticks)
        out: BoolArray = np.logical_or.reduce(np.abs(apart) > self.limits(speed_m_s), axis=1)
        now = mean_ratio(window.plain(0, k.now))
        before = np.array((mean_ratio(window.plain(k.now, k.now + k.step)), mean_ratio(rest)))
        torque = np.abs(now - before) > _TORQUE_SHARES * np.maximum(now, before) + _TORQUE_RATIOS
        torque &= np.isfinite(apart[:, 0])
        out |= torque[0]
        out |= torque[1]
        return out


def decades(new: FloatArray, rest: FloatArray, min_ticks: float) -> FloatArray:
    """(n, 4) between the residuals of plain sums; NaN where either holds too little. Within quiet()."""
    powers = raw_power(np.concatenate((new, rest), axis=1), min_ticks)
    n = len(powers) // 2
    out: FloatArray = 0.5 * np.log10(powers[:n] / powers[n:])
    return out


STEP_TICKS = 16  # from one word that is fused to the next, 80 ms
KEPT = 0.94  # of the words so far, at each: a memory of 1.3 s
# A word counts as so many independent ones: of 80 ms in a window of 1 s, and what is wrong in one is wrong in the next.
WEIGHT = 0.08 * 0.6
# The window's own word takes over where it is off by so many of its standard deviations, below or above; it begins to
# count at half of that. What is worse is believed sooner.
BELOW, ABOVE = 2.5, 3.0
SIGMAS = 1.645  # in the half-width of a 90 % interval
# The bound erodes after HOLD_S, within so many seconds and metres; saturated: this share of the newest part's word.
HOLD_S, ERODES_S, ERODES_M = 0.5, 6.0, 120.0
SATURATED = 0.87
# It is another rail where the newest part's word lies so many standard deviations, of both, below or above for so many
# steps.
WORSE, BETTER, ANOTHER_STEPS = 2.0, 2.5, 2
NEWEST = 1.8  # times as far as their spread says do the newest part's words scatter on a steady rail: it is short
# Where the window was cut, its word takes over at this share of BELOW and ABOVE, and where its deviation is so large.
CUT, VAGUE = 0.5, 0.3
# The rail has become better where the sum of what words lie beyond so many deviations above reaches so many seconds; a
# memory begins with so much of the word then.
BEYOND, REACHED_S, BEGINS_BETTER = 0.8, 0.6, 0.5
BEGINS = 0.2  # of a word's weight is what a memory begins with: the rail may still be changing
CLEAR = 0.8  # of the newest part that must hold data: lost measurements and pulses are no other rail
AGAIN = 0.98  # of what was in use at the peak: as much again


class Remembered(NamedTuple):
    """Of every axle (n,). precision: of the fused word, as 1 / variance of log adhesion, 0 where there is none, and
    weighed, its product with log adhesion; peak_pct: what was in use at the last peak, eroded, and since when (s);
    another: steps in a row in which the window's newest part speaks of another rail. since_m: the way since the fused
    word began; above_s: the sum of what words lay above it, beyond BEYOND.
    """

    precision: FloatArray
    weighed: FloatArray
    peak_pct: FloatArray
    peak_age_s: FloatArray
    another: FloatArray
    since_m: FloatArray
    above_s: FloatArray


@dataclass(frozen=True, slots=True)
class Word:
    """What rules say of a window of every axle (n,): log of the adhesion in percent and its standard deviation."""

    log_pct: FloatArray
    sigma: FloatArray


def spoken(memory: Remembered, word: Word, whole: BoolArray) -> tuple[Word, FloatArray]:
    """The fused word where there is one, on its way to the window's own (share 1, (n,)) where that lies far from it:
    less far is enough where the window was cut, and is not whole (n,). A cut may be a false alarm."""
    none = (memory.precision == 0.0) | ~np.isfinite(word.sigma)
    x = memory.weighed / memory.precision
    apart = (word.log_pct - x) / word.sigma
    far = np.where(apart < 0.0, -apart / BELOW, apart / ABOVE)
    far = np.where(whole, far, np.maximum(far / CUT, word.sigma / VAGUE))
    share = np.where(none, 1.0, np.minimum(np.maximum(2.0 * far - 1.0, 0.0), 1.0))
    sigma = np.minimum(1.0 / np.sqrt(memory.precision), word.sigma)
    mixed = (np.where(share < 1.0, (1.0 - share) * a + share * b, b) for a, b in
             ((x, word.log_pct), (sigma, word.sigma)))  # fmt: skip
    return Word(*mixed), share


def remember(
    memory: Remembered, word: Word, whole: BoolArray, recent: Word, live_share: FloatArray, in_use_pct: FloatArray,
    step_s: float, speed_m_s: float,
) -> Remembered:  # fmt: skip
    """After a step of so many seconds: the rules' word of the window, which is whole (n,) or cut; recent: that of its
    newest part, and what share of that holds data (n,); in_use_pct (n,): what has been in use all the time lately.
    Within quiet()."""
    usable = np.isfinite(word.sigma)
    new = 1.0 / (word.sigma * word.sigma)
    precision = KEPT * memory.precision + WEIGHT * new
    weighed = KEPT * memory.weighed + WEIGHT * new * word.log_pct
    _, share = spoken(memory._replace(precision=precision, weighed=weighed), word, whole)
    above = np.where(whole, (word.log_pct - memory.weighed / memory.precision) / word.sigma - BEYOND, -BEYOND)
    above_s = np.where((memory.precision > 0.0) & usable, np.fmax(memory.above_s + above * step_s, 0.0), 0.0)
    better = above_s > REACHED_S
    begins = better | (memory.precision == 0.0) | (share >= 1.0)
    begins_with = np.where(better, BEGINS_BETTER, BEGINS) * new
    precision = np.where(usable, np.where(begins, begins_with, precision), 0.0)
    weighed = np.where(usable, np.where(begins, begins_with * word.log_pct, weighed), 0.0)
    in_use = np.where(np.isfinite(in_use_pct), in_use_pct, 0.0)
    at_peak = (in_use >= AGAIN * memory.peak_pct) | (in_use >= SATURATED * np.exp(recent.log_pct))
    since_s = np.where(at_peak, 0.0, memory.peak_age_s + step_s)
    eroded = memory.peak_pct * np.where(
        since_s > HOLD_S, np.exp(-step_s * (1.0 / ERODES_S + speed_m_s / ERODES_M)), 1.0
    )
    scatter = NEWEST * recent.sigma
    apart = (recent.log_pct - weighed / precision) / np.sqrt(scatter * scatter + 1.0 / precision)
    off = whole & usable & (live_share >= CLEAR) & ((apart < -WORSE) | (apart > BETTER))
    another = np.where(off, memory.another + 1.0, 0.0)
    anew = another >= ANOTHER_STEPS
    precision, weighed = (np.where(anew, 0.0, a) for a in (precision, weighed))
    since_m = np.where(anew | begins | ~usable, 0.0, memory.since_m + step_s * speed_m_s)
    above_s = np.where(anew | begins, 0.0, above_s)
    return Remembered(precision, weighed, np.where(at_peak, in_use, eroded), since_s, another, since_m, above_s)
