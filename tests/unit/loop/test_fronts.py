"""Fronts: envelope and reading on points made by hand, what a comparison says, and a rail from end to end."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.cli.main import main
from sim_ecu.loop import CREEP, LAWS, THRESHOLDS, WITH
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.fronts import front_rides, run_fronts
from sim_ecu.loop.fronts.front_figures import DISTANCE, ENERGY, compare, envelope, read_off
from sim_ecu.loop.fronts.front_rides import FrontRide, FrontWork, drive, law_at, play_one, tuned
from sim_ecu.loop.fronts.front_sentences import UNTOLD, says, verdict
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.loop_rides import controlled
from sim_ecu.loop.ride_figures import judge
from sim_ecu.loop.suites.rails import GREASY_STOP
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED, LoopCase
from sim_ecu.reporting.values import Figure
from tests.support.short_row import slowly

SHORT = LoopCase("fronts", "short", slowly)
FEW = {THRESHOLDS: (0.5, 1.0), CREEP: (0.012, 0.029)}
WORDS = ("less", "more")


def front(points: list[tuple[float, float]], runs: int = 6, spread: float = 0.02) -> np.ndarray:
    """Runs (points, runs, 2) about medians; a run is as much longer in every point."""
    rng = np.random.default_rng(3)
    factors = 1.0 + spread * (rng.permutation(runs) - (runs - 1) / 2) / runs
    return np.array(points)[:, None] * np.stack((np.ones(runs), factors), axis=1)


def test_envelope_leaves_out_what_another_point_betters_in_both() -> None:
    points = np.array([[100, 40], [90, 60], [95, 70], [110, 40], [120, 20], [math.inf, 10], [100, 45]], float)
    assert envelope(points).tolist() == [[90, 60], [100, 40], [120, 20]]
    assert envelope(points[5:6]).tolist() == []
    assert envelope(points[:1]).tolist() == [[100, 40]]


def test_front_is_read_on_the_lines_between_its_points() -> None:
    found = envelope(np.array([[90.0, 60.0], [100.0, 40.0], [120.0, 20.0]]))
    assert read_off(found, np.array([90.0, 95.0, 110.0]), DISTANCE).tolist() == [60.0, 50.0, 30.0]
    assert read_off(found, np.array([20.0, 30.0, 50.0]), ENERGY).tolist() == [120.0, 110.0, 95.0]


def test_front_of_half_the_energy_is_half_at_equal_distance_and_says_so() -> None:
    bare = front([(90, 60), (100, 40), (120, 20)])
    half = bare * [1.0, 0.5]
    c = compare(half, bare)
    assert c.energy.mean.value == pytest.approx(0.5)
    assert (c.energy.at[0], c.energy.at[-1]) == pytest.approx((90.0, 120.0))
    assert c.energy.ratio == pytest.approx([0.5] * len(c.energy.at))
    assert c.energy.mean.high < 0.51  # the runs are drawn together: what they have in common is no chance
    assert c.distance.at[0] == pytest.approx(20.0)  # only the energies that the other reaches
    assert c.distance.at[-1] == pytest.approx(30.0)
    assert c.distance.mean.value < 1.0
    assert "at equal distance the energy with wrcd is 0.50 (0.50–0.50) of the bare front's: less;" in says("creep", c)


def test_points_on_the_same_front_show_no_difference() -> None:
    line = [(90.0, 60.0), (100.0, 50.0), (110.0, 40.0), (120.0, 30.0)]
    noise = np.random.default_rng(5).uniform(0.8, 1.25, (2, 8, 1))
    bare, own = (front(part, runs=8) * n for part, n in zip((line, line[1:]), noise, strict=True))
    c = compare(own, bare)
    assert c.energy.mean.low < 1.0 < c.energy.mean.high
    assert says("thresholds", c).startswith("Thresholds: at equal distance the energy with wrcd is ")
    assert "no difference shown" in says("thresholds", c)


def test_front_beyond_the_others_end_is_read_against_its_last_point() -> None:
    c = compare(front([(130.0, 20.0), (140.0, 10.0)]), front([(90.0, 60.0), (100.0, 40.0)]))
    assert c.energy.ratio[0] == pytest.approx(0.5)  # the stop of 100 m is within 130 m, too
    assert c.energy.ratio[-1] == pytest.approx(0.25)
    assert math.isnan(c.distance.mean.value)
    assert "no stop without wrcd has so little energy (40.0 to 60.0 kJ without, 10.0 to 20.0 kJ with)" in says(
        "creep", c
    )


def test_front_of_shorter_stops_than_the_others_has_none_at_equal_distance() -> None:
    c = compare(front([(80.0, 70.0)]), front([(90.0, 60.0), (100.0, 40.0)]))
    assert "no stop without wrcd is so short (90.0 to 100.0 m without, 80.0 m with)" in says("creep", c)
    assert c.distance.mean.value == pytest.approx(80 / 90)


def test_one_point_is_read_against_a_front_at_its_own_distance() -> None:
    told = compare(front([(110.0, 45.0)]), front([(90, 60), (100, 40), (120, 20)]))
    assert told.energy.mean.value == pytest.approx(1.5)
    assert (told.energy.at[0], told.energy.at[-1]) == pytest.approx((110.0, 110.0))


@pytest.mark.parametrize(
    ("figure", "expected"),
    [
        (Figure(0.9, 0.85, 0.99, 6, 6), "less"),
        (Figure(1.1, 1.01, 1.2, 6, 6), "more"),
        (Figure(0.9, 0.8, 1.05, 6, 6), "no difference shown"),
        (Figure(0.9, math.nan, math.nan, 3, 3), UNTOLD),
        (Figure(math.nan, math.nan, math.nan, 6, 6), UNTOLD),
    ],
)
def test_verdict_is_what_the_interval_leaves(figure: Figure, expected: str) -> None:
    assert verdict(figure, WORDS) == expected


@pytest.mark.parametrize("law", LAWS)
def test_tuned_set_point_is_the_law_as_it_is(law: str) -> None:
    assert tuned(law) in front_rides.SET_POINTS[law]
    made, _ = controlled(SHORT.scenario(0), law)
    assert isinstance(made, SlipController)
    assert vars(law_at(law, tuned(law))) == vars(made.axles[0].law)


@pytest.mark.parametrize("controller", [CREEP, WITH[CREEP]])
def test_set_point_that_is_set_at_the_demand_drives_as_one_from_the_start(controller: str) -> None:
    scenario = front_rides.CASES["greasy"].scenario(0)
    scenario = replace(scenario, train=replace(scenario.train, duration_s=5.5))
    found = {x: judge(steps, scenario) for x, steps in drive(scenario, CREEP, controller)}
    made, config = controlled(scenario, controller)
    assert isinstance(made, SlipController)
    made.axles[0].law = law_at(CREEP, 0.012)
    assert found[0.012] == judge(list(Lockstep(scenario, made, config)), scenario)
    assert found[0.012] != found[0.04]


def test_runs_are_those_of_the_loop() -> None:
    assert front_rides.CASES["greasy"].name == GREASY_STOP


def play_shortly(work: FrontWork) -> list[FrontRide]:
    """In place of `play_one`, in the processes that drive it, too."""
    front_rides.CASES[work.rail] = SHORT
    front_rides.SET_POINTS.update(FEW)
    return play_one(work)


def test_command_prints_every_front_and_makes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, page = tmp_path / "fronts.json", tmp_path / "fronts.html"
    with pytest.MonkeyPatch.context() as patch:
        for law, some in FEW.items():
            patch.setitem(front_rides.SET_POINTS, law, some)
        patch.setattr(run_fronts, "play_one", play_shortly)
        arguments = ["--rail", "greasy", "--seeds", "1", "--jobs", "1", "--json", str(out), "--html", str(page)]
        assert main(["fronts", *arguments]) == 0
    printed = capsys.readouterr().out
    for name in ("fronts", "told", "points"):
        assert f"\n**{name}**: " in printed
    assert printed.count(UNTOLD) >= len(LAWS)  # one seed shows nothing
    found: dict[str, Any] = json.loads(out.read_text())
    rows = found["runs"]
    assert len(rows) == sum(2 * len(some) + len(front_rides.TOLD_PCT) for some in FEW.values())
    assert {r["seed"] for r in rows} == {FIRST_TEST_SEED}
    assert all(r["stopped"] for r in rows)
    text = page.read_text()
    assert text.count("<figure>") == 1
    assert "http" not in text.replace("http-equiv", "")


def test_bad_argument_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fronts", "--seeds", "0"]) == 2
    assert "--seeds" in capsys.readouterr().err
