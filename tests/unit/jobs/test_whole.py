"""Score on the campaigns' machinery: a run that fails, and what is then printed."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source
from sim_ecu.jobs.pool import Stopped, Workers
from sim_ecu.jobs.whole import MOST_NAMED, Missing, Piece, each, not_whole
from sim_ecu.score import run_score
from sim_ecu.score.run_score import ScoreRequest
from sim_ecu.score.score_play import Trace
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import Run
from wrcd import resources
from wrcd.errors import Status


def short(run: Run) -> Run:
    return replace(run, scenario=replace(run.scenario, duration_s=3.0), judged_from_s=1.0)


PLAY_ONE = run_score.play_one


def dead_fail(asked: ScoreRequest, run: Run) -> list[Trace]:
    if run.suite == "dead":
        raise ValueError("no wheel")
    return PLAY_ONE(asked, run)


@pytest.mark.usefixtures("jobs_here")
def test_suites_of_a_score_that_are_whole_are_printed_and_the_others_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = load_source(resources.DESIGN)
    played = [short(next(iter(runs(source, suite, 0.01)))) for suite in ("dead", "dry-hours")]
    monkeypatch.setattr(run_score, "runs", lambda *_: iter(played))
    monkeypatch.setattr(run_score, "play_one", dead_fail)
    out = tmp_path / "out.json"
    assert main(["score", "--jobs", "1", "--json", str(out)]) == Status.STOPPED
    told = capsys.readouterr()
    assert told.out.startswith("NOT WHOLE: dead left out, because runs failed.")
    assert "**dry-hours**" in told.out
    assert "**dead**" not in told.out
    assert "dead, both die, run 0: ValueError: no wheel" in told.err
    written = json.loads(out.read_text())
    assert set(written["suites"]) == {"dry-hours"}
    assert written["run"]["left_out"] == {"dead": ["both die, run 0: ValueError: no wheel"]}


@pytest.mark.night
def test_figures_of_a_suite_are_the_same_for_any_number_of_processes(tmp_path: Path) -> None:
    found = []
    for jobs in ("1", "2"):
        out = tmp_path / f"{jobs}.json"
        assert main(["score", "--quick", "--suite", "paper", "--jobs", jobs, "--json", str(out)]) == Status.DONE
        document = json.loads(out.read_text())
        assert document.pop("run")["jobs"] == int(jobs)
        found.append(document)
    assert found[0]["suites"].keys() == {"paper"}
    assert found[0] == found[1]


@pytest.mark.usefixtures("jobs_here")
def test_job_that_fails_among_several_is_named_and_no_hint_promises_more() -> None:
    ends = each(number, ["1", "x"], Workers(None), ["one", "two"])
    assert next(ends) == (0, 1)
    with pytest.raises(Stopped, match="1 of 2 jobs failed twice:\n  two: ValueError") as caught:
        next(ends)
    assert caught.value.hint == ""


def number(text: str) -> int:
    return int(text)


def test_grid_with_a_hole_takes_the_suites_along_that_are_compared_with_it() -> None:
    missing = [Missing(Piece("grid", "mems, run 3", 1.0), "it failed")]
    assert run_score._holed(missing, None) == ("grid", "robust", "rough", "harsh")
    assert run_score._holed(missing, "rough") == ("grid", "rough")


def test_error_names_so_many_runs_and_counts_the_others() -> None:
    text = str(not_whole([Missing(Piece("drops", f"down, run {k}", 1.0), "it died") for k in range(MOST_NAMED + 2)]))
    assert text.startswith(f"{MOST_NAMED + 2} runs failed twice")
    assert text.count("it died") == MOST_NAMED
    assert text.endswith("and 2 more")
