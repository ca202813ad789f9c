"""What goes on, and by how much the interval is then wider."""

import numpy as np
import pytest

from wrcd.estimator.design import REGIMES, IntervalModel
from wrcd.estimator.trust.interval import Regime, regime, widening

SPEEDS = np.array([5.0, 10.0, 40.0])
MODEL = IntervalModel(SPEEDS, np.arange(1.0, 1.0 + len(REGIMES))[:, None] + np.array([0.0, 0.2, 0.6]))


def of(swing: float, share: float, cut: bool, saturated: bool) -> Regime:
    found = regime(np.array([[swing, 0.0]]), np.array([share]), np.array([cut]), np.array([saturated]))
    return Regime(int(found[0]))


def test_last_regime_that_applies_counts() -> None:
    assert len(Regime) == len(REGIMES)
    assert (Regime.STEADY.words, Regime.COASTING.words, Regime.SATURATED.words) == ("steady", "coasting", "saturated")
    assert of(0.0, 0.5, cut=False, saturated=False) is Regime.STEADY
    assert of(1.0, 0.5, cut=False, saturated=False) is Regime.MOVING
    assert of(1.0, 0.01, cut=False, saturated=False) is Regime.COASTING
    assert of(1.0, 0.01, cut=True, saturated=False) is Regime.CHANGED
    assert of(1.0, 1.0, cut=True, saturated=True) is Regime.SATURATED


@pytest.mark.parametrize(
    ("speed_m_s", "factor"),
    [(5.0, 3.0), (10.0, 3.2), (20.0, 3.4), (40.0, 3.6), (90.0, 3.6), (1.0, 3.0), (0.0, 3.0), (-0.2, 3.0)],
)
def test_factor_is_of_the_regime_and_between_speeds_of_their_logarithm(speed_m_s: float, factor: float) -> None:
    found = widening(MODEL, np.array([int(Regime.COASTING), int(Regime.STEADY)]), np.array([speed_m_s, 20.0]))
    assert found.tolist() == pytest.approx([factor, 1.4])


def test_speed_that_is_not_known_is_no_error() -> None:
    assert np.isfinite(widening(MODEL, np.array([0]), np.array([np.nan]))).all()
