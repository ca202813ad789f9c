"""The loop's goals and their rows, on runs made by hand."""

from collections.abc import Mapping
from typing import Any

import pytest

from sim_ecu.loop.goals import BEYOND, LONGER, LONGEST, goals
from sim_ecu.loop.judge import Figures
from sim_ecu.loop.names import BARE_AND_WITH, CREEP, IDEAL, LAWS, THRESHOLDS, WITH
from sim_ecu.loop.play import Outcome
from sim_ecu.loop.report import judge_all
from sim_ecu.loop.said import Honesty
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.rails import WET_STOP
from sim_ecu.loop.tables import tables
from sim_ecu.score.goals import MET, MISSED

SHAPE = {"thresholds": (100.0, 60.0, 10.0), "creep": (90.0, 150.0, 10.0)}  # distance, slip energy, s beyond the peak

SAID = (Honesty(1, 0.9, 0.1, 0.2, 0.1),)


def outcomes(
    suite: str, name: str, ways: Mapping[int, float], ideal: float | None = None, beyond: float = 1.0
) -> list[Outcome]:  # fmt: skip
    """Twenty runs; with wrcd 0.8 of the distance and 0.4 of the energy, but for the runs of other ratios."""
    out = []
    for n in range(20):
        for law in LAWS:
            way, energy, before = SHAPE[law]
            new = way * ways.get(n, 0.8)
            out.append(Outcome(suite, name, law, n, figures(way, energy, before)))
            out.append(Outcome(suite, name, WITH[law], n, figures(new, 0.4 * energy, beyond), SAID))
        if ideal is not None:
            out.append(Outcome(suite, name, IDEAL, n, figures(ideal, 30.0, 0.0)))
    order = [*BARE_AND_WITH, IDEAL]
    return sorted(out, key=lambda o: (o.number, order.index(o.controller)))


def figures(stop_m: float, energy_kJ: float, beyond_s: float) -> Figures:
    return Figures(0, beyond_s, 0.0, 1.0, energy_kJ, beyond_s, 0.9, 100.0, stop_m, 10.0, True)


def judged(suite: str, name: str, found: list[Outcome]) -> dict[str, Any]:
    case = next(c for c in cases(suite) if c.name == name)
    return {"run": {"seeds": 20, "seeds_of_broad": 20}} | judge_all([case], found)


def verdicts(result: dict[str, Any], kind: str) -> list[str]:
    return [g["verdict"] for g in result["goals"] if g["kind"] == kind]


def test_three_runs_twice_as_long_meet_the_median_and_miss_the_worst() -> None:
    result = judged("braking", WET_STOP, outcomes("braking", WET_STOP, {3: 2.0, 7: 2.1, 9: 2.0}))
    assert verdicts(result, LONGER) == [MET, MET]
    assert verdicts(result, LONGEST) == [MISSED, MISSED]
    assert f"({WET_STOP}, seed 1000007)" in next(g["what"] for g in result["goals"] if g["kind"] == LONGEST)


def test_time_and_energy_beyond_the_peak_are_judged_in_every_suite_whose_rail_was_known_before() -> None:
    result = judged("faults", "no fault", outcomes("faults", "no fault", {}, beyond=5.0))
    assert verdicts(result, BEYOND) == [MISSED] * 4
    known = {c.suite for c in cases() if c.known_before}
    assert known == {"braking", "traction", "train", "faults", "worlds", "actuators"}


def test_patch_that_is_met_while_stopping_is_not_known_before() -> None:
    patch = next(c for c in cases("braking") if c.name == "stop, wet, leaf patch on the way")
    assert not patch.known_before
    assert not any("leaf" in c.name and c.known_before for c in cases())


def test_goal_that_is_missed_says_what_the_ideal_reaches() -> None:
    text = "\n".join(
        tables(judged("braking", WET_STOP, outcomes("braking", WET_STOP, dict.fromkeys(range(20), 0.95), 93.0)))
    )
    row = next(line for line in text.splitlines() if "thresholds, distance over that without |" in line)
    assert "0.950 (0.950–0.950) | ≤ 0.9 | 0.930, out of reach | MISSED" in row
    row = next(line for line in text.splitlines() if "creep, slip energy over" in line)
    assert "| 0.200 at distance 1.03 | met" in row
    assert (
        "creep, distance over that without, median | 0.950 (0.950–0.950) | ≤ 1.03 | 1.033 at slip energy 0.20 | met"
        in text
    )


def test_goals_that_are_met_are_one_row_where_the_rail_is_always_the_same() -> None:
    name = "no fault"
    lines = tables(judged("faults", name, outcomes("faults", name, {})))
    found = [line for line in lines if line.startswith("| faults: ") and "≤" in line]
    assert len([line for line in found if line.startswith("| faults: 1 case: thresholds, ")]) == 3
    assert len([line for line in found if "the worst of all runs" in line]) == len(LAWS)


@pytest.mark.parametrize("law", [THRESHOLDS, CREEP])
def test_goals_of_a_row_name_their_controller(law: str) -> None:
    result = judged("braking", WET_STOP, outcomes("braking", WET_STOP, {}))
    assert sum(f": {law}, " in g["what"] for g in result["goals"]) >= 3
    assert goals({}) == []
