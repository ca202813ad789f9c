"""The loop's judge on steps made by hand, and what the daemon said against the truth."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from sim_ecu.loop.ride_figures import AdhesionSeries, Figures, demand_at, honesty, judge, longest_s, slides
from sim_ecu.loop.rig import Step
from sim_ecu.physics.wheelset import Wheelset

FULL_AS_ADHESION = 22_000.0 / (2 * Wheelset().normal_N * Wheelset().r_0)  # of the default brake


def step(
    number: int, speed: float, slip: Sequence[float], share: float = -1.0, available: float = 0.1, used: float = -0.05,
    energy: float = 0.0, at_peak: float = 0.05,
) -> Step:  # fmt: skip
    """The step that ends sample `number`, of as many axles as there are slips; it goes 5 ms at its speed."""
    s = np.array(slip)
    ones = np.ones(len(s))
    return Step(
        5000 * number, speed, 0.005 * number * speed, share, speed + s, 0 * ones, 0 * ones, available * ones,
        at_peak * ones, used * ones, s, energy * ones, [],
    )  # fmt: skip


def figures(slips: Sequence[float], speed: float = 20.0) -> Figures:
    return judge([step(k + 1, speed, [s]) for k, s in enumerate(slips)])


@pytest.mark.parametrize(
    ("speed", "slip", "expected"),
    [
        (20.0, -1.49, 0),
        (20.0, -1.51, 1),  # 1.5 m/s
        (20.0, 1.51, 1),
        (9.0, -1.34, 0),
        (9.0, -1.36, 1),  # 15 %
        (8.1, -8.1, 1),
        (7.9, -7.9, 0),  # so slow that controllers act at no less
    ],
)
def test_slide_begins_beyond_the_least_of_its_bounds(speed: float, slip: float, expected: int) -> None:
    assert figures([0.0, slip, slip, 0.0], speed).slides == expected


def test_slide_that_has_not_recovered_is_counted_once() -> None:
    assert figures([0.0, -2.0, -1.0, -2.0, -0.7, -2.0]).slides == 2  # over below 0.75 m/s only
    assert figures([-3.0, -3.0]).slides == 1  # from the first sample on
    both = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    assert slides(both, np.full(4, 20.0)) == 2  # of all axles


def test_slide_that_began_fast_or_slow_is_counted_by_where_it_began() -> None:
    slip = np.array([[0.0], [2.0], [2.0], [0.0], [2.0], [2.0]])
    assert slides(slip, np.array([8.2, 8.1, 7.9, 7.8, 7.7, 7.6])) == 1
    assert slides(slip[:3], np.array([7.7, 7.8, 8.1])) == 0


def test_time_and_energy_beyond_the_peak_are_of_the_wheels_beyond_its_creep() -> None:
    every = [step(k + 1, 10.0, [-0.49, -slip], energy=1000.0) for k, slip in enumerate([0.49, 0.51, 0.6, 0.5])]
    f = judge(every)  # the peak lies at 0.5 m/s
    assert f.beyond_s == pytest.approx(0.01)
    assert [f.beyond_kJ, f.slip_energy_kJ] == pytest.approx([2 / 4, 8 / 4])
    assert judge([step(1, 2.9, [-2.9], energy=1000.0)]).beyond_s == 0.0  # too slow to be judged


def test_locked_time_is_that_of_wheels_below_a_twentieth_of_the_speed() -> None:
    f = judge([step(k + 1, 20.0, [-19.5, -10.0]) for k in range(10)])
    assert f.locked_s == pytest.approx(0.05)


def test_energy_is_the_mean_of_a_wheel_and_distance_counts_from_the_demand() -> None:
    before = [step(k + 1, 20.0, [0.0, 0.0], share=-0.05, energy=1000.0) for k in range(4)]
    after = [step(k + 5, 20.0, [0.0, 0.0], energy=1000.0) for k in range(6)]
    f = judge(before + after)
    assert f.slip_energy_kJ == pytest.approx(6 * 2 * 1.0 / 4)
    assert [f.stop_m, f.seconds] == pytest.approx([0.6, 0.03])
    assert not f.stopped


def test_utilisation_is_judged_only_where_the_driver_asks_for_more_than_there_is() -> None:
    short = [step(1, 20.0, [0.0], used=-0.05), step(2, 20.0, [0.0], used=-0.09)]
    enough = [step(3, 20.0, [0.0], available=FULL_AS_ADHESION + 0.01, used=-0.2)]
    assert judge(short + enough).utilisation == pytest.approx(0.7)
    assert math.isnan(judge(enough).utilisation)


def test_adhesion_against_the_demand_uses_nothing_and_takes_impulse_away() -> None:
    f = judge([step(1, 20.0, [0.0], share=-1.0, used=0.04)])
    assert f.utilisation == 0.0
    assert f.impulse_kNs == pytest.approx(-0.04 * 2 * Wheelset().normal_N * 0.005 / 1e3)


def test_run_has_stopped_when_its_last_speed_is_below_three_metres_a_second() -> None:
    assert figures([0.0], 2.99).stopped
    assert not figures([0.0], 3.01).stopped


def test_demand_is_the_first_half_of_the_largest_effort() -> None:
    assert demand_at(np.array([-0.05, -0.05, -0.3, -0.6, -1.0])) == 3
    assert demand_at(np.zeros(3)) == 0


# --- what was said


def told(
    mu_pct: Sequence[float], valid: Sequence[bool], half_pp: float = 2.0, every_us: int = 20_000
) -> AdhesionSeries:
    n = len(mu_pct)
    return AdhesionSeries(np.arange(1, n + 1) * every_us, np.array(mu_pct), np.full(n, half_pp), np.array(valid))


def running(n: int, speed: float = 20.0) -> list[Step]:
    return [step(k + 1, speed, [0.0], available=0.1) for k in range(4 * n)]


@pytest.mark.parametrize(
    ("mu_pct", "valid", "speed", "found"),
    [
        ([10.0, 13.0, 13.0, 13.0], [True, True, False, True], 20.0, [0.75, 2 / 3, 0.0, 0.0]),  # only while Valid
        ([7.0] * 10, [True] * 10, 20.0, [1.0, 1.0, 0.18, 0.0]),  # too low is outside, and not over
        ([13.0] * 10, [True] * 10, 2.0, [0.0, 0.0, 0.0, 0.0]),  # nothing is judged at walking pace
    ],
)
def test_frames_outside_the_interval_are_counted_and_timed(
    mu_pct: list[float], valid: list[bool], speed: float, found: list[float]
) -> None:
    (h,) = honesty({1: told(mu_pct, valid)}, running(len(valid), speed))
    assert [h.valid, h.outside, h.outside_s, h.over_s] == pytest.approx(found)
    assert h.axle == 1


def test_silence_ends_a_stretch() -> None:
    stamps = np.array([0, 20_000, 40_000, 101_000, 121_000])
    assert longest_s(np.ones(5, bool), stamps) == pytest.approx(0.04)
    assert longest_s(np.ones(5, bool), stamps - np.array([0, 0, 0, 1000, 1000])) == pytest.approx(0.12)
