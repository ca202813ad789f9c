"""The loop's statistics, goals and their rows, on runs made by hand."""

import math
from collections.abc import Mapping
from typing import Any

import pytest

from sim_ecu.loop import BARE_AND_WITH, IDEAL, LAWS, WITH
from sim_ecu.loop.comparison_figures import Runs, against, front, judge_all, spread, spreads
from sim_ecu.loop.loop_page import text
from sim_ecu.loop.loop_rides import RideResult
from sim_ecu.loop.ride_figures import Figures, Honesty
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.rails import GREASY_STOP, WET_STOP
from sim_ecu.reporting.values import MET, MISSED, TOO_FEW
from sim_ecu.reporting.verdicts import Goal


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


SHAPE = {"thresholds": (100.0, 60.0, 10.0), "creep": (90.0, 150.0, 10.0)}  # distance, slip energy, s beyond the peak

SAID = (Honesty(1, 0.9, 0.1, 0.2, 0.1),)


def outcomes(
    suite: str, name: str, ways: Mapping[int, float], ideal: float | None = None, beyond: float = 1.0
) -> list[RideResult]:  # fmt: skip
    """Twenty runs; with wrcd 0.8 of the distance and 0.4 of the energy, but for the runs of other ratios."""
    out = []
    for n in range(20):
        for law in LAWS:
            way, energy, before = SHAPE[law]
            new = way * ways.get(n, 0.8)
            out.append(RideResult(suite, name, law, n, run(way, energy, before)))
            out.append(RideResult(suite, name, WITH[law], n, run(new, 0.4 * energy, beyond), SAID))
        if ideal is not None:
            out.append(RideResult(suite, name, IDEAL, n, run(ideal, 30.0, 0.0)))
    order = [*BARE_AND_WITH, IDEAL]
    return sorted(out, key=lambda o: (o.number, order.index(o.controller)))


def judged(suite: str, name: str, found: list[RideResult]) -> dict[str, Any]:
    case = next(c for c in cases(suite) if c.name == name)
    return {"run": {"seeds": 20, "seeds_of_broad": 20}} | judge_all([case], found)


def goal(result: dict[str, Any], words: str) -> dict[str, Any]:
    (found,) = [g for g in result["goals"] if words in g["what"]]
    return dict(found)


def test_three_runs_twice_as_long_meet_the_median_and_miss_the_worst() -> None:
    result = judged("braking", WET_STOP, outcomes("braking", WET_STOP, {3: 2.0, 7: 2.1, 9: 2.0}))
    for law in LAWS:
        assert goal(result, f"{law}, distance over that without, median of the worst row")["verdict"] == MET
        worst = goal(result, f"{law}, distance over that without, the worst of all runs")
        assert worst["verdict"] == MISSED
        assert f"(braking: {WET_STOP}, seed 1000007)" in worst["what"]


def test_rows_whose_rail_was_known_before_are_judged_together_by_what_lies_beyond_the_peak() -> None:
    found = [*outcomes("braking", WET_STOP, {}, beyond=1.0), *outcomes("braking", GREASY_STOP, {}, beyond=6.0)]
    some = [c for c in cases("braking") if c.name in (WET_STOP, GREASY_STOP)]
    result = judge_all(some, found)
    time = goal(result, "creep, time beyond the peak")
    assert (time["figure"].value, time["figure"].runs, time["verdict"]) == (pytest.approx(0.35), 40, MISSED)
    assert goal(result, "stops on wet and greasy rails known before: thresholds, distance")["verdict"] == MET
    assert goal(result, "creep, slip energy")["figure"].value == pytest.approx(0.4)
    assert len(result["goals"]) == 9
    few = judge_all(some, [o for o in found if o.number < 5])
    assert {g["verdict"] for g in few["goals"]} == {TOO_FEW}  # ten pairs, but five of a row


def test_patch_that_is_met_while_stopping_is_not_known_before() -> None:
    every = cases()
    assert not any("leaf" in c.name and c.known_before for c in every)
    assert {c.suite for c in every if c.known_before} == {c.suite for c in every}


def test_goal_that_is_missed_says_what_the_ideal_reaches() -> None:
    found = outcomes("braking", WET_STOP, dict.fromkeys(range(20), 0.95), 93.0)
    lines = text(judged("braking", WET_STOP, found))
    row = next(line for line in lines if "thresholds, distance over that without |" in line)
    assert "0.950 (0.950–0.950) | ≤ 0.9 | 0.930, out of reach | MISSED" in row
    assert any("creep, slip energy over that without" in line and "| 0.200 | met" in line for line in lines)


def test_suite_of_other_worlds_is_held_to_distances_alone() -> None:
    result = judged("faults", "no fault", outcomes("faults", "no fault", {}, beyond=5.0))
    assert [g["what"].split(",")[1] for g in result["goals"]] == [" distance over that without"] * 4
    assert judge_all([], [])["goals"] == []
