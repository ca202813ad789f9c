"""`sim-ecu tune` in parts: the journal, the goals and who is ahead in them, what a run adds, verdicts."""

import itertools
import json
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.campaign.job import Job
from sim_ecu.campaign.runner import local
from sim_ecu.campaign.tune import played
from sim_ecu.campaign.tune.candidates import Candidate, Judging, search
from sim_ecu.campaign.tune.goals import Difference, Figures, Verdict, differences, figures, front, operations, outcome
from sim_ecu.campaign.tune.journal import Journal
from sim_ecu.campaign.tune.pieces import Pieces
from sim_ecu.campaign.tune.played import Seen, digest, play_all
from sim_ecu.design.make import POINTS, Brief
from sim_ecu.design.source import load_source
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score.suites import runs, training_runs
from sim_ecu.score.suites.run import FIRST_TEST_SEED, TEST_LOTS, TEST_SEEDS, TRAINING_LOTS, Run
from wrcd.errors import InputError
from wrcd.estimator.design import load_design
from wrcd.resources import DESIGN


def job(number: int) -> Job:
    return Job("candidate", {"number": number})


def test_journal_knows_its_answers_after_a_kill_in_the_middle_of_a_line(tmp_path: Path) -> None:
    file = tmp_path / "journal.jsonl"
    journal = Journal(file)
    assert journal.answer(job(1)) is None
    journal.add(job(1), 0.1 + 0.2)
    journal.add(job(2), "inf")
    journal.close()
    whole = file.read_bytes()
    file.write_bytes(whole + whole[:30])
    again = Journal(file)
    assert len(again) == 2
    assert again.answer(job(1)) == 0.1 + 0.2  # to the bit: a search goes on as it went
    assert float(again.answer(job(2))) == np.inf
    again.add(job(3), 1.0)
    again.close()
    assert [json.loads(line)["answer"] for line in file.read_text().splitlines()] == [0.1 + 0.2, "inf", 1.0]


def test_journal_is_one_process_s(tmp_path: Path) -> None:
    file = tmp_path / "journal.jsonl"
    journal = Journal(file)
    journal.add(job(1), 0.5)
    with pytest.raises(InputError, match="another search is at work"):
        Journal(file)
    journal.close()
    again = Journal(file)
    assert again.answer(job(1)) == 0.5
    again.close()


@pytest.mark.parametrize("text", [b"what\n", b"[1]\n", b'{"answer": 1}\n'])
def test_file_that_is_no_journal_is_an_error_and_stays(tmp_path: Path, text: bytes) -> None:
    file = tmp_path / "journal.jsonl"
    file.write_bytes(text)
    with pytest.raises(InputError, match="another folder"):
        Journal(file)
    assert file.read_bytes() == text


def drives(error_pp: float, lie_s: float, low_s: float, silent: float, seed: int = 1) -> list[Seen]:
    """Twenty runs of each suite, scattered about the given values."""
    rng = np.random.default_rng(seed)
    out = []
    for n in range(20):
        more = float(rng.uniform(0.8, 1.2))
        out.append(Seen("grid", n, error_pp * more * 100, 100, round(silent * 100), 100))
        out.append(Seen("drops", n, lie_s=4 * lie_s * more, drops=4))
        out.append(Seen("dry-hours", n, low_s=low_s * more, dry_s=100.0))
    return out


def test_front_holds_whom_nobody_is_ahead_of() -> None:
    best, cheap = Figures((1.0, 0.2, 0.0, 0.01), 3000), Figures((1.5, 0.3, 0.0, 0.01), 1000)
    quick, behind = Figures((1.2, 0.1, 0.0, 0.01), 3000), Figures((1.5, 0.3, 0.0, 0.01), 1001)
    assert front([best, behind, cheap, quick]) == [0, 2, 3]
    assert front([best, best]) == [0, 1]  # alike: neither is ahead
    assert behind.behind(cheap)
    assert not cheap.behind(behind)


def test_design_without_a_figure_is_not_on_the_front() -> None:
    nan = float("nan")
    never, good = Figures((nan, 0.3, 0.0, 1.0), 3000), Figures((1.0, 0.2, 0.0, 0.01), 3000)
    assert front([never, good]) == [1]
    assert front([never]) == [0]


def test_one_number_is_below_zero_for_the_better_and_silence_wins_nothing() -> None:
    start = Figures((1.0, 0.2, 0.0, 0.02), 3000)
    assert start.against(start) == 0.0
    for better in ((0.9, 0.2, 0.0, 0.02), (1.0, 0.1, 0.0, 0.02), (1.0, 0.2, 0.0, 0.0)):
        assert Figures(better, 3000).against(start) < 0.0
    assert Figures(start.values, 2000).against(start) < 0.0
    assert Figures((0.1, 0.0, 0.0, 0.99), 3000).against(start) > 0.0  # hardly ever Valid
    assert Figures((float("nan"), 0.2, 0.0, 1.0), 3000).against(start) > 0.0  # never
    assert Figures((1.0, float("nan"), 0.0, 0.02), 3000).against(start) == np.inf


def test_goals_are_sums_over_sums() -> None:
    seen = [Seen("grid", 1, 30.0, 10, 5, 20), Seen("grid", 2, 10.0, 30, 0, 30), Seen("drops", 1, lie_s=3.0, drops=4),
            Seen("dry-hours", 1, low_s=1.0, dry_s=100.0)]  # fmt: skip
    found = figures(load_design(DESIGN), seen)
    assert found.values == pytest.approx((1.0, 0.75, 36.0, 0.1))
    assert found.cost == operations(load_design(DESIGN)) > 1000


def test_cost_goes_with_the_rules() -> None:
    design = load_design(DESIGN)
    fewer = replace(design, rules=design.rules[::2])
    assert operations(design) > operations(fewer) > operations(design) / 2


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.0, 0.0, "equal"),
        (-0.1, 0.1, "equal"),
        (0.01, 0.1, "equal"),  # surely more, surely too little to matter
        (-0.1, 0.11, "cannot tell"),
        (-0.11, 0.0, "cannot tell"),
        (-0.5, -0.01, "better"),
        (0.01, 0.5, "worse"),
        (float("nan"), float("nan"), "cannot tell"),
    ],
)
def test_a_goal_is_equal_only_within_its_margin(low: float, high: float, words: str) -> None:
    assert Difference("mean error", "pp", 0.1, 1.0, 1.0, low, high).verdict == words


@pytest.mark.parametrize(
    ("ours", "cost", "words"),
    [
        ((1.0, 0.2, 0.0, 0.02), 3000, "equals"),
        ((1.02, 0.2, 0.0, 0.02), 3000, "equals"),
        ((0.7, 0.2, 0.0, 0.02), 3000, "beats"),
        ((0.7, 0.4, 0.0, 0.02), 3000, "does not reach"),
        ((1.0, 0.2, 0.0, 0.05), 3000, "does not reach"),
        ((0.7, 0.2, 0.0, 0.02), 3301, "does not reach"),  # more operations than the margin allows
        ((1.0, 0.2, 0.0, 0.02), 2000, "beats"),
    ],
)
def test_outcome_says_whether_the_design_is_reached(
    ours: tuple[float, float, float, float], cost: int, words: str
) -> None:
    found = differences(drives(*ours), drives(1.0, 0.2, 0.0, 0.02), (cost, 3000))
    assert outcome(found) == words
    for d in found:
        assert d.low <= d.ours - d.theirs <= d.high


def test_runs_that_disagree_or_are_too_few_tell_nothing() -> None:
    """Twice the seconds of lie on a few scattered drops: no proof of anything, of equality neither."""
    lies = np.random.default_rng(2).exponential(1.0, (2, 16)) * [[0.42], [0.22]]
    ours, theirs = ([Seen("drops", n, lie_s=4.0 * x, drops=4) for n, x in enumerate(row)] for row in lies.tolist())
    rest = [s for s in drives(1.0, 0.2, 0.0, 0.02) if s.suite != "drops"]
    found = differences(rest + ours, rest + theirs, (3000, 3000))
    assert [d.verdict for d in found] == ["equal", "cannot tell", "equal", "equal", "equal"]
    assert outcome(found) == "cannot tell"
    few = differences(rest + ours[:6], rest + ours[:6], (3000, 3000))  # even with itself
    assert few[1].verdict == Verdict.OPEN
    assert outcome(differences(rest, rest, (3000, 3000))) == "cannot tell"  # no drop at all


def test_intervals_hold_the_difference_of_few_runs() -> None:
    """Sums over sums of eleven runs of unequal length: beyond them in 2.5 % of the cases."""
    rng = np.random.default_rng(4)
    missed = 0
    for _ in range(200):
        valid = rng.integers(50, 150, (2, 11))
        error = valid * rng.normal(1.0, 0.3, (2, 11))
        ours, theirs = (
            [Seen("grid", n, e, v, 0, 150) for n, (e, v) in enumerate(zip(*row, strict=True))]
            for row in zip(error.tolist(), valid.tolist(), strict=True)
        )
        d = differences(ours, theirs, (1, 1))[0]
        missed += not d.low <= 0.0 <= d.high
    assert missed <= 10


def test_designs_are_played_on_the_same_runs_once(tmp_path: Path) -> None:
    source = load_source(DESIGN)
    (first, *_), (drop, *_) = (list(training_runs(source, suite, 0.01, 3)) for suite in ("grid", "drops"))
    every = [
        replace(r, scenario=replace(r.scenario, duration_s=seconds, axles=r.scenario.axles[:2]), curves=r.curves[:2])
        for r, seconds in ((first, 3.0), (drop, 6.0))
    ]
    journal = Journal(tmp_path / "journal.jsonl")
    told: list[str] = []
    with local(1) as executor:

        def play() -> list[list[Seen]]:
            return play_all([DESIGN, PAPER_DESIGN], every, journal, executor, 1, lambda what, _: told.append(what))

        ours, papers = play()
        assert len(told) == 4
        assert [ours, papers] == play()
        assert len(told) == 4  # nothing again
        bad = tmp_path / "bad.json"
        bad.write_text("{}")
        with pytest.raises(InputError, match=r"bad\.json: cannot be played in grid: "):
            play_all([bad], every[:1], journal, executor, 1, lambda *_: None)
    journal.close()
    assert [s.suite for s in ours] == ["grid", "drops"]
    assert ours[0].frames == papers[0].frames > 2 * 45
    assert 0 < ours[0].valid <= ours[0].frames
    assert ours[0].error_pp != papers[0].error_pp
    assert 1 <= ours[1].drops <= 2


def test_designs_are_tuned_and_tested_on_seeds_that_the_score_has_not() -> None:
    source = load_source(DESIGN)

    def seeds(every: Iterable[Run]) -> set[int]:
        return {a.seed for r in every for a in r.scenario.axles}

    tested, scored = seeds(played.test(source)), seeds(runs(source, None, 1.0))
    tuned = [seeds(played.training(source, seed)) for seed in (0, TRAINING_LOTS - 1)]
    assert tested.isdisjoint(scored)
    for some in tuned:
        assert some.isdisjoint(scored | tested)
    assert min(tested) >= FIRST_TEST_SEED + TEST_LOTS * TEST_SEEDS  # behind every lot that a campaign may score
    assert {r.suite for r in played.test(source)} == {suite for suite, _ in played.TEST}


def test_run_of_another_wheelset_or_length_is_another_question() -> None:
    first, second = itertools.islice(training_runs(load_source(DESIGN), "grid", 0.02, 3), 2)
    scene = first.scenario
    heavier = replace(scene, wheelset=replace(scene.wheelset, m_w=1.1 * scene.wheelset.m_w))
    others = [replace(first, scenario=heavier), replace(first, scenario=replace(scene, duration_s=3.0)), second]
    (again,) = itertools.islice(training_runs(load_source(DESIGN), "grid", 0.02, 3), 1)
    assert digest(again) == digest(first)
    assert len({digest(r) for r in (first, *others)}) == 4


def test_budget_holds_for_a_start_that_a_search_would_round(tmp_path: Path) -> None:
    """The start is known, and is not asked for again as another brief with three digits."""
    points = (replace(POINTS[0], noise=(0.0212345, 27.0, 0.174)), *POINTS[1:])
    start = replace(Brief(), points=points, max_rules=6, plan=replace(Brief().plan, speeds=2, per_speed=4))
    journal = Journal(tmp_path / "journal.jsonl")
    with local(1) as executor:
        judging = Judging(start, 1, journal, executor, 1)
        known = Candidate(start, judging.errors([start])[0])
        found = search(known, ["noise"], 2, 1, judging, lambda *_: None)
    journal.close()
    assert len(journal) == judging.computed == len(found) == 2
    assert known in found


def test_time_left_is_that_of_the_piece_that_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    pieces = Pieces()
    for now[0], what, share in ((50.0, "a", 0.5), (100.0, "a", 1.0), (101.0, "b", 0.1), (102.0, "b", 0.2)):
        pieces.at(what, share)
    pieces.end()
    left = [line.rpartition(", about ")[2] for line in capsys.readouterr().err.splitlines() if "about" in line]
    assert left == ["50 s left", "9 s left", "8 s left"]
