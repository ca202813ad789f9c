"""The search of a design: the method, what it makes small, what it may move, the files that it starts from."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.design import search
from sim_ecu.design.brief import read_brief, written
from sim_ecu.design.cases import FloatArray
from sim_ecu.design.features import Features
from sim_ecu.design.make import POINTS, Brief, bank, in_papers_form, with_placeholder_rules
from sim_ecu.design.search import FitAccuracy, Matching, error_of, matching, minimise, objective
from sim_ecu.design.space import GROUPS, brief_at, groups_of, parameters, vector
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, vehicle_path
from wrcd.config.settings import parse_toml, read_toml
from wrcd.core.terms import COLUMNS
from wrcd.errors import InputError, Status


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
    best, least = minimise(long_valley, start, long_valley([start])[0], 0.5, 3000, 1, nothing)
    assert best == pytest.approx(np.ones(8), abs=1e-3)
    assert least < 1e-5 < long_valley([start])[0]


def test_the_search_keeps_to_its_budget_and_its_seed() -> None:
    seen: list[FloatArray] = []

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        seen.extend(xs)
        return [float("nan") if x[0] > 0.4 else float(x @ x) for x in xs]  # some have no answer

    told: list[tuple[int, float]] = []
    best, least = minimise(scores, np.full(3, 0.3), 0.27, 0.3, 25, 5, lambda *a: told.append(a))
    assert len(seen) == 24  # and the start, which is known
    assert least == min(float(x @ x) for x in seen if x[0] <= 0.4)
    assert told[0][1] == pytest.approx(0.27)
    assert [d for d, _ in told][-1] == 25
    assert all(a >= b for (_, a), (_, b) in pairwise(told))
    assert np.array_equal(minimise(scores, np.full(3, 0.3), 0.27, 0.3, 25, 5, nothing)[0], best)


@pytest.fixture(scope="module")
def held() -> Matching:
    with pytest.MonkeyPatch.context() as m:
        m.setattr(search, "HELD_SPEEDS", (25.0,))
        return matching(in_papers_form(Brief()), 2, silent)


@pytest.mark.night
def test_the_papers_noise_makes_the_matching_filter_the_lowest(held: Matching) -> None:
    shares = held.shares(held.brief.points)[0]
    assert shares[0] >= 0.9
    assert shares.min() >= 0.5
    assert shares.mean() >= 0.7
    # noise that is made for ratios does not
    assert held.shares(POINTS)[0].min() < 0.1
    assert held.error(held.brief) < held.error(replace(held.brief, points=POINTS))


def test_a_residual_counts_where_its_model_matches(held: Matching) -> None:
    """Models exchanged: their shares go with the conditions, not with the models' numbers."""
    a, b, *rest = held.brief.points
    mine = held.shares(held.brief.points)[0]
    swapped = held.shares((b, a, *rest))[0]
    assert swapped[0] < 0.5 < mine[0]
    assert swapped[2:] == pytest.approx(mine[2:])


@pytest.mark.night
def test_accuracy_is_of_conditions_of_the_search_and_infinite_without_a_stable_filter(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    brief = replace(Brief(), max_rules=6, plan=replace(Brief().plan, speeds=2, per_speed=6))
    aim = objective(brief, 1)
    assert isinstance(aim, FitAccuracy)
    assert aim.brief.plan.seed != brief.plan.seed  # those of the design that is made in the end
    errors = error_of(aim, brief), error_of(objective(brief, 2), brief)
    assert errors[0] != errors[1]
    assert all(map(np.isfinite, errors))
    monkeypatch.setattr(search, "GRID", 2)
    assert error_of(aim, brief) == float("inf")  # gains of 3 and 60 m/s make no stable filter between them


def test_parts_of_the_windows_are_numbered_by_conditions_of_their_own() -> None:
    """A fit halves its conditions by their numbers: none of its halves may be empty."""
    condition = np.repeat(np.arange(6), 2)
    every = Features(np.zeros((12, COLUMNS)), np.arange(12.0), condition, np.ones(12, dtype=bool), 1.0)
    rest = search.some(every, condition % search.VALIDATED != 0)
    assert rest.mu_pct.tolist() == [2, 3, 4, 5, 8, 9, 10, 11]
    assert rest.condition.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize(
    ("toml", "says"),
    [
        ("[design]\nnoise = [[1, 1, 1, 1]]", "4 rows"),
        ("[design]\nnoise = 3", "4 rows"),
        ("[design]\nnoise = [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]]", "positive"),
        ("[design]\nnoise = [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 2], [1, 1, 1, 1]]", "below 2"),
        ('[design]\ncurves = ["A", "B", "C"]', "4 letters"),
        ('[design]\ncurves = ["A", "B", "C", "X"]', "4 letters"),
        ("[design]\ncreep_of_peak = [1, 1, 1, 0]", "4 numbers above 0"),
        ("[design]\ncreep_of_peak = [1, 1, 1, true]", "4 numbers above 0"),
        ("[design]\nband_hz = 50", "band_hz"),
        ('[design]\nform = "papers"', "paper"),
        ('[design]\nform = "paper"\npolynomial = "fitted"', "not one of paper"),
        ('[design]\nform = "paper"\nlongest_s = 2.0', "do not grow"),
        ("[design]\ntick_s = 0.02\nwindow_s = 0.5\nlongest_s = 0.6", "longest_s: must be 0.96 or more"),
    ],
)
def test_rig_file_with_a_wrong_value_is_an_error(toml: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        read_brief(parse_toml(toml, "rig.toml"))


def test_form_on_the_command_line_overrides_the_file() -> None:
    asked = read_brief(parse_toml("[design]\nwindow_s = 2.0", "rig.toml"), "paper")
    assert (asked.form, asked.window_s, asked.longest_s) == ("paper", 2.0, 2.0)
    own = read_brief(read_toml(vehicle_path(DEFAULT_VEHICLE)))
    assert read_brief(parse_toml("", "rig.toml")) == own
    assert read_brief(parse_toml('[design]\nform = "paper"', "rig.toml"), "wrcd") == own


def test_bogie_takes_what_its_file_leaves_out_from_the_default_vehicle_and_a_lone_wheelset_does_not() -> None:
    own = read_brief(read_toml(vehicle_path(DEFAULT_VEHICLE)))
    soft = read_brief(parse_toml("[vehicle]\nprimary_yaw_N_m_rad = 3e6\n[plan]\nown_weight = 1.5", "rig.toml"))
    assert (soft.points, soft.band_hz) == (own.points, own.band_hz)
    assert soft.plan == replace(own.plan, own_weight=1.5)
    assert read_brief(parse_toml('vehicle = "lone-wheelset"', "rig.toml")).points == POINTS


CALIBRATED = """
[wheelset]
gamma = 0.13
[origin]
date = "2026-11-29"
logs = ["aa", "bb"]
stretches = 20
"""


def test_design_of_a_calibrated_vehicle_says_when_and_with_what_constants() -> None:
    brief = read_brief(parse_toml(CALIBRATED, "rig.toml"))
    document = bank(replace(brief, grid=2))
    assert document["inputs"]["origin"] == {"date": "2026-11-29", "logs": ["aa", "bb"], "stretches": 20}
    worlds = with_placeholder_rules(document).worlds
    at = worlds.index("calibrated 2026-11-29 from 2 logs:")
    said = " ".join(worlds[at:])
    assert "primary_yaw_N_m_rad 5e+06" in said
    assert "gamma 0.13" in said
    assert read_brief(parse_toml(written(brief), "brief.toml")) == brief
    assert not [w for w in bank(Brief(grid=2))["worlds"] if w.startswith("calibrated")]


@pytest.mark.parametrize("origin", ["origin = 3", '[origin]\nlogs = "aa"', "[origin]\ndate = 2026-11-29"])
def test_origin_that_is_none_is_an_error(origin: str) -> None:
    with pytest.raises(InputError, match=r"origin(\.\w+)?: takes a "):
        read_brief(parse_toml(origin, "rig.toml"))


def test_vehicle_that_no_filter_can_follow_is_an_error_of_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def has_none(*_: object) -> None:
        raise np.linalg.LinAlgError("no steady gain")

    monkeypatch.setattr("sim_ecu.design.make.steady_state", has_none)
    assert main(["design", "-o", str(tmp_path / "a.json")]) == Status.BAD_INPUT
    said = capsys.readouterr().err
    assert re.search(r"vehicle: makes no bank of filters: no steady gain — .+\n$", said)
    assert said.count("\n") == 1


@pytest.mark.parametrize("brief", [Brief(), in_papers_form(Brief())], ids=["wrcd", "paper"])
def test_brief_survives_the_way_to_a_vector_and_back_and_to_a_file(brief: Brief) -> None:
    over = parameters(brief, groups_of(brief.form))
    assert brief_at(brief, over, vector(brief, over)) == brief
    assert read_brief(parse_toml(written(brief, ["a comment"]), "brief.toml")) == brief


def test_paper_form_keeps_equal_weights_and_one_window() -> None:
    papers = in_papers_form(Brief())
    assert groups_of("paper") == ("noise", "points")
    assert len(parameters(papers, ["noise"])) == 12
    over = parameters(papers, ["noise"])
    found = brief_at(papers, over, vector(papers, over) + 0.5)
    assert {p.yaw_rate_weight for p in found.points} == {1.0}


@pytest.mark.parametrize("distance", [-9.0, -0.7, 0.7, 9.0])
def test_any_vector_gives_a_brief_that_a_file_may_hold(distance: float) -> None:
    over = parameters(Brief(), GROUPS)
    rng = np.random.default_rng(4)
    found = brief_at(Brief(), over, vector(Brief(), over) + distance * rng.uniform(0.5, 1.0, len(over)))
    assert found != Brief()
    assert read_brief(parse_toml(written(found), "brief.toml")) == found


def test_only_the_groups_that_are_asked_for_move() -> None:
    over = parameters(Brief(), ["band"])
    found = brief_at(Brief(), over, vector(Brief(), over) + 0.3)
    assert found == replace(Brief(), band_hz=17.2)


def test_group_that_is_not_there_is_an_error_that_names_those_that_are() -> None:
    with pytest.raises(InputError, match=r"--search: .*noise, weights, points, band"):
        parameters(Brief(), ["noises"])


def test_design_points_of_a_file_are_named_after_where_they_are() -> None:
    text = 'vehicle = "lone-wheelset"\n[design]\ncurves = ["B", "C", "D", "B"]\ncreep_of_peak = [1, 0.5, 1, 0.004]'
    a, b, c, d = read_brief(parse_toml(text, "rig.toml")).points
    assert (a.name, a.curve.name) == ("curve B at its peak", "B")
    assert (b.name, b.creep_of_peak) == ("curve C at 0.5 of its peak's creep", 0.5)
    assert (c, d) == Brief().points[2:]


SMALL = """
vehicle = "lone-wheelset"
[design]
form = "paper"
grid = 6
[plan]
seed = 3
speeds = 2
per_speed = 2
"""


@pytest.mark.usefixtures("jobs_here")
@pytest.mark.night
def test_search_writes_a_brief_that_is_no_worse_than_its_start_and_the_same_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in (("HELD_TRACKS", 1), ("HELD_SPEEDS", (15.0,)), ("HELD_OFF_PEAK", (0.05,))):
        monkeypatch.setattr(search, name, value)
    (tmp_path / "rig.toml").write_text(SMALL)
    start = read_brief(parse_toml(SMALL, "rig.toml"))
    found = []
    for name in ("a.toml", "b.toml"):
        command = ["design", "--config", str(tmp_path / "rig.toml"), "--search", "noise, points", "--budget", "3"]
        assert main([*command, "-o", str(tmp_path / name)]) == 0
        found.append((tmp_path / name).read_text())
    assert found[0] == found[1]
    best = read_brief(parse_toml(found[0], "a.toml"))
    least, first = (float(x) for x in re.findall(r"(\d\.\d{4})", capsys.readouterr().out.splitlines()[0])[-2:])
    aim = objective(start, start.plan.seed)
    assert error_of(aim, best) == pytest.approx(least, abs=1e-4)
    assert error_of(aim, start) == pytest.approx(first, abs=1e-4)
    assert least <= first
    assert replace(best, points=start.points) == start
