"""When to begin to brake: never later than without wrcd, and by no advice that is not of this rail and of now."""

import math

import pytest

from sim_ecu.loop.control.braking_rate import RATES, AdvisedRate, needed_m_s2

S = 1_000_000
GOOD, POOR = (1.0, 1.2), (0.5, 0.6)  # lower end and estimate: of POOR 0.425 is planned with


@pytest.fixture
def rate() -> AdvisedRate:
    return AdvisedRate()


def poor(rate: AdvisedRate, now_us: int = 0, position_m: float = 0.0) -> AdvisedRate:
    rate.take(now_us, position_m, *POOR)
    return rate


def after_test(rate: AdvisedRate) -> AdvisedRate:
    """A test began on POOR and has found GOOD."""
    assert poor(rate).tests(0, 0.0)
    rate.take(S, 20.0, *GOOD)
    rate.tested(S, 20.0)
    return rate


@pytest.mark.parametrize(("low_m_s2", "planned_m_s2"), [
    (0.0, RATES.least), (0.2, RATES.least), (0.4, 0.34), (1.0, 0.85), (1.1, RATES.dry), (2.5, RATES.dry),
])  # fmt: skip
def test_share_of_the_lower_end_is_planned_with_but_never_more_than_the_dry_rate(
    rate: AdvisedRate, low_m_s2: float, planned_m_s2: float
) -> None:
    rate.take(0, 0.0, low_m_s2, 2.5)
    assert rate.rate_m_s2(0, 0.0) == pytest.approx(planned_m_s2)
    rate.tested(0, 0.0)
    assert rate.rate_m_s2(0, 0.0) == pytest.approx(planned_m_s2)


def test_last_valid_advice_holds_two_seconds_on_the_way_then_the_cautious_rate(rate: AdvisedRate) -> None:
    assert rate.rate_m_s2(0, 0.0) == RATES.cautious  # none yet
    poor(rate)
    assert rate.rate_m_s2(2 * S, 40.0) == pytest.approx(0.425)
    assert rate.rate_m_s2(2 * S + 1, 40.0) == RATES.cautious
    assert poor(rate, 3 * S, 60.0).rate_m_s2(3 * S, 60.0) == pytest.approx(0.425)


def test_advice_of_a_standing_train_holds_300_s_within_30_m(rate: AdvisedRate) -> None:
    poor(rate)
    for position_m in (0.0, 30.0, -30.0):
        assert rate.rate_m_s2(300 * S, position_m) == pytest.approx(0.425)
        assert rate.rate_m_s2(300 * S + 1, position_m) == RATES.cautious
    for position_m in (30.1, -30.1):
        assert rate.rate_m_s2(3 * S, position_m) == RATES.cautious


def test_result_of_a_test_holds_over_a_coasting_trains_advice(rate: AdvisedRate) -> None:
    poor(after_test(rate), 2 * S, 40.0)
    assert rate.rate_m_s2(2 * S, 40.0) == pytest.approx(0.85)
    rate.take(3 * S, 60.0, 0.3, 0.37)  # just above 0.6 of the estimate before
    assert rate.rate_m_s2(3 * S, 60.0) == pytest.approx(0.85)
    rate.take(4 * S, 80.0, 0.3, 0.35)
    assert rate.rate_m_s2(4 * S, 80.0) == pytest.approx(0.255)
    rate.take(5 * S, 100.0, *POOR)  # and does not come back
    assert rate.rate_m_s2(5 * S, 100.0) == pytest.approx(0.425)
    assert rate.tests(5 * S, 100.0)


def test_better_advice_counts_above_the_result_of_a_test(rate: AdvisedRate) -> None:
    assert poor(rate).tests(0, 0.0)
    rate.tested(0, 0.0)
    rate.take(S, 20.0, *GOOD)
    assert rate.rate_m_s2(S, 20.0) == pytest.approx(0.85)


def test_result_of_a_test_without_advice_is_no_rate(rate: AdvisedRate) -> None:
    after_test(rate)
    assert rate.rate_m_s2(4 * S, 80.0) == RATES.cautious
    other = poor(AdvisedRate())
    assert other.tests(0, 0.0)
    other.tested(4 * S, 80.0)  # silent at its end
    poor(other, 5 * S, 100.0)
    assert other.rate_m_s2(5 * S, 100.0) == pytest.approx(0.425)
    other.take(6 * S, 120.0, 0.3, 0.4)
    assert other.rate_m_s2(6 * S, 120.0) == RATES.cautious


def test_test_is_worth_nothing_without_fresh_advice_after_one_or_at_the_dry_rate(rate: AdvisedRate) -> None:
    assert not rate.tests(0, 0.0)
    assert poor(rate).tests(2 * S, 40.0)
    assert not rate.tests(2 * S + 1, 40.0)
    rate.take(3 * S, 60.0, 1.1, 1.2)
    assert not rate.tests(3 * S, 60.0)
    assert not after_test(AdvisedRate()).tests(S, 20.0)


def test_needed_deceleration_is_infinite_at_the_mark() -> None:
    assert needed_m_s2(20.0, 200.0) == pytest.approx(1.0)
    assert needed_m_s2(20.0, 100.0) == pytest.approx(2.0)
    assert needed_m_s2(1.0, 0.0) == math.inf
    assert needed_m_s2(1.0, -5.0) == math.inf


def test_what_a_test_found_holds_for_a_minute_and_not_for_the_next_mark() -> None:
    rate = AdvisedRate()
    rate.take(0, 0.0, 0.4, 1.5)
    assert rate.tests(0, 0.0)
    rate.take(2_000_000, 30.0, 1.2, 1.4)
    rate.tested(2_000_000, 30.0)
    for now_us, planned in ((62_000_000, RATES.dry), (62_000_001, RATES.kept * 0.4)):
        rate.take(now_us, 900.0, 0.4, 1.5)
        assert rate.rate_m_s2(now_us, 900.0) == pytest.approx(planned)
        assert rate.tests(now_us, 900.0) is (planned != RATES.dry)
