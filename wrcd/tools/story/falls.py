"""Where MuAvailable fell or rose for good: between two levels that each last, and whose intervals do not overlap."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrcd.tools.story.events import VALID_PLACE
from wrcd.tools.story.records import Adhesion, Axle, Fall, Story

BLOCK_US = 200_000  # medians of so long: a single wrong frame is none
SETTLED_BLOCKS = 5  # a level that lasts: so many blocks on end (a second)
MAX_REFERENCE_BLOCKS = 50  # of the level before
MIN_PP, MIN_SHARE = 2.0, 0.2  # a change is at least this, and this share of the higher level
SETTLED_SHARE = 0.1  # of a change: what is nearer than this to a level belongs to it
UNBOUNDED_PP = 12.0  # half-width where Confidence states none: more than that

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Blocks:
    """Medians of the Valid frames by block; blocks without one are left out."""

    mu: FloatArray
    half: FloatArray
    first: NDArray[np.int64]  # row of the first Valid frame of each

    def differ(self, before: float, half_before: float, k: int) -> bool:
        """Whether the blocks from k on are all at another level."""
        after = self.mu[k : k + SETTLED_BLOCKS]
        if len(after) < SETTLED_BLOCKS:
            return False
        level, half = float(np.median(after)), float(np.median(self.half[k : k + SETTLED_BLOCKS]))
        least = max(MIN_PP, MIN_SHARE * max(before, level), half_before + half)
        return abs(level - before) > least and bool((np.abs(after - before) > 0.5 * least).all())


def found(story: Story) -> Story:
    """The same story with its falls, oldest first."""
    every = [fall for axle in story.axles for fall in of_axle(axle)]
    return replace(story, falls=tuple(sorted(every, key=lambda f: (f.begin_us, f.axle))))


def of_axle(axle: Axle) -> list[Fall]:
    """Falls and rises of one axle. Only Valid frames count; what lies between two levels may be anything."""
    a = axle.adhesion
    rows = np.flatnonzero((a.validity == VALID_PLACE) & np.isfinite(a.available_pct))
    if len(rows) < 2:
        return []
    time_us, mu = a.time_us[rows], a.available_pct[rows].astype(np.float64)
    blocks = _blocks(a, rows, time_us, mu)
    out: list[Fall] = []
    start = 0  # of the level
    k = SETTLED_BLOCKS
    while k + SETTLED_BLOCKS <= len(blocks.mu):
        low = max(start, k - MAX_REFERENCE_BLOCKS)
        before, half = float(np.median(blocks.mu[low:k])), float(np.median(blocks.half[low:k]))
        if not blocks.differ(before, half, k):
            k += 1
            continue
        settled = _settled(blocks.mu, k, before)
        near = max(start, k - 2 * SETTLED_BLOCKS)
        before = float(np.median(blocks.mu[near:k]))
        after = float(np.median(blocks.mu[settled : settled + 2 * SETTLED_BLOCKS]))
        begin, end = _edges(mu, int(blocks.first[near]), int(blocks.first[settled]), before, after)
        fall = Fall(axle.number, int(time_us[begin]), int(time_us[end]), before, after)
        if out and _goes_on(out[-1], fall):
            fall = replace(fall, begin_us=out[-1].begin_us, before_pct=out[-1].before_pct)
            out.pop()
        out.append(fall)
        start, k = settled, settled + SETTLED_BLOCKS
    return out


def _goes_on(earlier: Fall, later: Fall) -> bool:
    """Whether a change is the rest of the one before: the same way, and no level between them."""
    same_way = (earlier.after_pct < earlier.before_pct) == (later.after_pct < later.before_pct)
    return same_way and later.begin_us - earlier.end_us < SETTLED_BLOCKS * BLOCK_US


def _blocks(a: Adhesion, rows: NDArray[np.int64], time_us: NDArray[np.int64], mu: FloatArray) -> _Blocks:
    half = np.where(np.isfinite(a.high_pct[rows]), a.high_pct[rows] - a.available_pct[rows], UNBOUNDED_PP)
    number = (time_us - time_us[0]) // BLOCK_US
    first = np.concatenate(([0], np.flatnonzero(np.diff(number)) + 1))
    counts = np.diff(np.concatenate((first, [len(rows)])))
    middle = first + counts // 2
    by_mu, by_half = np.lexsort((mu, number)), np.lexsort((half, number))
    return _Blocks(mu[by_mu][middle], half[by_half][middle].astype(np.float64), first.astype(np.int64))


def _settled(mu: FloatArray, k: int, before: float) -> int:
    """From which block on the new level lasts; the last that may, where it never does."""
    last = len(mu) - SETTLED_BLOCKS
    for j in range(k, last):
        here, next_ = np.median(mu[j : j + SETTLED_BLOCKS]), np.median(mu[j + 1 : j + 1 + SETTLED_BLOCKS])
        later = np.median(mu[j + SETTLED_BLOCKS : j + 2 * SETTLED_BLOCKS])
        # near enough to be no fall of its own
        near = max(0.5, min(SETTLED_SHARE * abs(here - before), max(0.5 * MIN_PP, 0.5 * MIN_SHARE * here)))
        if abs(here - next_) <= near and abs(here - later) <= near and abs(mu[j] - here) <= 2 * near:
            return j
    return last


def _edges(mu: FloatArray, first: int, settled: int, before: float, after: float) -> tuple[int, int]:
    """The last frame at the old level, and the first at the new one."""
    near = max(SETTLED_SHARE * abs(after - before), 0.5)
    at_old = np.flatnonzero(np.abs(mu[first : settled + 1] - before) <= near)
    begin = first + int(at_old[-1]) if len(at_old) else first
    at_new = np.flatnonzero(np.abs(mu[begin + 1 :] - after) <= 2 * near)
    return begin, begin + 1 + int(at_new[0]) if len(at_new) else settled
