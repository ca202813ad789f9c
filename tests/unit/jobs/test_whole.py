"""Score and loop on the campaigns' machinery: a worker that dies, a run that fails, and what is then printed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.jobs.whole import MOST_NAMED, Missing, Piece, not_whole
from sim_ecu.loop import run_loop
from sim_ecu.loop.loop_rides import RideResult, play
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.variants import STOPS
from sim_ecu.score import run_score
from sim_ecu.score.run_score import ScoreRequest
from sim_ecu.score.score_play import Trace
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import Run
from tests.support import short_row
from wrcd import resources
from wrcd.errors import Status

ROW = ("loop", "--suite", "actuators", "--only", f"{short_row.RAIL}: fast", "--jobs", "1")


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    monkeypatch.setitem(STOPS, short_row.RAIL, short_row.briefly)
    return monkeypatch


def test_killed_worker_loses_nothing(
    brief: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    brief.setenv(short_row.MARK, str(tmp_path / "killed"))
    brief.setattr(run_loop, "play_one", short_row.killed_once)
    (case,) = cases("actuators", f"{short_row.RAIL}: fast")
    found, missing = run_loop.play_all([case], 1, 1)
    assert (tmp_path / "killed").exists()
    assert not missing
    assert repr(found) == repr(play(case, 0))
    assert "run 1 of 1" in capsys.readouterr().err


@pytest.mark.usefixtures("jobs_here")
def test_run_of_the_loop_that_fails_twice_is_named_and_nothing_looks_whole(
    brief: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (case,) = cases("actuators", f"{short_row.RAIL}: fast")

    def first_fails(work: run_loop.Work) -> list[RideResult]:
        if work.number == 0:
            raise ValueError("no wheel")
        return play(case, work.number)

    brief.setattr(run_loop, "play_one", first_fails)
    out = tmp_path / "out.json"
    assert main([*ROW, "--seeds", "2", "--json", str(out)]) == Status.STOPPED
    told = capsys.readouterr()
    assert told.out == ""
    assert not out.exists()
    assert "run 2 of 2" in told.err  # the other one went on
    assert "1 run failed twice" in told.err
    assert f"actuators, {short_row.RAIL}: fast" in told.err
    assert "seed 1000000: ValueError: no wheel" in told.err


def short(run: Run) -> Run:
    return replace(run, scenario=replace(run.scenario, duration_s=3.0), judged_from_s=1.0)


@pytest.mark.usefixtures("jobs_here")
def test_suites_of_a_score_that_are_whole_are_printed_and_the_others_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = load_source(resources.DESIGN)
    played = [short(next(iter(runs(source, suite, 0.01)))) for suite in ("dead", "dry-hours")]
    monkeypatch.setattr(run_score, "runs", lambda *_: iter(played))
    play_one = run_score.play_one

    def dead_fail(asked: ScoreRequest, run: Run) -> list[Trace]:
        if run.suite == "dead":
            raise ValueError("no wheel")
        return play_one(asked, run)

    monkeypatch.setattr(run_score, "play_one", dead_fail)
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    assert main(["score", "--jobs", "1", "--json", str(out), "--html", str(page)]) == Status.STOPPED
    told = capsys.readouterr()
    assert told.out.startswith("NOT WHOLE: dead left out, because runs failed.")
    assert "**dry-hours**" in told.out
    assert "**dead**" not in told.out
    assert "dead, both die, run 0: ValueError: no wheel" in told.err
    written = json.loads(out.read_text())
    assert set(written["suites"]) == {"dry-hours"}
    assert written["run"]["left_out"] == {"dead": ["both die, run 0: ValueError: no wheel"]}
    assert "<title>NOT WHOLE sim-ecu score" in page.read_text()
    assert page.read_text().count("dead left out, because runs failed.") == 1


@pytest.mark.usefixtures("jobs_here")
def test_suites_of_the_loop_that_are_whole_are_printed_and_the_others_named(
    brief: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (whole,), (holed, *_) = cases("actuators", f"{short_row.RAIL}: fast"), cases("worlds")
    brief.setattr(run_loop, "cases", lambda *_: [whole, holed])

    def worlds_fail(work: run_loop.Work) -> list[RideResult]:
        if work.suite == "worlds":
            raise ValueError("no wheel")
        return play(whole, work.number)

    brief.setattr(run_loop, "play_one", worlds_fail)
    out, page = tmp_path / "out.json", tmp_path / "out.html"
    asked = ["loop", "--jobs", "1", "--seeds", "1", "--json", str(out), "--html", str(page)]
    assert main(asked) == Status.STOPPED
    assert capsys.readouterr().out.startswith("NOT WHOLE: worlds left out, because runs failed.")
    (why,) = json.loads(out.read_text())["run"]["left_out"]["worlds"]
    assert why.endswith("seed 1000000: ValueError: no wheel")
    assert "<title>NOT WHOLE sim-ecu loop" in page.read_text()


def test_grid_with_a_hole_takes_the_suites_along_that_are_compared_with_it() -> None:
    missing = [Missing(Piece("grid", "mems, run 3", 1.0), "it failed")]
    assert run_score._holed(missing, None) == ("grid", "robust", "rough", "harsh")
    assert run_score._holed(missing, "rough") == ("grid", "rough")


def test_error_names_so_many_runs_and_counts_the_others() -> None:
    text = str(not_whole([Missing(Piece("drops", f"down, run {k}", 1.0), "it died") for k in range(MOST_NAMED + 2)]))
    assert text.startswith(f"{MOST_NAMED + 2} runs failed twice")
    assert text.count("it died") == MOST_NAMED
    assert text.endswith("and 2 more")
