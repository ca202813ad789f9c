"""--fail-on missed of `sim-ecu score`: the status, and the line that says why."""

from dataclasses import replace

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score import run_score
from sim_ecu.score.report import judge
from sim_ecu.score.suites import runs
from wrcd import resources

GOAL = Goal("a suite: a figure", Figure(1.0, 1.0, 1.0, 20, 20), 1.0).record()


@pytest.mark.usefixtures("jobs_here")
def test_status_is_that_of_the_goals_where_it_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = next(iter(runs(load_source(resources.DESIGN), "dry-hours", 0.01)))
    short = replace(run, scenario=replace(run.scenario, duration_s=3.0), judged_from_s=1.0)
    monkeypatch.setattr(run_score, "runs", lambda *_: iter([short]))
    for verdicts, asked, status, said in (
        ((MET, MISSED, MISSED), ["--fail-on", "missed"], 1, "--fail-on missed: 2 of 3 goals are missed"),
        ((MET, MISSED), ["--fail-on", "missed"], 1, "--fail-on missed: 1 of 2 goals is missed"),
        ((MET, MISSED), [], 0, ""),
        ((MET, MET_CHANCE, CHANCE, TOO_FEW), ["--fail-on", "missed"], 0, ""),
        ((TOO_FEW,) * 2, ["--fail-on", "missed"], 2, "--fail-on: no goal could be judged, for too few runs"),
    ):
        goals = [GOAL | {"verdict": v} for v in verdicts]
        monkeypatch.setattr(run_score, "judge", lambda *of, goals=goals: judge(*of) | {"goals": goals})
        assert main(["score", "--jobs", "1", *asked]) == status
        told = capsys.readouterr()
        assert ("--fail-on" in told.err) == bool(said)
        assert said in told.err
        assert "**goals**" in told.out  # the tables come first
