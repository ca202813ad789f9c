"""Whether a difference is more than chance: permutation tests, the intervals that they leave, Holm's correction. Pure.

Where both campaigns ran in the same worlds, the difference of a pair has no sign of its own if nothing differs: the
signs of whole clusters (a seed's pairs) are flipped at random. Where they ran in worlds of their own, the labels of
the worlds are exchanged. Both hold at any number of rows, for heavy tails, ties and zeros, where nothing differs: where
only the means agree, differences must be symmetric, too, and two samples of one spread. A bootstrap's interval is too
narrow for few rows; these hold the differences that the same test does not refuse: random subsets' means
(J. Hartigan, Using subsample values as typical values, J. Am. Stat. Assoc. 64, 1969), and for two samples the shifts.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SEED = 9
EXACT = 1 << 14  # so many ways to flip or to exchange are all tried; of more, some are drawn
MIN_DRAWS = 9_999
MAX_DRAWS = 1_000_000
KEPT_DRAWS = 20_000  # at once, and that an interval is made of
ENOUGH = 200  # draws that go as far as what was seen: p follows from so many
DRAWS_A_CLAIM = 20  # how many draws lie beyond the bound of the claim that is hardest to make
CHUNK = 4_000_000  # numbers held at once
ROUNDING = 1e-9  # what two sums of the same numbers may differ by, as a share


@dataclass(frozen=True, slots=True)
class ChanceOf:
    """The second's mean less the first's with its interval (NaN: too few), both means, and p, two-sided.

    least: the smallest p that these rows could give, whichever way each points; 1 where none differs. worlds: those
    that count: of pairs those that differ, of samples the fewer of both sides.
    """

    first: float
    second: float
    difference: float
    low: float
    high: float
    p: float
    least: float
    worlds: int


NOTHING = ChanceOf(math.nan, math.nan, math.nan, math.nan, math.nan, 1.0, 1.0, 0)


def draws(comparisons: int, alpha: float) -> int:
    """Return how many draws decide p at the strictest bound of Holm's correction of so many comparisons; MAX_DRAWS may
    be too few where comparisons / alpha is more."""
    return min(max(MIN_DRAWS, math.ceil(DRAWS_A_CLAIM * comparisons / alpha)), MAX_DRAWS)


def of_pairs(
    first: FloatArray, second: FloatArray, clusters: Sequence[int], alpha: float, drawn: int = MIN_DRAWS
) -> list[ChanceOf]:
    """Every figure of pairs: first, second (pairs, figures), NaN where there is none. clusters: which pairs flip
    together."""
    both = np.isfinite(first) & np.isfinite(second)
    differences = np.where(both, np.where(both, second, 0.0) - np.where(both, first, 0.0), 0.0)
    _, place = np.unique(np.asarray(clusters), return_inverse=True)
    count = int(place.max()) + 1
    sums, weights = (np.zeros((count, both.shape[1])) for _ in range(2))
    np.add.at(sums, place, differences)
    np.add.at(weights, place, both.astype(np.float64))
    whole, rounding = sums.sum(axis=0), ROUNDING * np.abs(sums).sum(axis=0)

    def flip(subsets: FloatArray, of: BoolArray) -> _Tried:
        flipped = subsets @ sums[:, of]
        beyond = np.abs(whole[of] - 2.0 * flipped) >= np.abs(whole[of]) - rounding[of]
        return beyond, flipped, subsets @ weights[:, of]

    exact = 2**count <= EXACT
    p, flipped, weight = _try(_subsets(count) if exact else _random_subsets(count, drawn), flip, both.shape[1], exact)
    few = 0.0 if exact else 1.0 / (drawn + 1)
    return [
        _pair_figure(first[at, f], second[at, f], sums[:, f], flipped[:, f], weight[:, f], float(p[f]), few, alpha)
        for f, at in enumerate(both.T)
    ]


def of_samples(
    first: FloatArray, second: FloatArray, alpha: float, drawn: int = MIN_DRAWS
) -> list[ChanceOf]:  # fmt: skip
    """Every figure of two samples that share nothing: first (units, figures), second (units, figures), NaN where there
    is none."""
    n, m = len(first), len(second)
    if not n or not m:
        return [NOTHING] * first.shape[1]
    both = np.concatenate((first, second))
    known, own = np.isfinite(both), np.arange(n + m) >= n
    values = np.where(known, both, 0.0)
    values = np.where(known, values - values.sum(axis=0) / np.maximum(known.sum(axis=0), 1), 0.0)
    numbers = [(first[known[:n, f], f], second[known[n:, f], f]) for f in range(both.shape[1])]
    least_far = np.array([_least_far(a, b) for a, b in numbers])

    def exchange(labels: BoolArray, of: BoolArray) -> _Tried:
        others, moved = _exchanged(labels.astype(np.float64), values[:, of], known[:, of].astype(np.float64), own)
        return ~(np.abs(others) < least_far[of]), others, moved

    exact = math.comb(n + m, m) <= EXACT
    ways = _exchanges(n + m, m) if exact else _random_exchanges(n + m, m, drawn)
    p, others, moved = _try(ways, exchange, both.shape[1], exact)
    few = 0.0 if exact else 1.0 / (drawn + 1)
    return [
        _sample_figure(a, b, others[:, f], moved[:, f], float(p[f]), few, alpha) for f, (a, b) in enumerate(numbers)
    ]


def judged(least: Sequence[float], alpha: float) -> list[int]:
    """Places of the comparisons that could be a claim among so many; the others never could, and are not counted
    (R. Tarone, A modified Bonferroni method for discrete data, Biometrics 46, 1990)."""
    for count in itertools.count(1):
        found = [k for k, p in enumerate(least) if p <= alpha / count]
        if len(found) <= count:
            return found
    raise AssertionError


def holm(p: Sequence[float]) -> list[float]:
    """p corrected for how many there are: a claim at alpha among them is false in alpha of the cases at most (S. Holm,
    A simple sequentially rejective multiple test procedure, Scand. J. Stat. 6, 1979)."""
    out, so_far = [1.0] * len(p), 0.0
    for rank, at in enumerate(np.argsort(np.asarray(p), kind="stable").tolist()):
        so_far = max(so_far, min((len(p) - rank) * p[at], 1.0))
        out[at] = so_far
    return out


_Tried: TypeAlias = tuple[BoolArray, FloatArray, FloatArray]  # (ways, figures): goes as far; of these its interval is


def _try(
    ways: Iterator[Any], way: Callable[[Any, BoolArray], _Tried], figures: int, exact: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """p of each figure, and what its interval is made of. Draws end for a figure when enough of them go as far: p is
    their share until then (J. Besag, P. Clifford, Sequential Monte Carlo p-values, Biometrika 78, 1991)."""
    far, tries = np.zeros(figures, np.int64), np.zeros(figures, np.int64)
    kept: list[list[FloatArray]] = []
    enough = np.iinfo(np.int64).max if exact else ENOUGH
    for some in ways:
        keeps, open_ = sum(len(first) for first, _ in kept) < KEPT_DRAWS, far < enough
        of = open_ | keeps
        if not of.any():
            break
        beyond, *typical = way(some, of)
        if keeps:
            kept.append(typical)
        for column, f in zip(beyond.T, np.flatnonzero(of).tolist(), strict=True):
            if open_[f]:
                at = np.flatnonzero(column)[: enough - far[f]]
                far[f] += len(at)
                tries[f] += len(column) if far[f] < enough else at[-1] + 1
    more = 0 if exact else (far < enough).astype(np.int64)
    first, second = (np.concatenate([k[n] for k in kept]) for n in range(2))
    return np.minimum((far + more) / (tries + more), 1.0), first, second


def _pair_figure(
    first: FloatArray, second: FloatArray, sums: FloatArray, flipped: FloatArray, weight: FloatArray, p: float,
    few: float, alpha: float,
) -> ChanceOf:  # fmt: skip
    """Flipping the signs of a subset takes twice its sum off the whole; the whole less δ a pair is not beyond what
    that gives while the subset's mean lies on δ's other side. few: the least p that the draws have, 0 of all ways."""
    if not len(first):
        return NOTHING
    worlds = int((sums != 0.0).sum())
    least = max(2.0 ** (1 - worlds), few)
    some = weight > 0
    low, high = _ends(flipped[some] / weight[some], len(flipped) + (few > 0), alpha)
    difference = float(sums.sum()) / len(first)
    return ChanceOf(float(first.mean()), float(second.mean()), difference, low, high, p, min(least, 1.0), worlds)


def _spread(a: FloatArray, b: FloatArray) -> float:
    return float(max(a.max(), b.max()) - min(a.min(), b.min()))


def _least_far(a: FloatArray, b: FloatArray) -> float:
    """From which difference on an exchange of two samples' labels goes as far as what was seen."""
    return abs(float(b.mean() - a.mean())) - ROUNDING * _spread(a, b) if len(a) and len(b) else 0.0


def _exchanged(
    labels: FloatArray, values: FloatArray, known: FloatArray, own: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """The differences (draws, figures) of means with these labels (draws, units), 1 for the second's; and how far they
    move with the second's own values, as a share. NaN where a side has none."""
    ones = [known, known * own[:, None], values]
    with np.errstate(invalid="ignore", divide="ignore"):
        count, moving, total = (labels @ x for x in ones)
        rest, staying, left = (x.sum(axis=0) - y for x, y in zip(ones, (count, moving, total), strict=True))
        return total / count - left / rest, moving / count - staying / rest


def _sample_figure(
    a: FloatArray, b: FloatArray, others: FloatArray, moved: FloatArray, p: float, few: float, alpha: float
) -> ChanceOf:
    """Return the chance of one figure. A draw is beyond the observed difference, both less a shift δ, from one δ on."""
    if not len(a) or not len(b):
        return NOTHING
    observed = float(b.mean() - a.mean())
    size = float(max(np.abs(a).max(), np.abs(b).max()))
    fewest = (1.0 + (len(a) == len(b))) / math.comb(len(a) + len(b), len(b))
    least = 1.0 if _spread(a, b) <= ROUNDING * size else max(fewest, few)
    with np.errstate(invalid="ignore", divide="ignore"):
        shifts = (observed - others) / (1.0 - moved)
    low, high = _ends(shifts[np.isfinite(shifts) & (moved < 1.0 - ROUNDING)], len(others) + (few > 0), alpha)
    worlds = min(len(a), len(b))
    return ChanceOf(float(a.mean()), float(b.mean()), observed, low, high, p, min(least, 1.0), worlds)


def _ends(typical: FloatArray, tries: int, alpha: float) -> tuple[float, float]:
    """Return the interval's ends: beyond each lie at most alpha / 2 of the tries, also those with no typical value."""
    beyond = math.floor(alpha / 2 * tries * (1 + ROUNDING)) - (tries - len(typical)) + 1
    if beyond < 1:
        return math.nan, math.nan
    ordered = np.sort(typical)
    return float(ordered[beyond - 1]), float(ordered[-beyond])


def _subsets(count: int) -> Iterator[FloatArray]:
    """All: (2**count, count), 1 for what is in it."""
    yield ((np.arange(2**count)[:, None] >> np.arange(count)) & 1).astype(np.float64)


def _random_subsets(count: int, drawn: int) -> Iterator[FloatArray]:
    rng = np.random.default_rng(SEED)
    for part in _parts(drawn, count):
        yield rng.integers(0, 2, (part, count)).astype(np.float64)


def _exchanges(count: int, second: int) -> Iterator[BoolArray]:
    """All: (ways, count), True for what is taken for the second's."""
    places = np.array(list(itertools.combinations(range(count), second)))
    out = np.zeros((len(places), count), np.bool_)
    np.put_along_axis(out, places, True, axis=1)
    yield out


def _random_exchanges(count: int, second: int, drawn: int) -> Iterator[BoolArray]:
    rng = np.random.default_rng(SEED)
    for part in _parts(drawn, count):
        yield rng.permuted(np.tile(np.arange(count) < second, (part, 1)), axis=1)


def _parts(drawn: int, count: int) -> Iterator[int]:
    size = min(max(CHUNK // count, 1), KEPT_DRAWS)
    for done in range(0, drawn, size):
        yield min(size, drawn - done)
