"""The goals of `sim-ecu score`: --fail-on missed, and what a quick one judges."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Figure
from sim_ecu.reporting.verdicts import MIN_QUICK_RUNS, Goal
from sim_ecu.score import run_score
from sim_ecu.score.goal_drawing import beyond, write_picture
from sim_ecu.score.report import judge
from sim_ecu.score.score_goals import goals
from sim_ecu.score.suites import runs
from wrcd import resources

GOAL = Goal("a suite: a figure", Figure(1.0, 1.0, 1.0, 20, 20), 1.0).record()


@pytest.mark.usefixtures("jobs_here")
def test_status_is_that_of_the_goals_where_it_was_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
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
        judged = [GOAL | {"verdict": v} for v in verdicts]
        monkeypatch.setattr(run_score, "judge", lambda *of, judged=judged: judge(*of) | {"goals": judged})
        picture = tmp_path / "goals.png"
        assert main(["score", "--jobs", "1", "--plot", str(picture), *asked]) == status
        assert picture.read_bytes().startswith(b"\x89PNG")
        picture.unlink()
        told = capsys.readouterr()
        assert ("--fail-on" in told.err) == bool(said)
        assert said in told.err
        assert "**goals**" in told.out  # the tables come first


@pytest.mark.parametrize(
    ("goal", "value", "ratio"),
    [
        (GOAL, 2.0, 2.0), (GOAL, 0.0, 0.1), (GOAL, 99.0, 10.0), (GOAL | {"bound": 0.0}, 0.0, 1.0),
        (GOAL | {"bound": 0.0}, 1.0, 10.0), (GOAL | {"at_least": True, "bound": 0.9}, 0.95, 0.5),
        (GOAL | {"at_least": True, "bound": 0.9}, 0.8, 2.0),
    ],
)  # fmt: skip
def test_picture_of_goals_is_right_of_1_where_one_is_missed(goal: dict[str, Any], value: float, ratio: float) -> None:
    assert beyond(goal, value) == pytest.approx(ratio)


def test_picture_of_goals_takes_what_is_not_known_and_none(tmp_path: Path) -> None:
    unknown = Goal("x", Figure(math.nan, math.nan, math.nan, 3, 3), 1.0).record()
    for goals_of in ([], [unknown, GOAL]):
        write_picture(goals_of, tmp_path / "goals.png")
        assert (tmp_path / "goals.png").stat().st_size > 5000


def test_picture_is_a_png(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["score", "--suite", "paper", "--plot", str(tmp_path / "x.svg")]) == 2
    assert "--plot: takes .png" in capsys.readouterr().err


def figure(value: float, runs: int) -> Figure:
    return Figure(value, value - 0.1, value + 0.1, runs, 1000)


def suites(runs: int) -> dict[str, Any]:
    """What came of `dry-hours`: nine seconds, of so many runs."""
    return {"dry-hours": {"episodes": 0, "seconds": figure(9.0, runs), "hours": 1.0, "at_most_per_hour": 3.0}}


def test_quick_score_judges_nothing_that_has_few_runs() -> None:
    few, many, accused = suites(MIN_QUICK_RUNS - 1), suites(MIN_QUICK_RUNS), figure(0.0, 12)
    assert [g.verdict for g in goals(few, accused)] == [MISSED, MET_CHANCE]
    assert [g.verdict for g in goals(few, accused, quick=True)] == [TOO_FEW, TOO_FEW]
    assert [g.verdict for g in goals(many, None, quick=True)] == [MISSED]
