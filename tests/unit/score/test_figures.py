"""The paper's figures: all there, not blank, and every verdict follows from the data."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from sim_ecu.design.brief import Recipe, load_source
from sim_ecu.design.linear import Point
from sim_ecu.design.rules import PAPER_POLYNOMIAL
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score import paper_claims as say
from sim_ecu.score.figure_data import (
    OFF_PEAK,
    SETTLED_S,
    SPEED,
    FloatArray,
    HeldTrace,
    Known,
    Levels,
    gather,
    held,
    nearest,
    observe,
    own_range,
)  # fmt: skip
from sim_ecu.score.figures import check, run, sources
from sim_ecu.score.paper_claims import PaperClaim
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.checksum import checksum
from wrcd.errors import InputError
from wrcd.estimator.design import MODELS, Sets

THREE = Sets(("Low", "Moderate", "High"), np.array([-1.0, 0.0, 1.0]))
TWO = Sets(("Low", "High"), np.array([-1.0, 1.0]))
NUMBERS = (1, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13)
SETS = [THREE, THREE, THREE, TWO]


@pytest.fixture(scope="module")
def subject() -> Recipe:
    return load_source(LONE_DESIGN)


def silent(_what: str, _share: float) -> None:
    pass


def seen_of(residuals: FloatArray) -> FloatArray:
    """What the rules see (…, 4) where the sensors have no noise."""
    logs = np.log10(residuals)
    logs[..., :3] -= logs[..., 3:]
    return logs


def trace(residuals: tuple[float, ...], mu_pct: float = 20.0, wobble: float = 0.0) -> HeldTrace:
    """Constant residuals for 4 s on three tracks; truth 20 %, half-width 1 pp."""
    t: FloatArray = np.arange(1, 201, dtype=np.float64) * 0.02
    r = np.broadcast_to(np.array(residuals), (200, 3, MODELS)).copy()
    flat = np.ones((200, 3))
    wave = wobble * np.sin(t)[:, None]
    seen = seen_of(r)
    places = own_range(SETS, seen)
    return HeldTrace(
        t, r, seen, places, np.argmin(places, axis=-1) + 1, 50 + wave * flat, mu_pct * flat, mu_pct * flat, flat,
        20 * flat, 20 * flat, 0.01 * flat,
    )  # fmt: skip


def verdicts(found: list[PaperClaim]) -> list[bool]:
    return [f.holds for f in found]


@pytest.mark.night
def test_all_figures_are_drawn_and_described(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path / "figures", LONE_DESIGN, tracks=2, seconds=3.0, between=0) == 0
    names = {f"fig{n:02d}{form}.png" for n in NUMBERS for form in ("", "-paper")}
    assert {p.name for p in (tmp_path / "figures").glob("*.png")} == names
    for name in names:
        picture = imread(tmp_path / "figures" / name)[:, :, :3]
        assert picture.shape[1] > 900
        # ink in every quarter, and colours beside the text's black
        quarters = [q for half in np.array_split(picture, 2) for q in np.array_split(half, 2, axis=1)]
        assert all((q < 0.9).any(axis=2).mean() > 0.005 for q in quarters), name
        assert (np.ptp(picture, axis=2) > 0.3).mean() > 0.002, name
    *lines, last = capsys.readouterr().out.splitlines()
    text = (tmp_path / "figures" / "figures.md").read_text()
    ours, beside = lines[::2], lines[1::2]
    assert {int(line[5:8]) for line in ours} == set(NUMBERS)
    for line, other in zip(ours, beside, strict=True):
        figure, verdict, said = line[:8].strip(), line[9:23].strip(), line[24:]
        says, numbers = (part.replace("|", "\\|") for part in said.split(": ", 1))
        there, theirs = other[9:23].strip(), other.split("in the paper's own form: ", 1)[1].replace("|", "\\|")
        assert {verdict, there} <= {"holds", "DOES NOT HOLD"}
        row = f"| {says} | **{verdict}**: {numbers} | **{there}**: {theirs} |\n"
        assert row in text.split(f"## {figure}\n")[1].split("\n## ")[0]
    for name, column in (("wrcd's form", ours), ("the paper's own form", beside)):
        holding = sum(line[9:23].strip() == "holds" for line in column)
        assert f"{name}: {holding} of {len(ours)} statements hold" in last
    assert all(f"]({name})" in text for name in names)


def test_the_forms_are_judged_on_the_same_runs() -> None:
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


def test_a_paper_design_for_another_wheelset_is_not_judged_beside(tmp_path: Path) -> None:
    document = json.loads(PAPER_DESIGN.read_text())
    document["inputs"]["wheelset"]["m_w"] += 1.0
    document["checksum"] = checksum(document)
    other = tmp_path / "other.json"
    other.write_text(json.dumps(document))
    assert list(sources(other, None)) == ["the paper's own form"]  # the packaged one is left out
    with pytest.raises(InputError, match="another wheelset"):
        sources(LONE_DESIGN, other)


def test_figures_check_what_was_gathered(subject: Recipe) -> None:
    """Other data, other verdicts: the checks take nothing from elsewhere."""
    data = gather(subject, 1, 2.5, 0, silent, {})
    before = {(s.figure, s.says): s for s in check(data)}
    flipped = replace(
        data,
        at_peak={k: replace(t, mu_pct=t.mu_pct + 20.0, fuzzy=t.fuzzy + 9 * np.sin(9 * t.t_s)[:, None])
                 for k, t in data.at_peak.items()},
    )  # fmt: skip
    after = {(s.figure, s.says): s for s in check(flipped)}
    assert before.keys() == after.keys()
    for key, s in after.items():
        if key[0] in (11, 12, 13):
            assert not s.holds
            assert s.numbers != before[key].numbers
        else:
            assert s == before[key]


@pytest.mark.parametrize("share", [1.0, *OFF_PEAK, 0.012])
@pytest.mark.parametrize("curve", "AF")
def test_the_wheelset_is_held_where_the_figure_says(subject: Recipe, curve: str, share: float) -> None:
    found = observe(subject, held(subject.wheelset, CURVES[curve], share, 1), 3.0, silent, {}).since(SETTLED_S)
    creep, mu = peak(SPEED, subject.wheelset.contact, *CURVES[curve].row())
    # what the track's irregularity adds counts where there is hardly any creep
    assert found.creep.mean() == pytest.approx(share * creep, rel=0.05, abs=1e-4)
    assert found.truth_pct == pytest.approx(100 * mu, rel=1e-6)
    if share == 1.0:
        assert found.used_pct.mean() == pytest.approx(100 * mu, rel=0.02)


def test_the_place_in_the_own_range_is_what_the_estimator_decides_by(subject: Recipe) -> None:
    found = observe(subject, held(subject.wheelset, CURVES["C"], 1.0, 2), 1.5, silent, {}).since(0.5)
    assert (np.argmin(found.own_range, axis=-1) + 1 == found.winner).all()
    # which is not what the raw residuals say, nor the same for the sensors' noise left in
    for values in (found.residuals, own_range(subject.design.residual_sets, seen_of(found.residuals))):
        assert (np.argmin(values, axis=-1) + 1 != found.winner).any()


def test_lowest_residual_holds_for_most_of_the_time() -> None:
    good = trace((0.2, 0.5, 0.5, 0.5))
    assert verdicts(say.lowest(3, "here", 1, good)) == [True, True]
    assert verdicts(say.lowest(3, "here", 2, good)) == [False, False]
    # lowest in too little of the time
    mixed = replace(good, residuals=good.residuals.copy())
    mixed.residuals[:30, :, 3] = 0.1
    false = say.lowest(3, "here", 1, mixed)[0]
    assert not false.holds
    assert "in 85 % of the estimates" in false.numbers
    assert false.line().startswith("Fig. 3   DOES NOT HOLD  here, the residual of model 1 is the lowest: in 85 %")


def test_increased_residual_holds_only_for_a_larger_one() -> None:
    low, high = trace((0.2, 0.5, 0.5, 0.5)), trace((0.4, 0.5, 0.5, 0.5))
    assert say.increased(4, 1, high, low).holds
    assert not say.increased(4, 1, low, high).holds
    assert not say.increased(4, 1, low, low).holds


def test_right_after_two_seconds() -> None:
    def at(t: HeldTrace) -> list[bool]:
        return verdicts(say.right(11, "A", t, t.since(SETTLED_S)))

    assert at(trace((1, 1, 1, 1), 20.5)) == [True, True, True]
    assert at(trace((1, 1, 1, 1), 20.5, wobble=30)) == [False, True, True]
    assert at(trace((1, 1, 1, 1), 21.5)) == [True, True, False]
    assert at(trace((1, 1, 1, 1), 24.0)) == [True, False, False]
    late = trace((1, 1, 1, 1), 20.5)
    late.mu_pct[:150] = 5.0  # right from 3.02 s on
    assert at(late) == [True, False, False]
    assert "from 3.02 s on" in say.right(11, "A", late, late.since(SETTLED_S))[1].numbers
    unknown = trace((1, 1, 1, 1), 20.5)
    unknown.mu_pct[120] = np.nan
    assert at(unknown)[:2] == [False, False]


def levels(residuals: FloatArray, share: float) -> Levels:
    """Levels whose seen values say the same, in their own ranges, as the residuals."""
    windows = np.broadcast_to(residuals, (4, 3, MODELS)).copy()
    return Levels(share, np.array([3.0, 10.0, 40.0]), windows, np.log10(windows))


def test_levels_of_figure_6_hold_for_matching_models() -> None:
    matching = np.array([[0.9, 0.9, 0.2, 0.9], [0.9, 0.2, 0.9, 0.9], [0.2, 0.9, 0.9, 0.9]])
    saturated, below = levels(matching, 1.0), levels(np.array([[0.9, 0.9, 0.9, 0.2]] * 3), 0.15)
    points = [(saturated, 40.0), (saturated, 10.0), (saturated, 3.0), (below, 30.0)]
    assert verdicts(say.matched(points, SETS)) == [True, True]
    assert verdicts(say.matched([points[1], points[0], *points[2:]], SETS)) == [False, False]
    assert verdicts(say.unsaturated((below,), SETS)) == [True, True]
    assert verdicts(say.unsaturated((below, saturated), SETS)) == [False, False]
    assert say.unsaturated((below, saturated), SETS)[0].numbers == "on 3 of 3 at 0.15, 0 of 3 at 1 of the peak's creep"
    # the residuals and what the rules see are judged apart
    swapped = replace(below, seen=below.seen[..., ::-1])
    assert verdicts(say.unsaturated((swapped,), SETS)) == [True, False]
    assert verdicts(say.matched([*points[:3], (swapped, 30.0)], SETS)) == [True, False]
    # between two levels: the geometric middle of both
    assert saturated.at(20.0)[0] == pytest.approx(np.sqrt(0.9 * 0.2))
    assert 10 ** saturated.seen_at(20.0) == pytest.approx(saturated.at(20.0))
    assert nearest(Point("", CURVES["A"], 0.9, (0.0, 0.0, 0.0)), saturated, below) is saturated


def test_printed_rules_hold_with_three_sets() -> None:
    printed = np.array([[0.1, 0.1, 1.0, 0.1], [0.1, 0.1, 1.0, 0.1], [0.1, 0.1, 10.0, 1.0]])
    as_printed = levels(printed, 1.0), levels(printed, 0.15)
    assert verdicts(say.paper_rules(*as_printed, [THREE] * MODELS)) == [True, True]
    # without a Moderate of its own, residual 4 cannot be Moderate: false, and the numbers say what is nearest
    dry, _ = say.paper_rules(*as_printed, SETS)
    assert not dry.holds
    assert "nearest at 1 of the peak's creep on 40 %: Low, Low, High, " in dry.numbers
    assert "3 of 4 as printed; ours 4 has no Moderate: it lies 0.50 of the way from Low to High" in dry.numbers
    assert say.paper_rules(*as_printed, SETS)[1].holds
    other = np.full((3, MODELS), 0.1)
    assert verdicts(say.paper_rules(levels(other, 1.0), levels(other, 0.15), SETS)) == [False, False]


def test_sets_and_output_polynomial_are_judged() -> None:
    assert say.divided(8, 1, THREE, np.array([-1.0, 0.0, 1.0])).holds
    assert not say.divided(8, 1, THREE, np.array([-1.0, 0.0, 0.0])).holds
    assert not say.divided(8, 1, TWO, np.array([-1.0, 1.0])).holds
    line = np.array([-0.5, 60.0])
    printed = np.array(PAPER_POLYNOMIAL)
    # (16) is a quartic, and below zero at 100
    assert verdicts(say.output_map(np.array([0.0, 100.0]), line, printed)) == [True, False, True, False, False]
    assert verdicts(say.output_map(np.array([5.0, 90.0]), line, printed)) == [False, False, True, False, False]
    beyond = say.output_map(np.array([-20.0, 50.0, 120.0]), line, printed)[0]
    assert beyond.holds
    assert "2 of 3 beyond 0 to 100" in beyond.numbers
    assert not say.output_map(np.array([0.0, 100.0]), np.array([0.5, 10.0]), printed)[2].holds


def test_curves_of_figure_1_are_judged() -> None:
    points = [Point("", CURVES[n], s, (0.0, 0.0, 0.0)) for n, s in (("A", 1.0), ("C", 1.0), ("D", 1.0), ("B", 0.1))]
    slopes, peaks = {"A": (1.0, 1e6), "C": (1.0, 2e5)}, {"A": 0.4, "C": 0.2}
    assert verdicts(say.creep_curves(slopes, peaks, points)) == [True, True, True]
    steep = {"A": (1e5, 1e6), "C": (1.0, 9.9e5)}
    assert verdicts(say.creep_curves(steep, peaks, points[::-1])) == [False, False, False]
    assert say.straight(1, "it is straight", 0.95e6, 1e6).holds
    assert not say.straight(1, "it is straight", 0.5e6, 1e6).holds


def test_missing_folder_or_design_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be made"):
        run(tmp_path / "file" / "figures", LONE_DESIGN)
    with pytest.raises(InputError, match="no such design file"):
        run(tmp_path, tmp_path / "none.json")
