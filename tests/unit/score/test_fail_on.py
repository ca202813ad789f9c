"""--fail-on missed, of `sim-ecu score` and `sim-ecu loop`: the status, and the line that says why."""

from dataclasses import replace
from typing import Any

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.loop import run_loop
from sim_ecu.loop.loop_rides import play
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.variants import STOPS
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score import run_score
from sim_ecu.score.suites import runs
from tests.support import short_row
from wrcd import resources

GOAL = Goal("a suite: a figure", Figure(1.0, 1.0, 1.0, 20, 20), 1.0).record() | {"ideal": None}


@pytest.fixture(params=["score", "loop"])
def command(request: pytest.FixtureRequest, jobs_here: None, monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], Any]:
    """A command that plays next to nothing, and its module and the name of its judge."""
    if request.param == "score":
        run = next(iter(runs(load_source(resources.DESIGN), "dry-hours", 0.01)))
        short = replace(run, scenario=replace(run.scenario, duration_s=3.0), judged_from_s=1.0)
        monkeypatch.setattr(run_score, "runs", lambda *_: iter([short]))
        return ["score", "--jobs", "1"], (run_score, "judge")
    monkeypatch.setitem(STOPS, short_row.RAIL, short_row.briefly)
    (case,) = cases("actuators", f"{short_row.RAIL}: fast")
    monkeypatch.setattr(run_loop, "cases", lambda *_: [case])
    monkeypatch.setattr(run_loop, "play_one", lambda work: play(case, work.number))
    return ["loop", "--jobs", "1", "--seeds", "1"], (run_loop, "judge_all")


def test_status_is_that_of_the_goals_where_it_was_asked_for(
    command: tuple[list[str], Any], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words, (module, name) = command
    judge = getattr(module, name)
    for verdicts, asked, status, said in (
        ((MET, MISSED, MISSED), ["--fail-on", "missed"], 1, "--fail-on missed: 2 of 3 goals are missed"),
        ((MET, MISSED), ["--fail-on", "missed"], 1, "--fail-on missed: 1 of 2 goals is missed"),
        ((MET, MISSED), [], 0, ""),
        ((MET, MET_CHANCE, CHANCE, TOO_FEW), ["--fail-on", "missed"], 0, ""),
        ((TOO_FEW,) * 2, ["--fail-on", "missed"], 2, "--fail-on: no goal could be judged, for too few runs"),
    ):
        goals = [GOAL | {"verdict": v} for v in verdicts]
        monkeypatch.setattr(module, name, lambda *of, goals=goals: judge(*of) | {"goals": goals})
        assert main([*words, *asked]) == status
        told = capsys.readouterr()
        assert ("--fail-on" in told.err) == bool(said)
        assert said in told.err
        assert "**goals**" in told.out  # the tables come first
