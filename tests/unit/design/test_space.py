"""What a search may move: the way from a brief to a vector and back, within its bounds."""

import numpy as np
import pytest

from sim_ecu.design.brief import read_brief, written
from sim_ecu.design.make import Brief, in_papers_form
from sim_ecu.design.space import GROUPS, brief_at, groups_of, parameters, vector
from wrcd.config.settings import parse_toml
from wrcd.errors import InputError


@pytest.mark.parametrize("brief", [Brief(), in_papers_form(Brief())], ids=["wrcd", "paper"])
def test_brief_survives_the_way_to_a_vector_and_back_and_to_a_file(brief: Brief) -> None:
    over = parameters(brief, groups_of(brief.form))
    assert brief_at(brief, over, vector(brief, over)) == brief
    assert read_brief(parse_toml(written(brief, ["a comment"]), "brief.toml")) == brief


def test_paper_form_keeps_equal_weights_and_one_window() -> None:
    papers = in_papers_form(Brief())
    assert groups_of("paper") == ("noise", "points", "window", "rules")
    assert len(parameters(papers, ["noise"])) == 12
    over = parameters(papers, ["noise", "window"])
    found = brief_at(papers, over, vector(papers, over) + 0.5)
    assert {p.yaw_rate_weight for p in found.points} == {1.0}
    assert found.longest_s == found.window_s > papers.window_s


@pytest.mark.parametrize("distance", [-9.0, -0.7, 0.7, 9.0])
def test_any_vector_gives_a_brief_that_a_file_may_hold(distance: float) -> None:
    over = parameters(Brief(), GROUPS)
    rng = np.random.default_rng(4)
    found = brief_at(Brief(), over, vector(Brief(), over) + distance * rng.uniform(0.5, 1.0, len(over)))
    assert found != Brief()
    assert found.recent_s <= found.window_s / 2
    assert found.window_s <= found.longest_s
    assert read_brief(parse_toml(written(found), "brief.toml")) == found


def test_only_the_groups_that_are_asked_for_move() -> None:
    over = parameters(Brief(), ["window"])
    found = brief_at(Brief(), over, vector(Brief(), over) + 0.3)
    assert found.points == Brief().points
    assert (found.window_s, found.band_hz) == (1.23, 14.0)


def test_group_that_is_not_there_is_an_error_that_names_those_that_are() -> None:
    with pytest.raises(InputError, match="noise, weights, points, band, window, rules"):
        parameters(Brief(), ["noises"])


def test_design_points_of_a_file_are_named_after_where_they_are() -> None:
    text = '[design]\ncurves = ["B", "C", "D", "B"]\ncreep_of_peak = [1, 0.5, 1, 0.004]'
    a, b, c, d = read_brief(parse_toml(text, "rig.toml")).points
    assert (a.name, a.curve.name) == ("curve B at its peak", "B")
    assert (b.name, b.creep_of_peak) == ("curve C at 0.5 of its peak's creep", 0.5)
    assert (c, d) == Brief().points[2:]
