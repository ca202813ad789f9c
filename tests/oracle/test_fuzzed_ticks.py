"""The estimator agrees with its oracle whatever happens to a train."""

from functools import cache

import numpy as np
import pytest

from tests.oracle.comparison import Comparison
from tests.support.fuzzed_ticks import Train, designs
from wrcd.core.estimator import Estimator
from wrcd.core.terms import MAX_AXLES

designs_once = cache(designs)


def compared(name: str, axles: int, seed: int, ticks: int, every: int) -> Comparison:
    """Over so many ticks of a train; every: ticks between two estimates."""
    estimator = Estimator(designs_once()[name], axles)
    both = Comparison(estimator)
    for k, step in enumerate(Train(axles, seed).steps(ticks)):
        result = estimator.step(step.tick)
        both.stepped(step.tick, result)
        resets = {*step.resets, *np.flatnonzero(result.needs_reset).tolist()}
        if k % every == 0:
            both.estimated(estimator.estimate())
        for axle in resets:
            estimator.reset(axle)
            both.reset(axle)
    print(f"{name}, {axles} axles: {both.worst:.1e} at most, {both.large} of {both.estimates} estimates rough")
    return both


@pytest.mark.parametrize(
    ("name", "axles"),
    [
        ("multiple-unit", 1), ("multiple-unit", 4), ("multiple-unit", 7), ("lone-wheelset", 2), ("lone-wheelset", 8),
        ("paper", 1), ("paper", 5), ("bare", 3),
    ],
)  # fmt: skip
def test_estimator_agrees_with_its_oracle_on_fuzzed_ticks(name: str, axles: int) -> None:
    both = compared(name, axles, 30 + axles, 1500, 17)
    assert both.oracle.outliers > 0
    assert name == "paper" or both.large < 0.7 * both.estimates


@pytest.mark.night
@pytest.mark.parametrize("axles", range(1, MAX_AXLES + 1))
@pytest.mark.parametrize("name", designs_once())
def test_estimator_agrees_with_its_oracle_on_a_million_fuzzed_ticks(name: str, axles: int) -> None:
    """A million in all of these."""
    compared(name, axles, 100 + axles, 31_250, 97)
