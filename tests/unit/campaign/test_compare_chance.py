"""Whether a difference is more than chance: the tests are exact where all ways can be tried, and hold at few rows."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from sim_ecu.campaign.comparison.chance import ChanceOf, draws, holm, judged, of_pairs, of_samples

FloatArray = NDArray[np.float64]
ALPHA = 0.05
RUNS = 300
UNLIKELY = 1e-4  # that as many false claims are counted where alpha holds


def pairs(differences: FloatArray, clusters: list[int] | None = None) -> ChanceOf:
    d = np.asarray(differences, np.float64)[:, None]
    return of_pairs(np.zeros_like(d), d, clusters or list(range(len(d))), ALPHA)[0]


def samples(first: list[float], second: list[float]) -> ChanceOf:
    return of_samples(np.array(first)[:, None], np.array(second)[:, None], ALPHA)[0]


def test_p_of_pairs_is_the_share_of_all_flips_that_go_as_far() -> None:
    d = np.array([0.5, 2.0, -0.3, 1.1, 0.9])
    flips = [abs(sum(s * x for s, x in zip(signs, d, strict=True))) for signs in itertools.product((1, -1), repeat=5)]
    assert pairs(d).p == np.mean([f >= abs(d.sum()) - 1e-12 for f in flips])


def test_p_of_samples_is_the_share_of_all_exchanges_that_go_as_far() -> None:
    a, b = [0.1, 0.5, 0.3, 0.9], [0.8, 1.2, 0.7]
    every = a + b
    far = [
        abs(np.mean([every[k] for k in at]) - np.mean([x for k, x in enumerate(every) if k not in at]))
        for at in itertools.combinations(range(7), 3)
    ]
    assert samples(a, b).p == np.mean([f >= abs(np.mean(b) - np.mean(a)) - 1e-12 for f in far])


@pytest.mark.parametrize("seed", range(2))
def test_interval_holds_what_the_test_does_not_refuse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, d = rng.normal(size=6).tolist(), rng.normal(1.0, 1.0, size=6), rng.standard_t(2, 9)
    less: list[Callable[[float], ChanceOf]] = [lambda x: pairs(d - x), lambda x: samples(a, (b - x).tolist())]
    for by in less:
        found, step = by(0.0), 1e-6
        assert by(found.low + step).p > ALPHA >= by(found.low - step).p
        assert by(found.high - step).p > ALPHA >= by(found.high + step).p


def test_rows_of_one_world_count_once() -> None:
    d = np.array([0.5, 2.0, -0.3, 1.1, 0.9, 0.4, 0.2])
    thrice = pairs(np.repeat(d, 3), np.repeat(np.arange(7), 3).tolist())
    once = pairs(d)
    assert (thrice.p, thrice.least) == (once.p, once.least)
    assert (thrice.low, thrice.high) == pytest.approx((once.low, once.high))
    assert pairs(np.repeat(d, 3)).p < once.p / 4


def test_pairs_without_a_number_take_no_part() -> None:
    d = np.array([0.5, 2.0, -0.3, 1.1, 0.9, 0.4, 0.2])
    holes = pairs(np.concatenate((d, [math.nan, math.nan, math.inf])))
    whole = pairs(d)
    assert (holes.p, holes.least) == (whole.p, whole.least)
    assert (holes.difference, holes.low, holes.high) == pytest.approx((whole.difference, whole.low, whole.high))


def test_interval_needs_rows_enough() -> None:
    assert math.isnan(pairs(np.arange(1.0, 6.0)).low)  # of 32 ways to flip none lies beyond 2.5 %
    assert not math.isnan(pairs(np.arange(1.0, 7.0)).low)


@pytest.mark.parametrize("found", [pairs(np.zeros(20)), samples([3.0] * 9, [3.0] * 12)], ids=["pairs", "samples"])
def test_constants_are_no_claim_and_not_counted(found: ChanceOf) -> None:
    assert (found.difference, found.p, found.least) == (0.0, 1.0, 1.0)


def test_least_p_is_that_of_differences_that_all_point_one_way() -> None:
    assert pairs(np.arange(1.0, 9.0)).p == pairs(np.arange(1.0, 9.0)).least == 2.0**-7
    assert pairs(np.array([1.0] * 3 + [0.0] * 30)).least == 0.25  # most jobs give the same: three can say little


def test_holm_takes_the_strictest_bound_first() -> None:
    assert holm([0.04, 0.01, 0.03]) == pytest.approx([0.06, 0.03, 0.06])
    assert holm([]) == []
    assert draws(200, 0.05) == 80_000


def test_what_can_never_be_a_claim_is_not_counted() -> None:
    assert judged([0.001, 0.2, 0.03, 1.0], ALPHA) == [0]  # two would have to reach 0.025
    assert judged([0.001, 0.02, 0.02, 0.2], ALPHA) == [0]
    assert judged([2.0**-7] * 6, ALPHA) == list(range(6))
    assert judged([2.0**-7] * 7, ALPHA) == []  # eight pairs each, and no bound that strict


def tables(name: str, n: int, rng: np.random.Generator) -> FloatArray:
    """Eight figures of n rows."""
    shape = (n, 8)
    made: dict[str, Callable[[], FloatArray]] = {
        "heavy": lambda: rng.standard_cauchy(shape),
        "skewed": lambda: np.exp(1.5 * rng.normal(size=shape)),
        "zeros": lambda: np.where(rng.random(shape) < 0.6, 0.0, np.round(rng.exponential(size=shape), 1)),
    }
    return made[name]()


@pytest.mark.parametrize("name", ["heavy", "skewed", "zeros"])
@pytest.mark.parametrize(("paired", "n"), [(True, 10), (False, 4)])
def test_false_claims_of_many_comparisons_keep_to_alpha(paired: bool, n: int, name: str) -> None:
    """Two suites of eight figures that nothing but chance tells apart."""
    rng = np.random.default_rng([n, len(name), paired])
    family = uncorrected = 0
    for _ in range(RUNS):
        found: list[ChanceOf] = []
        for _ in range(2):
            world = tables(name, n, rng) if paired else 0.0
            a, b = (world + tables(name, n, rng) for _ in range(2))
            found += of_pairs(a, b, range(n), ALPHA, 499) if paired else of_samples(a, b, ALPHA, 499)
        p = [found[k].p for k in judged([f.least for f in found], ALPHA)]
        family += any(q <= ALPHA for q in holm(p))
        uncorrected += any(f.p <= ALPHA for f in found)
    bound = binom.isf(UNLIKELY, RUNS, ALPHA)
    assert family <= bound
    if n == 10:
        assert uncorrected > 2 * bound  # without the correction chance would be claimed often


def test_an_effect_of_one_spread_is_found_in_twenty_pairs_among_many_comparisons() -> None:
    rng = np.random.default_rng(6)
    d = rng.normal(size=(20, 40))
    d[:, :10] += 1.2
    p = holm([f.p for f in of_pairs(np.zeros_like(d), d, range(20), ALPHA, draws(40, ALPHA))])
    assert sum(q <= ALPHA for q in p[:10]) >= 7
    assert not any(q <= ALPHA for q in p[10:])
