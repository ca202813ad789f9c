"""The search of the process noise: the method, what it makes small, and the command."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.cli import main
from sim_ecu.design import search
from sim_ecu.design.brief import read_brief
from sim_ecu.design.cases import FloatArray
from sim_ecu.design.cmaes import minimise
from sim_ecu.design.make import POINTS, Brief, in_papers_form
from sim_ecu.design.search import Matching, matching, points_of, vector
from wrcd.errors import InputError
from wrcd.settings import parse_toml, read_toml


def silent(_what: str, _share: float) -> None:
    pass


def nothing(_done: int, _least: float) -> None:
    pass


def long_valley(xs: Sequence[FloatArray]) -> list[float]:
    """A hundred times as steep across as along, turned against the axes; least at 1."""
    n = len(xs[0])
    turn, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(n, n)))
    return [float(np.sum(10.0 ** np.linspace(0, 4, n) * (turn @ (x - 1.0)) ** 2)) for x in xs]


def test_the_search_finds_the_end_of_a_long_valley() -> None:
    start = np.zeros(8)
    best, least = minimise(long_valley, start, 0.5, 3000, 1, nothing)
    assert best == pytest.approx(np.ones(8), abs=1e-3)
    assert least < 1e-5 < long_valley([start])[0]


def test_the_search_keeps_to_its_budget_and_its_seed() -> None:
    seen: list[FloatArray] = []

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        seen.extend(xs)
        return [float("nan") if x[0] > 0.4 else float(x @ x) for x in xs]  # some have no answer

    told: list[tuple[int, float]] = []
    best, least = minimise(scores, np.full(3, 0.3), 0.3, 25, 5, lambda *a: told.append(a))
    assert len(seen) == 25
    assert least == min(float(x @ x) for x in seen if x[0] <= 0.4)
    assert told[0][1] == pytest.approx(0.27)
    assert [d for d, _ in told][-1] == 25
    assert all(a >= b for (_, a), (_, b) in pairwise(told))
    assert np.array_equal(minimise(scores, np.full(3, 0.3), 0.3, 25, 5, nothing)[0], best)


def test_points_survive_the_way_to_a_vector_and_back() -> None:
    ours, papers = Brief(), in_papers_form(Brief())
    assert points_of(ours, vector(ours)) == ours.points
    assert points_of(papers, vector(papers)) == papers.points
    assert len(vector(papers)) == 12  # their weights stay equal
    assert {p.yaw_rate_weight for p in points_of(papers, vector(papers) + 1.0)} == {1.0}


@pytest.fixture(scope="module")
def held() -> Matching:
    with pytest.MonkeyPatch.context() as m:
        m.setattr(search, "HELD_SPEEDS", (25.0,))
        return matching(in_papers_form(Brief()), 2, silent)


def test_the_papers_noise_makes_the_matching_filter_the_lowest(held: Matching) -> None:
    shares = held.shares(held.brief.points)[0]
    assert shares[0] >= 0.9
    assert shares.min() >= 0.5
    assert shares.mean() >= 0.7
    # noise that is made for ratios does not
    assert held.shares(POINTS)[0].min() < 0.1
    assert held.error(held.brief.points) < held.error(POINTS)


def test_a_residual_counts_where_its_model_matches(held: Matching) -> None:
    """Models exchanged: their shares go with the conditions, not with the models' numbers."""
    a, b, *rest = held.brief.points
    mine = held.shares(held.brief.points)[0]
    swapped = held.shares((b, a, *rest))[0]
    assert swapped[0] < 0.5 < mine[0]
    assert swapped[2:] == pytest.approx(mine[2:])


TINY = "[design]\nmax_rules = 6\n[plan]\nspeeds = 2\nper_speed = 8\n"


@pytest.mark.parametrize("form", ["wrcd", "paper"])
def test_the_command_writes_what_a_design_is_made_with(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(search, "HELD_SPEEDS", (25.0,))
    monkeypatch.setattr(search, "HELD_TRACKS", 1)
    monkeypatch.setattr(search, "GRID", 6)  # the file is looked at here, not how good its noise is
    tiny, out, again = (tmp_path / name for name in ("tiny.toml", "noise.toml", "again.toml"))
    tiny.write_text(TINY)
    command = ["design", "--search", "--form", form, "--config", str(tiny), "--budget", "4", "--jobs", "1", "-o"]
    assert main([*command, str(out)]) == 0
    said = capsys.readouterr().out
    text = out.read_text()
    brief = read_brief(read_toml(out))
    start = in_papers_form(Brief()) if form == "paper" else Brief()
    assert brief.form == form
    assert [p.name for p in brief.points] == [p.name for p in start.points]
    before, now = (line for line in text.splitlines() if line.startswith(("# Before: ", "# Now: ")))
    assert now.removeprefix("# Now: ").rstrip(".") in said
    if brief.points == start.points:
        assert before.removeprefix("# Before: ") == now.removeprefix("# Now: ")
    assert main([*command, str(again)]) == 0
    assert again.read_text() == text


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        ("[design]\nnoise = [[1, 1, 1, 1]]", "4 rows"),
        ("[design]\nnoise = 3", "4 rows"),
        ("[design]\nnoise = [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]]", "positive"),
        ("[design]\nnoise = [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 2], [1, 1, 1, 1]]", "below 2"),
        ('[design]\nform = "papers"', "paper"),
        ('[design]\nform = "paper"\npolynomial = "fitted"', "not one of paper"),
        ('[design]\nform = "paper"\nlongest_s = 2.0', "do not grow"),
    ],
)
def test_rig_file_with_a_wrong_value_is_an_error(toml: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_brief(parse_toml(toml, "rig.toml"))


def test_form_on_the_command_line_overrides_the_file() -> None:
    asked = read_brief(parse_toml("[design]\nwindow_s = 2.0", "rig.toml"), "paper")
    assert (asked.form, asked.window_s, asked.longest_s) == ("paper", 2.0, 2.0)
    assert read_brief(parse_toml("", "rig.toml")) == Brief()
    own = replace(Brief(), points=Brief().points)
    assert read_brief(parse_toml('[design]\nform = "paper"', "rig.toml"), "wrcd") == own


def test_a_search_needs_a_candidate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "--search", "--budget", "0", "-o", str(tmp_path / "x.toml")]) == 2
    assert "--budget" in capsys.readouterr().err
