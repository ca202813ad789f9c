"""The loop's statistics on runs made by hand."""

import math

import pytest

from sim_ecu.loop.judge import Figures
from sim_ecu.loop.statistics import Runs, against, front, spread, spreads
from sim_ecu.score.goals import CHANCE, MET, MISSED, Goal


def run(
    stop_m: float, energy_kJ: float = 100.0, beyond: float = 5.0, impulse_kNs: float = 100.0, stopped: bool = True
) -> Figures:  # fmt: skip
    """beyond: seconds beyond the peak, and twice that in kJ."""
    return Figures(0, beyond, 0.0, 1.0, energy_kJ, 2.0 * beyond, 0.9, impulse_kNs, stop_m, 10.0, stopped)


def runs(stop_m: float, energy_kJ: float = 100.0, beyond: float = 5.0, n: int = 20) -> Runs:
    """n runs, the k-th k % longer and wearier than the first."""
    return {k: run(stop_m * (1 + k / 100), energy_kJ * (1 + k / 100), beyond, 1e4 / stop_m) for k in range(n)}


def test_spread_leaves_out_what_is_no_number() -> None:
    s = spread([1.0, math.nan, 3.0, 2.0])
    assert (s.median, s.runs) == (2.0, 3)
    assert [s.low, s.high] == pytest.approx([1.1, 2.9])
    assert spread([math.nan]).runs == 0


def test_ratio_of_paired_runs_has_no_chance_where_all_shrink_alike() -> None:
    a = against(runs(90.0, 50.0, 1), runs(100.0, 100.0, 5), braking=True)
    assert (a.way.value, a.way.low, a.way.high) == pytest.approx((0.9, 0.9, 0.9))
    assert a.energy.value == pytest.approx(0.5)
    assert (a.beyond_time.value, a.beyond_energy.value) == pytest.approx((0.2, 0.2))
    assert (a.beyond_s_before, a.beyond_s_now) == pytest.approx((5.0, 1.0))


def test_run_that_loses_most_is_the_longest_stop_and_the_least_impulse() -> None:
    bare = {k: run(100.0, impulse_kNs=100.0) for k in range(3)}
    other = {0: run(90.0, impulse_kNs=110.0), 1: run(104.0, impulse_kNs=95.0), 2: run(95.0, impulse_kNs=100.0)}
    for braking, worst in ((True, 1.04), (False, 0.95)):
        found = against(other, bare, braking)
        assert found.worst == pytest.approx(worst)
        assert found.worst_number == 1


def test_time_beyond_the_peak_where_there_was_none_is_over_a_tenth_of_a_second() -> None:
    assert against(runs(90.0, beyond=0.5), runs(90.0, beyond=0.0), True).beyond_time.value == pytest.approx(5.0)
    assert against(runs(90.0, beyond=0.0), runs(90.0, beyond=0.0), True).beyond_energy.value == 0.0


def test_interval_of_scattered_ratios_holds_the_median() -> None:
    bare = {k: run(100.0) for k in range(20)}
    new = {k: run(90.0 + (k * 7) % 20) for k in range(20)}
    way = against(new, bare, True).way
    assert way.value == pytest.approx(0.995)
    assert way.low < 0.99 < 1.0 < way.high


def test_stop_that_does_not_end_is_infinitely_long_and_not_short() -> None:
    bare = {k: run(400.0) for k in range(4)}
    new = {0: run(300.0, stopped=False), **{k: run(360.0) for k in range(1, 4)}}
    a = against(new, bare, braking=True)
    assert (a.worst, a.worst_number, a.endless, a.left_out) == (math.inf, 0, 1, 0)
    assert a.way.value == pytest.approx(0.9)
    most = against({k: run(300.0, stopped=False) for k in range(3)} | {3: run(360.0)}, bare, braking=True)
    assert (most.way.value, most.energy.value, most.endless) == (math.inf, math.inf, 3)
    assert Goal("", most.way, 1.03, min_runs=1).verdict != MET


def test_bare_run_that_does_not_end_is_left_out_and_counted() -> None:
    bare = {0: run(900.0, stopped=False), **{k: run(400.0) for k in range(1, 4)}}
    a = against({k: run(360.0) for k in range(4)}, bare, braking=True)
    assert a.way.value == pytest.approx(0.9)
    assert (a.way.runs, a.endless, a.left_out) == (3, 0, 1)
    none = against({0: run(360.0)}, {0: run(900.0, stopped=False)}, braking=True)
    assert (math.isnan(none.way.value), math.isnan(none.worst), none.worst_number) == (True, True, None)
    starts = {k: run(0.0, stopped=False) for k in range(3)}
    assert against(starts, starts, braking=False).way.value == 1.0


def test_distance_of_runs_that_did_not_stop_is_none() -> None:
    stop = spreads({0: run(100.0), 1: run(900.0, stopped=False)})["stop_m"]
    assert (stop.median, stop.runs) == (100.0, 1)


@pytest.mark.parametrize(
    ("with_thresholds", "with_creep", "expected"),
    [
        ((100.0, 50.0), (90.0, 150.0), 1.0),  # as they are
        ((100.0, 25.0), (90.0, 75.0), 1.0),  # half the wear, not shorter than the creep controller
        ((95.0, 40.0), (85.0, 140.0), 1.053),  # better than each: the least by 100 / 95
        ((110.0, 55.0), (99.0, 165.0), 0.9091),  # a tenth worse in both
        ((96.0, 110.0), (90.0, 150.0), 0.4545),  # no mix has as little wear as bare thresholds
        ((160.0, 25.0), (144.0, 75.0), 0.625),  # half the wear, 60 % longer: nowhere at the bare distances
    ],
)
def test_front_is_the_least_factor_by_which_a_mix_is_better_than_a_bare_controller(
    with_thresholds: tuple[float, float], with_creep: tuple[float, float], expected: float
) -> None:
    found = front(fronts(runs(*with_thresholds), runs(*with_creep)), braking=True)
    assert found.value == pytest.approx(expected, abs=0.01)


def fronts(thresholds: Runs, creep: Runs) -> dict[str, Runs]:
    return {
        "thresholds": runs(100.0, 50.0), "creep": runs(90.0, 150.0),
        "thresholds with wrcd": thresholds, "creep with wrcd": creep,
    }  # fmt: skip


def test_front_with_stops_that_do_not_end_reaches_no_bare_controller() -> None:
    endless = {k: run(80.0, 20.0, stopped=False) for k in range(20)}
    assert front(fronts(endless, endless), braking=True).value == 0.0
    assert front(fronts(runs(80.0, 20.0), endless), braking=True).value > 1.0


def test_front_of_starts_takes_more_impulse_for_better() -> None:
    bare = {k: run(0.0, 50.0, impulse_kNs=100.0) for k in range(10)}
    better = {k: run(0.0, 40.0, impulse_kNs=120.0) for k in range(10)}
    both = {"thresholds": bare, "creep": bare, "thresholds with wrcd": better, "creep with wrcd": better}
    assert front(both, braking=False).value == pytest.approx(1.2)
    turned = {"thresholds": better, "creep": better, "thresholds with wrcd": bare, "creep with wrcd": bare}
    assert front(turned, braking=False).value == pytest.approx(0.8)


def test_goal_is_judged_with_its_spread() -> None:
    longer = {k: run(100.0 * (1.02 + 0.002 * k)) for k in range(20)}
    way = against(longer, {k: run(100.0) for k in range(20)}, True).way
    assert Goal("", way, 1.05).verdict == MET
    assert Goal("", way, way.value - 1e-4).verdict == CHANCE
    assert Goal("", way, 1.0).verdict == MISSED
