"""The paper's figures: all there, not blank, and drawn from what they say."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from sim_ecu.design.brief import Recipe, load_source
from sim_ecu.design.linear import Point
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score.figure_data import LINEAR, SETTLED_S, SPEED, Known, Levels, held, nearest, observe, own_range
from sim_ecu.score.figures import run, sources
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.checksum import checksum
from wrcd.core.design import Sets
from wrcd.core.terms import MODELS
from wrcd.errors import InputError

NUMBERS = (1, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13)


@pytest.fixture(scope="module")
def subject() -> Recipe:
    return load_source(LONE_DESIGN)


def silent(_what: str, _share: float) -> None:
    pass


@pytest.mark.night
def test_all_figures_are_drawn_and_described(tmp_path: Path) -> None:
    assert run(tmp_path / "figures", LONE_DESIGN, tracks=2, seconds=3.0, between=0) == 0
    names = [f"fig{n:02d}{form}.png" for n in NUMBERS for form in ("", "-paper")]
    assert {p.name for p in (tmp_path / "figures").glob("*.png")} == set(names)
    for name in names:
        picture = imread(tmp_path / "figures" / name)[:, :, :3]
        assert picture.shape[1] > 900
        # ink in every quarter, and colours beside the text's black
        quarters = [q for half in np.array_split(picture, 2) for q in np.array_split(half, 2, axis=1)]
        assert all((q < 0.9).any(axis=2).mean() > 0.005 for q in quarters), name
        assert (np.ptp(picture, axis=2) > 0.3).mean() > 0.002, name
    text = (tmp_path / "figures" / "figures.md").read_text()
    shown = [line.partition("](")[2].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert shown == names


def test_the_forms_are_drawn_from_the_same_runs() -> None:
    """A design beside itself in another form's name sees the same signals: nothing is simulated or drawn anew."""
    runs: Known = {}
    ours, papers = (load_source(file) for file in (LONE_DESIGN, PAPER_DESIGN))
    conditions = held(ours.wheelset, CURVES["C"], 1.0, 1)
    first = observe(ours, conditions, 1.0, silent, runs)

    def never(_what: str, _share: float) -> None:
        raise AssertionError("simulated again")

    second = observe(papers, conditions, 1.0, never, runs)
    assert np.array_equal(first.truth_pct, second.truth_pct)
    assert not np.array_equal(first.residuals, second.residuals)


def test_a_paper_design_for_another_wheelset_is_not_drawn_beside(tmp_path: Path) -> None:
    document = json.loads(PAPER_DESIGN.read_text())
    document["inputs"]["wheelset"]["m_w"] += 1.0
    document["checksum"] = checksum(document)
    other = tmp_path / "other.json"
    other.write_text(json.dumps(document))
    assert list(sources(other, None)) == ["the paper's own form"]  # the packaged one is left out
    with pytest.raises(InputError, match="--paper: "):
        sources(LONE_DESIGN, other)


@pytest.mark.parametrize("share", [1.0, 0.3, 0.15, LINEAR, 0.012])
@pytest.mark.parametrize("curve", "AF")
def test_the_wheelset_is_held_where_the_figure_says(subject: Recipe, curve: str, share: float) -> None:
    found = observe(subject, held(subject.wheelset, CURVES[curve], share, 1), 3.0, silent, {}).since(SETTLED_S)
    creep, mu = peak(SPEED, subject.wheelset.contact, *CURVES[curve].row())
    # what the track's irregularity adds counts where there is hardly any creep
    assert found.creep.mean() == pytest.approx(share * creep, rel=0.05, abs=1e-4)
    assert found.truth_pct == pytest.approx(100 * mu, rel=1e-6)
    if share == 1.0:
        assert found.used_pct.mean() == pytest.approx(100 * mu, rel=0.02)


def test_place_in_the_own_range_is_between_the_outer_centres() -> None:
    three = Sets(("Low", "Moderate", "High"), np.array([-1.0, 0.5, 1.0]))
    two = Sets(("Low", "High"), np.array([0.0, 4.0]))
    assert own_range([three, two], np.array([[-1.0, 1.0], [2.0, 4.0]])).tolist() == [[0.0, 0.25], [1.5, 1.0]]


def test_design_point_belongs_to_the_region_with_the_creep_most_like_its_own() -> None:
    saturated, below = (
        Levels(share, np.ones(1), np.ones((1, 1, MODELS)), np.zeros((1, 1, MODELS))) for share in (1.0, 0.15)
    )
    for share, expected in ((0.9, saturated), (0.004, below)):
        assert nearest(Point("", CURVES["A"], share, (0.0, 0.0, 0.0)), saturated, below) is expected


def test_missing_folder_or_design_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="-o: "):
        run(tmp_path / "file" / "figures", LONE_DESIGN)
    with pytest.raises(InputError, match="no such design file"):
        run(tmp_path, tmp_path / "none.json")
