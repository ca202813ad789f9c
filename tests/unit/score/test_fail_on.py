"""--fail-on missed, of `sim-ecu score` and `sim-ecu loop`: the status, and the line that says why."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.loop import run_loop
from sim_ecu.loop.comparison_figures import judge_all
from sim_ecu.loop.suites import cases
from sim_ecu.reporting.values import Figure
from sim_ecu.reporting.verdicts import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Goal
from sim_ecu.score import run_score
from sim_ecu.score.report import judge
from sim_ecu.score.suites import runs
from tests.support import short_row
from wrcd import resources

Judge = Callable[..., dict[str, Any]]
PLAYED: dict[str, Any] = {}  # by command: the runs, which are the same for every goal


def with_verdicts(by: Judge, verdicts: Sequence[str]) -> Judge:
    """The judge, with goals that come to these verdicts; there are no others."""
    goal = Goal("a suite: a figure", Figure(1.0, 1.0, 1.0, 20, 20), 1.0).record() | {"ideal": None}
    return lambda *arguments: by(*arguments) | {"goals": [goal | {"verdict": v} for v in verdicts]}


def played_once(command: str, play: Callable[..., Any]) -> Callable[..., Any]:
    """play, whose first outcome is that of every further call."""
    return lambda *arguments: PLAYED[command] if command in PLAYED else PLAYED.setdefault(command, play(*arguments))


@pytest.fixture
def command(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[[Sequence[str]], list[str]]:
    """Makes the command of the parameter play next to nothing, and judge its goals so."""

    def asked(verdicts: Sequence[str]) -> list[str]:
        if request.param == "score":
            run = next(iter(runs(load_source(resources.DESIGN), "dry-hours", 0.01)))
            short = replace(run, scenario=replace(run.scenario, duration_s=3.0), judged_from_s=1.0)
            monkeypatch.setattr(run_score, "runs", lambda *_: iter([short]))
            monkeypatch.setattr(run_score, "_play_all", played_once("score", run_score._play_all))
            monkeypatch.setattr(run_score, "judge", with_verdicts(judge, verdicts))
            return ["score", "--jobs", "1"]
        (case,) = cases("actuators", f"{short_row.RAIL}: fast")
        monkeypatch.setattr(run_loop, "cases", lambda *_: [case])
        monkeypatch.setattr(run_loop, "play_one", short_row.play_briefly)
        monkeypatch.setattr(run_loop, "play_all", played_once("loop", run_loop.play_all))
        monkeypatch.setattr(run_loop, "judge_all", with_verdicts(judge_all, verdicts))
        return ["loop", "--jobs", "1", "--seeds", "1"]

    return asked


@pytest.mark.parametrize(
    ("command", "verdicts", "fail_on", "status", "said"),
    [
        ("score", (MET, MISSED, MISSED), True, 1, "--fail-on missed: 2 of 3 goals are missed"),
        ("loop", (MET, MISSED), True, 1, "--fail-on missed: 1 of 2 goals is missed"),
        ("score", (MET, MISSED), False, 0, ""),
        ("loop", (MET, MISSED), False, 0, ""),
        ("score", (MET, MET_CHANCE, CHANCE, TOO_FEW), True, 0, ""),
        ("loop", (TOO_FEW, TOO_FEW), True, 2, "--fail-on: no goal could be judged, for too few runs"),
    ],
    indirect=["command"],
)
def test_status_is_that_of_the_goals_where_it_was_asked_for(
    command: Callable[[Sequence[str]], list[str]], verdicts: Sequence[str], fail_on: bool, status: int, said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert main([*command(verdicts), *(["--fail-on", "missed"] if fail_on else [])]) == status
    told = capsys.readouterr()
    assert ("--fail-on" in told.err) == bool(said)
    assert said in told.err
    assert "**goals**" in told.out  # the tables come first
