"""`sim-ecu tune`: small searches from end to end in processes of their own; the goals, and who is ahead in them."""

import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.campaign.campaign_folder import read_results
from sim_ecu.campaign.comparison.compare import BETTER, CHANCE, SAME, TOO_FEW, WORSE, compare
from sim_ecu.campaign.tune import played
from sim_ecu.campaign.tune.played import GOALS, PlayedFigures, operations
from sim_ecu.campaign.tune.stages import Outcome, outcome
from sim_ecu.campaign.tune.trials import Candidate, Designs, Final, Finalist, Judging, search
from sim_ecu.cli.main import main
from sim_ecu.design.brief import load_source, read_brief
from sim_ecu.design.make import POINTS, Brief, in_papers_form
from sim_ecu.jobs.pool import local
from sim_ecu.jobs.store import Store, save
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import FIRST_TEST_SEED, TEST_LOTS, TEST_SEEDS, TRAINING_LOTS, TUNED_LOT, Run
from tests.support.compared import folder, inputs, steps
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.config.settings import read_toml
from wrcd.errors import InputError
from wrcd.estimator.design import load_design

TINY = "[design]\ngrid = 48\nmax_rules = 16\n[plan]\nspeeds = 2\nper_speed = 12\n"


@pytest.mark.night
def test_command_searches_plays_and_says_whether_it_reaches_a_design(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few = ((played.GRID, 0.0), (played.DROPS, 0.0), (played.DRY, 0.0))  # a run of each
    monkeypatch.setattr(played, "TRAINING", few)
    monkeypatch.setattr(played, "TEST", few[:1])
    tiny, out = tmp_path / "tiny.toml", tmp_path / "out"
    tiny.write_text(TINY)
    command = ["tune", "--config", str(tiny), "-o", str(out), "--over", "points", "--budget", "2", "--played", "2"]
    command += ["--jobs", "1"]
    assert main(command) == 1
    said = capsys.readouterr().out
    result = json.loads((out / "tune.json").read_text())
    assert result["played"][0]["name"] == "start"
    assert result["chosen"] in result["front"]
    assert len(result["played"]) == 2
    assert result["candidates"]["best"] <= result["candidates"]["start"]
    assert {c["figure"] for c in result["test"]["comparison"]["comparisons"]} >= {"mean_error_pp", "valid"}
    assert result["test"]["verdict"] == "cannot tell"  # by one run
    assert f"{out / 'tuned.design.json'}: cannot tell" in said
    brief = read_brief(read_toml(out / "brief.toml"))
    assert (brief.max_rules, brief.plan.speeds) == (16, 2)
    assert "mean error (pp)" in (out / "brief.toml").read_text()
    # the same question: nothing is worked out again, and the answer is the same
    files = {f: f.read_bytes() for name in ("designs/*.json", "brief.toml", "*.json") for f in out.glob(name)}
    assert main(command) == 1
    assert "2 candidates of an earlier go" in capsys.readouterr().out
    again = json.loads(files.pop(out / "tune.json")), json.loads((out / "tune.json").read_text())
    assert again[0] | {"seconds": 0} == again[1] | {"seconds": 0}
    assert {f: f.read_bytes() for f in files} == files
    # a design against itself: the start's, which all three are
    itself = tmp_path / "itself.json"
    itself.write_bytes(Path(result["played"][0]["design"]).read_bytes())
    assert main([*command, "--budget", "1", "--played", "1", "--against", str(itself)]) == 0
    assert "tuned.design.json: equals" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [([SAME, WORSE, BETTER], Outcome.FAILS), ([SAME, CHANCE, BETTER], Outcome.BEATS), ([SAME, SAME], Outcome.EQUALS),
     ([SAME, CHANCE], Outcome.OPEN), ([TOO_FEW], Outcome.OPEN)],
)  # fmt: skip
def test_outcome_is_that_of_the_comparison(tmp_path: Path, verdicts: list[str], expected: Outcome) -> None:
    sides = [read_results(folder(tmp_path / name, inputs(seeds=range(9)), steps())) for name in ("a", "b")]
    result = compare(sides[0], sides[1], None, 0.05, lambda *_: None)
    made = [replace(c, verdict=v) for c, v in zip(result.comparisons, verdicts, strict=False)]
    assert outcome(replace(result, comparisons=tuple(made))) == expected


def final(tmp_path: Path, *every: PlayedFigures) -> list[str]:
    """The front of designs of these figures."""
    with local(1) as workers:
        made = Final(tmp_path, 1, workers)
    made.every = [Finalist(str(k), Brief(), LONE_DESIGN, f, 0.0) for k, f in enumerate(every)]
    return [f.name for f in made.front]


def test_front_holds_whom_nobody_is_ahead_of(tmp_path: Path) -> None:
    best, cheap = PlayedFigures((1.0, 0.2, 0.0, 0.01), 3000), PlayedFigures((1.5, 0.3, 0.0, 0.01), 1000)
    quick, behind = PlayedFigures((1.2, 0.1, 0.0, 0.01), 3000), PlayedFigures((1.5, 0.3, 0.0, 0.01), 1001)
    never = PlayedFigures((float("nan"), 0.3, 0.0, 1.0), 3000)
    assert final(tmp_path, best, behind, cheap, quick, never) == ["0", "2", "3"]
    assert final(tmp_path, best, best) == ["0", "1"]  # alike: neither is ahead


def test_one_number_is_below_zero_for_the_better_and_silence_wins_nothing() -> None:
    start = PlayedFigures((1.0, 0.2, 0.0, 0.02), 3000)
    assert start.against(start) == 0.0
    for better in ((0.9, 0.2, 0.0, 0.02), (1.0, 0.1, 0.0, 0.02), (1.0, 0.2, 0.0, 0.0)):
        assert PlayedFigures(better, 3000).against(start) < 0.0
    assert PlayedFigures(start.values, 2000).against(start) < 0.0
    assert PlayedFigures((0.1, 0.0, 0.0, 0.99), 3000).against(start) > 0.0  # hardly ever Valid
    assert PlayedFigures((float("nan"), 0.2, 0.0, 1.0), 3000).against(start) > 0.0  # never
    assert PlayedFigures((1.0, float("nan"), 0.0, 0.02), 3000).against(start) == np.inf


def test_goals_are_means_of_the_runs_that_have_a_number() -> None:
    nothing = {g.figure: None for g in GOALS}
    rows = [nothing | {"suite": "grid", "mean_error_pp": e, "valid": v} for e, v in ((1.0, 0.9), (2.0, 1.0))]
    rows += [nothing | {"suite": "grid", "mean_error_pp": float("nan"), "valid": 0.5}]
    rows += [nothing | {"suite": "drops", "drop_lie_s": 0.75, "mean_error_pp": 9.0}]
    rows += [nothing | {"suite": "dry-hours", "false_low_s": 1.0}]
    assert [g.value(rows) for g in GOALS] == pytest.approx([1.5, 0.75, 36.0, 0.2])
    assert np.isnan(GOALS[1].value(rows[:2]))


def test_cost_goes_with_the_rules() -> None:
    design = load_design(LONE_DESIGN)
    fewer = replace(design, rules=design.rules[::2])
    assert operations(design) > operations(fewer) > operations(design) / 2 > 500


def test_designs_are_tuned_and_tested_on_seeds_that_the_score_has_not() -> None:
    source = load_source(LONE_DESIGN)

    def seeds(every: Iterable[Run]) -> set[int]:
        return {a.seed for r in every for a in r.scenario.axles}

    suites = [suite for suite, _ in played.TEST]
    tested = seeds(r for s in suites for r in runs(source, s, 1.0, TUNED_LOT))
    scored = seeds(runs(source, None, 1.0))
    for lot in (0, TRAINING_LOTS - 1):
        assert seeds(r for s in suites for r in runs(source, s, 1.0, -1 - lot)).isdisjoint(scored | tested)
    assert tested.isdisjoint(scored)
    assert min(tested) >= FIRST_TEST_SEED + TEST_LOTS * TEST_SEEDS  # behind every lot that a campaign may score


@pytest.mark.usefixtures("jobs_here")
def test_budget_holds_for_a_start_that_a_search_would_round(tmp_path: Path) -> None:
    """The start is known, and is not asked for again as another brief with three digits."""
    points = (replace(POINTS[0], noise=(0.0212345, 27.0, 0.174)), *POINTS[1:])
    start = replace(Brief(), points=points, max_rules=6, plan=replace(Brief().plan, speeds=2, per_speed=4))
    with local(1) as workers, Store(tmp_path / "candidates.sqlite") as store:
        judging = Judging(start, 1, store, workers)
        known = Candidate(start, judging.errors([start])[0])
        found = search(known, ["noise"], 2, 1, judging, lambda *_: None)
        assert len(store.rows) == judging.computed == len(found) == 2
    assert known in found


@pytest.mark.usefixtures("jobs_here")
def test_search_alone_writes_a_brief_of_the_papers_form(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tiny, out = tmp_path / "tiny.toml", tmp_path / "out"
    tiny.write_text("[plan]\nspeeds = 2\nper_speed = 2\n")
    command = ["tune", "--form", "paper", "--config", str(tiny), "--over", "noise", "--budget", "1", "--played", "0"]
    assert main([*command, "--jobs", "1", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "1 candidate," in said
    assert "the matching residual" in said
    assert read_brief(read_toml(out / "brief.toml")).points == in_papers_form(Brief()).points  # the start itself
    assert not (out / "tuned.design.json").exists()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--over", "noise,gain"], "--over: there is no 'gain'"),
        (["--over", "weights", "--form", "paper"], "--over: the paper's form has no weights"),
        (["--budget", "0"], "--budget: takes a whole number from 1 on"),
        (["--played", "-1"], "--played: takes a whole number from 0 on"),
        (["--seed", "40"], "--seed: takes a whole number from 0 to 39"),
        (["--config", "tramway"], "there is no vehicle 'tramway'"),
        (["--config", "metro", "--against", "{design}"], "--against: has m_w"),
    ],
)
def test_what_cannot_be_searched_is_said_before_any_work(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["tune", "-o", str(out), *(a.format(design=LONE_DESIGN) for a in arguments)]) == 2
    assert says in capsys.readouterr().err
    assert not out.exists()


def test_folder_that_is_a_file_is_an_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "out"
    file.write_text("")
    assert main(["tune", "-o", str(file)]) == 2
    assert "-o: cannot be made" in capsys.readouterr().err


def test_designs_that_cannot_be_kept_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "designs").write_text("")
    with local(1) as workers, pytest.raises(InputError, match="designs: cannot be made: File exists"):
        Designs(tmp_path / "designs", workers)
    (tmp_path / "tune.json").mkdir()
    with pytest.raises(InputError, match=r"tune\.json: cannot be written"):
        save(tmp_path / "tune.json", lambda partly: partly.write_text(""))


@pytest.mark.parametrize(
    "arguments", [["--search"], ["--search", "--budget", "600", "-o", "noise.toml"], ["--budget", "6", "-o", "a.json"]]
)
def test_design_says_where_its_search_is_now(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", *arguments]) == 2
    assert "sim-ecu tune --over noise,weights --budget 600 --played 0" in capsys.readouterr().err
