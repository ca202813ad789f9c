"""Figures with the interval that chance leaves them: whole runs are drawn again, not frames, which resemble each other.

Runs that play the same conditions in another world share a number, and are drawn together.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

REPLICATES = 500
ENDS = (0.05, 0.95)  # a 90 % interval
SEED = 9
BINS = 2000  # of equal content, in which replicates look for a quantile


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure, the ends of its 90 % interval (NaN with less than two runs), and how much it is made of."""

    value: float
    low: float
    high: float
    runs: int
    count: int  # frames, or drops, or axles

    def below(self, other: "Figure") -> bool:
        """Whether it lies below another one, and the intervals do not overlap."""
        return self.high < other.low


NOTHING = Figure(math.nan, math.nan, math.nan, 0, 0)


def exact(value: float, runs: int, count: int) -> Figure:
    """A figure that chance does not touch."""
    return Figure(value, value, value, runs, count)


class Draws:
    """How often each of n runs is drawn in every replicate."""

    def __init__(self, runs: IntArray) -> None:
        ids, self.place = np.unique(runs, return_inverse=True)
        self.n = len(ids)
        rng = np.random.default_rng(SEED)
        self.times = rng.multinomial(self.n, np.full(self.n, 1 / max(self.n, 1)), REPLICATES).astype(np.float64)

    def sums(self, values: FloatArray | BoolArray, place: IntArray | None = None) -> FloatArray:
        """Sum over each run (n,) of values per frame."""
        at = self.place if place is None else place
        return np.asarray(np.bincount(at, values.astype(np.float64), self.n), np.float64)

    def figure(self, value: float, replicates: FloatArray, count: int) -> Figure:
        """With the interval that the replicates (REPLICATES,) span."""
        known = replicates[np.isfinite(replicates)]
        if self.n < 2 or len(known) < REPLICATES / 2:
            return Figure(value, math.nan, math.nan, self.n, count)
        low, high = np.quantile(known, ENDS)
        return Figure(value, float(low), float(high), self.n, count)


def mean(values: FloatArray | BoolArray, runs: IntArray) -> Figure:
    """Mean of values per frame; runs (frames,) says which run each is of."""
    if not len(values):
        return NOTHING
    draws = Draws(runs)
    total, count = draws.sums(values), draws.sums(np.ones(len(values)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return draws.figure(float(np.mean(values)), (draws.times @ total) / (draws.times @ count), len(values))


def share(hits: BoolArray, runs: IntArray) -> Figure:
    """Share of runs' axles that something is true of. Where it is so of all or of none, no replicate differs: then
    the end of the interval is what as many independent runs would show so with a chance of 5 %."""
    found = mean(hits, runs)
    if found.runs < 2 or found.value not in (0.0, 1.0):
        return found
    least = ENDS[0] ** (1.0 / found.runs)
    low, high = (least, 1.0) if found.value else (0.0, 1.0 - least)
    return Figure(found.value, low, high, found.runs, found.count)


def ratio(above: FloatArray, runs_above: IntArray, below: FloatArray, runs_below: IntArray) -> Figure:
    """Mean of one over the mean of the other; runs that both have are drawn together."""
    return _compare(above, runs_above, below, runs_below, np.divide)


def difference(values: FloatArray, runs: IntArray, less: FloatArray, runs_less: IntArray) -> Figure:
    """Mean of one less the mean of the other; runs that both have are drawn together."""
    return _compare(values, runs, less, runs_less, np.subtract)


def _compare(
    a: FloatArray, runs_a: IntArray, b: FloatArray, runs_b: IntArray, how: np.ufunc
) -> Figure:  # fmt: skip
    if not len(a) or not len(b):
        return NOTHING
    draws = Draws(np.concatenate((runs_a, runs_b)))
    place_a, place_b = draws.place[: len(a)], draws.place[len(a) :]
    with np.errstate(invalid="ignore", divide="ignore"):
        parts = [
            (draws.times @ draws.sums(x, at)) / (draws.times @ draws.sums(np.ones(len(x)), at))
            for x, at in ((a, place_a), (b, place_b))
        ]
        return draws.figure(float(how(np.mean(a), np.mean(b))), how(*parts), len(a))


def quantile(values: FloatArray, runs: IntArray, q: float) -> Figure:
    """Quantile of values per frame (infinite ones allowed)."""
    if not len(values):
        return NOTHING
    draws = Draws(runs)
    value = float(np.quantile(values, q, method="inverted_cdf"))
    order = np.argsort(values, kind="stable")
    width = max(len(values) // BINS, 1)
    held = np.zeros((draws.n, -(-len(values) // width)))
    np.add.at(held, (draws.place[order], np.arange(len(values)) // width), 1.0)
    reached = np.cumsum(draws.times @ held, axis=1)
    at = np.argmax(reached >= q * reached[:, -1:], axis=1)
    last = np.minimum((at + 1) * width, len(values)) - 1
    return draws.figure(value, values[order][last], len(values))


def largest(values: FloatArray, runs: IntArray) -> Figure:
    """The largest of values per drop or axle: what the interval says is of as many runs again."""
    if not len(values):
        return NOTHING
    draws = Draws(runs)
    of_run = np.full(draws.n, -np.inf)
    np.maximum.at(of_run, draws.place, values)
    replicates = np.where(draws.times > 0, of_run, -np.inf).max(axis=1)
    return draws.figure(float(values.max()), replicates, len(values))
