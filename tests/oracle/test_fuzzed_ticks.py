"""The estimator agrees with its oracle whatever happens to a train."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.oracle import bands, health, interval, residuals, rules, signals
from tests.oracle.comparison import Comparison
from tests.support.estimator_runs import tick, track
from tests.support.fuzzed_ticks import Train, designs
from tests.support.stepped import SteppedEstimator
from wrcd.core.terms import MAX_AXLES
from wrcd.native import constant

designs_once = cache(designs)


def compared(name: str, axles: int, seed: int, ticks: int, every: int) -> Comparison:
    """Over so many ticks of a train; every: ticks between two estimates."""
    estimator = SteppedEstimator(designs_once()[name], axles)
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


@pytest.mark.parametrize(("curve", "torque_Nm", "most"), [("D", 1500.0, 0.1), ("B", 10_000.0, 0.3)])
def test_estimator_agrees_with_its_oracle_while_torque_rises_beyond_what_is_said_and_falls(
    curve: str, torque_Nm: float, most: float
) -> None:
    """Signals of one rail, under rules that say half of what they should: from coasting to a contradiction, and
    to a peak that is remembered."""
    design = designs_once()["lone-wheelset"]
    estimator = SteppedEstimator(replace(design, polynomial=0.5 * design.polynomial), 1)
    both, regimes, contradicted = Comparison(estimator), set[int](), set[bool]()
    z = track(14.0, curve=curve, torque_Nm=torque_Nm)
    for k, row in enumerate(z):
        t = tick(k, row, most * abs((k / 1200 + 1.0) % 2.0 - 1.0))
        both.stepped(t, estimator.step(t))
        if k % 3 == 0:
            both.estimated(found := estimator.estimate())
            regimes.add(int(found.regime[0]))
            contradicted.add(bool(found.contradicted[0]))
    assert len(regimes) >= 3
    assert contradicted == {True, False}


def test_numbers_that_python_takes_from_c_are_the_oracles_own() -> None:
    oracles = {
        "MIN_FIRING": rules.MIN_FIRING, "LOWEST_LOG_SPREAD": rules.LOG_SPREADS[0], "NOISE": rules.NOISE.start,
        "HIGHEST_LOG_SPREAD": rules.LOG_SPREADS[1], "SWING": rules.SWING.start, "HARSH_SHARE": interval.HARSH_SHARE,
        "GAPS_SHARE": interval.GAPS_SHARE,
        "MIN_M": interval.MIN_M, "MAX_JUMP": signals.MAX_JUMP, "CERTAIN": health.CERTAIN, "MAX_FEATURE": health.MOST,
        "SLOWEST_M_S": bands.SLOWEST_M_S, "LENGTH": rules.LENGTH, "PAIR_OWN": health.OWN,
        "PAIR_FEATURES": health.FEATURES, "SPAN_TICKS": health.SPAN_TICKS, "BLOCK_TICKS": residuals.BLOCK_TICKS,
        "LAG": residuals.LAG, "OF_PARTNER_IN_BANDS": rules.IN_BANDS.start + 9,
    }  # fmt: skip
    assert {name: constant(name) for name in oracles} == oracles


@pytest.mark.night
@pytest.mark.parametrize("axles", range(1, MAX_AXLES + 1))
@pytest.mark.parametrize("name", designs_once())
def test_estimator_agrees_with_its_oracle_on_a_million_fuzzed_ticks(name: str, axles: int) -> None:
    """A million in all of these."""
    compared(name, axles, 100 + axles, 31_250, 97)
