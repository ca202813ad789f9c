"""Figures with the interval that chance leaves them: whole runs are drawn again, not frames, which resemble each other.

Runs that play the same conditions in another world share a number, and are drawn together.

The ends of what drawing again gives are too narrow for few runs: of the mean of 8 to 12 they hold 69 to 84 % where 90 %
are meant. So means, and ratios and differences of means, are
studentised: each drawing is measured in its own standard error, as the figure is in its, and no end is nearer than
Student's (B. Efron, R. Tibshirani, An Introduction to the Bootstrap, 1993, chapter 12). Of all drawings the ends are
further out by what Student's t and the lost degree of freedom require (T. Hesterberg, What Teachers Should Know About
the Bootstrap, Am. Stat. 69, 2015). The median of runs lies between two of them by the binomial distribution, whatever
theirs is.
"""

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import bdtr, ndtr, stdtrit  # scipy.stats takes half a second to load

from sim_ecu.reporting.values import Figure

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
# (…, columns) totals: the figure (…), and its slopes (…, columns)
Statistic: TypeAlias = Callable[[FloatArray], tuple[FloatArray, FloatArray]]

REPLICATES = 1000
ENDS = (0.05, 0.95)  # a 90 % interval
SEED = 9
BINS = 2000  # of equal content, in which replicates look for a quantile
FEWEST = 5  # fewer runs give no interval: the median's would not hold 90 %, and a spread of so few says little
FEWEST_DRAWN = 3  # of fewer different runs, which may be nearly alike, a standard error says nothing
NO_SPREAD = 1e-9  # of a standard error: what rounding leaves where all runs that were drawn are alike


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

    def columns(self, values: FloatArray | BoolArray, place: IntArray | None = None) -> FloatArray:
        """What each run adds to a mean of values per frame: their sum, and how many there are (n, 2)."""
        return np.stack((self.sums(values, place), self.sums(np.ones(len(values)), place)), axis=1)

    def sums(self, values: FloatArray | BoolArray, place: IntArray | None = None) -> FloatArray:
        """Sum over each run (n,) of values per frame."""
        at = self.place if place is None else place
        return np.asarray(np.bincount(at, values.astype(np.float64), self.n), np.float64)

    def figure(self, value: float, replicates: FloatArray, count: int) -> Figure:
        """With the interval that the replicates (REPLICATES,) span, its ends as far out as so many runs require."""
        known = replicates[np.isfinite(replicates)]
        if self.n < FEWEST or len(known) < REPLICATES / 2:
            return Figure(value, math.nan, math.nan, self.n, count)
        low, high = np.quantile(known, further_out(self.n))
        return Figure(value, float(low), float(high), self.n, count)

    def studentised(self, columns: FloatArray, statistic: Statistic, count: int) -> Figure:
        """A figure of the totals of columns (n, m): what each run adds. To first order a run moves the figure by its
        columns times the figure's slopes; from that, in each drawing, comes its standard error."""
        m = columns.shape[1]
        products = (columns[:, :, None] * columns[:, None, :]).reshape(self.n, m * m)
        times = np.vstack((np.ones(self.n), self.times))
        with np.errstate(invalid="ignore", divide="ignore"):
            values, slopes = statistic(times @ columns)
            squares = np.einsum("ri,rij,rj->r", slopes, (times @ products).reshape(-1, m, m), slopes)
            errors = np.sqrt(np.maximum(squares, 0.0) * self.n / max(self.n - 1, 1))
            away = (values[1:] - values[0]) / errors[1:]
        value, error = float(values[0]), float(errors[0])
        spread = (errors[1:] > NO_SPREAD * error) & (np.count_nonzero(self.times, axis=1) >= FEWEST_DRAWN)
        known = away[np.isfinite(away) & spread]
        if self.n < FEWEST or not math.isfinite(error):
            return Figure(value, math.nan, math.nan, self.n, count)
        if not error:
            return Figure(value, value, value, self.n, count)
        if len(known) < REPLICATES / 2:
            return Figure(value, math.nan, math.nan, self.n, count)
        least = float(stdtrit(self.n - 1, ENDS[1]))
        below, above = np.quantile(known, further_out(self.n))
        return Figure(
            value, value - error * max(least, float(above)), value - error * min(-least, float(below)), self.n, count
        )


def further_out(runs: int) -> tuple[float, float]:
    """Which quantiles of what drawing so many runs again gives are the ends of a 90 % interval."""
    end = float(ndtr(-math.sqrt(runs / (runs - 1)) * stdtrit(runs - 1, ENDS[1])))
    return end, 1.0 - end


def mean(values: FloatArray | BoolArray, runs: IntArray) -> Figure:
    """Mean of values per frame; runs (frames,) says which run each is of."""
    if not len(values):
        return NOTHING
    draws = Draws(runs)
    found = draws.studentised(draws.columns(values), _mean, len(values))
    return _within(found, 0.0 if (values >= 0).all() else -math.inf, 1.0 if values.dtype == bool else math.inf)


def _mean(totals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of sums and counts (…, 2)."""
    total, count = totals[..., 0], totals[..., 1]
    return total / count, np.stack((1.0 / count, -total / count**2), axis=-1)


def _within(f: Figure, least: float, most: float) -> Figure:
    """No end beyond what the figure can be."""
    return Figure(f.value, max(f.low, least), min(f.high, most), f.runs, f.count) if math.isfinite(f.low) else f


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
    found = _compare(above, runs_above, below, runs_below, _ratio)
    return _within(found, 0.0, math.inf) if (above >= 0).all() and (below >= 0).all() else found


def difference(values: FloatArray, runs: IntArray, less: FloatArray, runs_less: IntArray) -> Figure:
    """Mean of one less the mean of the other; runs that both have are drawn together."""
    return _compare(values, runs, less, runs_less, _difference)


def _compare(a: FloatArray, runs_a: IntArray, b: FloatArray, runs_b: IntArray, how: Statistic) -> Figure:
    if not len(a) or not len(b):
        return NOTHING
    draws = Draws(np.concatenate((runs_a, runs_b)))
    place_a, place_b = draws.place[: len(a)], draws.place[len(a) :]
    columns = np.concatenate((draws.columns(a, place_a), draws.columns(b, place_b)), axis=1)
    return draws.studentised(columns, how, len(a))


def _ratio(totals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of sums and counts of both (…, 4)."""
    (a, slopes_a), (b, slopes_b) = _mean(totals[..., :2]), _mean(totals[..., 2:])
    slopes = np.concatenate((slopes_a / b[..., None], -slopes_b * (a / b**2)[..., None]), axis=-1)
    return a / b, slopes


def _difference(totals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Of sums and counts of both (…, 4)."""
    (a, slopes_a), (b, slopes_b) = _mean(totals[..., :2]), _mean(totals[..., 2:])
    return a - b, np.concatenate((slopes_a, -slopes_b), axis=-1)


def median(values: FloatArray) -> Figure:
    """Of a value of each run; the mean of the two in the middle of an even number. Values may be infinite. The ends
    are values: beyond each the true median lies in 5 % of the cases at most, which takes five runs."""
    if not len(values):
        return NOTHING
    n = len(values)
    ordered = np.sort(values)
    # the most that may lie beyond an end, and one more
    beyond = int(np.searchsorted(bdtr(np.arange(n + 1), n, 0.5), ENDS[0]))
    low, high = (float(ordered[beyond - 1]), float(ordered[-beyond])) if beyond else (math.nan, math.nan)
    return Figure(float(np.median(values)), low, high, n, n)


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
    """The largest of values per drop or axle. It happened: it has no interval."""
    if not len(values):
        return NOTHING
    return Figure(float(values.max()), math.nan, math.nan, len(np.unique(runs)), len(values))
