"""Sanders and sanded rail: what comes to the rail, who meets it, and what it is worth."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.physics.contact import CURVES, curve_between
from sim_ecu.physics.rail import rail_at, rail_table
from sim_ecu.physics.sanding import AHEAD_M, Sand, Sander, SanderState
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.treated_rail import TreatedRail
from sim_ecu.physics.wheelset import MU_AVAILABLE, FloatArray, Wheelset

SAND = Sand()
LOW = rail_table([(0.0, CURVES["F"], 0.001, 0.02)])
PLACES = [0.0, -2.5, -19.0, -21.5]
STEP_S = 0.005


def laid(state: SanderState, kg_min: float, steps: int) -> list[float]:
    return [state.step(kg_min) for _ in range(steps)]


def test_sand_comes_after_the_delay_at_no_more_than_the_most_and_ends_as_late() -> None:
    state = SanderState(Sander(max_kg_min=2.0, delay_s=0.5), STEP_S)
    on, off = laid(state, 9.0, 200), laid(state, 0.0, 200)
    assert not any(on[:100])
    assert on[100:] + off[:100] == pytest.approx([2.0 / 60.0 * STEP_S] * 200)
    assert not any(off[100:])


def test_hopper_that_is_used_up_lays_none() -> None:
    state = SanderState(Sander(delay_s=0.0, stock_kg=0.001), STEP_S)
    sand = laid(state, 2.0, 100)
    assert sum(sand) == pytest.approx(0.001)
    assert state.left_kg == pytest.approx(0.0, abs=1e-12)
    assert not any(sand[50:])


def mu_under(axle: int, by: list[float], places: list[float] = PLACES) -> float:
    """mu_0 that an axle meets in the middle of ten metres with so much sand (g/m) by each sander."""
    rail = TreatedRail([SAND], [LOW] * len(places), places)
    for j, density in enumerate(by):
        from_m = 95.0 - places[j] - AHEAD_M
        one = np.zeros(len(places))
        one[j] = 10.0 * density
        rail.add(SAND, one, from_m, from_m + 10.0)
    table = rail.tables(100.0 - places[axle], 0.1)[axle]
    return float(rail_at(table, 100.0)[0])


def test_sand_moves_a_place_to_the_sanded_rail_and_its_curve_is_of_the_family() -> None:
    mu = mu_under(0, [SAND.sand_g_m, 0, 0, 0])
    assert np.log(mu / 0.03) == pytest.approx((1 - np.exp(-1)) * np.log(SAND.sanded_mu_0 / 0.03))
    assert mu_under(0, [50.0, 0, 0, 0]) == pytest.approx(SAND.sanded_mu_0)
    rail = TreatedRail([SAND], [LOW], [0.0])
    rail.add(SAND, np.array([3.0]), 9.5, 11.0)
    table = rail.tables(10.75, 0.1)[0]
    row = rail_at(table, 10.75)
    assert rail_at(table, 11.25)[0] == pytest.approx(row[0])  # it falls half a metre ahead of the axle
    assert rail_at(table, 9.75)[0] == pytest.approx(0.03)
    assert row[:5] == pytest.approx(curve_between(float(row[0])).row())
    assert row[5:7] == pytest.approx([0.001, 0.02])


def test_each_axle_over_the_sand_leaves_less_and_those_ahead_find_none() -> None:
    found = [mu_under(k, [0, 2.0, 0, 0]) for k in range(4)]
    assert found[0] == 0.03
    share = [float(np.log(mu / 0.03) / np.log(SAND.sanded_mu_0 / 0.03)) for mu in found[1:]]
    assert share == pytest.approx([1 - np.exp(-2.0 * SAND.kept**n / SAND.sand_g_m) for n in range(3)])


def test_sand_of_a_second_sander_is_added_to_what_is_left_of_the_first() -> None:
    both = mu_under(2, [2.0, 0, 1.0, 0])
    one = mu_under(2, [0, 0, 2.0 * SAND.kept**2 + 1.0, 0])
    assert both == pytest.approx(one)


def test_better_rail_stays_as_it_is_under_sand() -> None:
    mu = SAND.mu_0(np.array([SAND.sanded_mu_0, 0.42]), np.array([9.0, 9.0]))
    assert mu.tolist() == [SAND.sanded_mu_0, 0.42]


def stop(cleaning: Cleaning | None, sand: Sand | None, by: FloatArray | None, samples: int = 500) -> FloatArray:
    """Available adhesion (axles,) after full brakes on a low rail; by: sand in each sample, ahead of each axle."""
    track = Track(QUALITY["good"], 3, behind_m=25.0)
    sim = Simulation(Wheelset(), [Axle(LOW, track, p) for p in PLACES], 20.0, cleaning=cleaning, sand=sand)
    for _ in range(samples):
        s = sim.step(np.zeros(4), np.full(4, 9000.0), by)
    out: FloatArray = s.outputs[0, :, MU_AVAILABLE].copy()
    return out


def test_axle_behind_a_sander_has_more_and_the_next_ones_less_of_it() -> None:
    kg = 2.0 / 60.0 * STEP_S
    bare, sanded = stop(None, None, None), stop(None, SAND, np.array([0.0, kg, 0.0, 0.0]))
    assert sanded[0] == pytest.approx(bare[0], rel=0.1)  # at another speed by then
    assert (sanded > 2.0 * bare).tolist() == [False, True, True, True]
    assert sanded[1] > sanded[2] > sanded[3]


def test_train_without_sand_on_the_rail_runs_as_one_without_sanders() -> None:
    assert stop(None, SAND, np.zeros(4), 100) == pytest.approx(stop(None, None, None, 100), rel=1e-3)


def test_cleaning_and_sand_act_both() -> None:
    """A dirty rail, ten kJ/m by the first axle, then sand by the second one's sander."""
    cleaning = Cleaning()
    rail = TreatedRail([cleaning, SAND], [LOW, LOW], [0.0, -2.5])
    rail.add(cleaning, np.array([100.0, 0.0]), 95.0, 105.0)
    rail.add(SAND, np.array([0.0, 10.0]), 97.5 - AHEAD_M, 107.5 - AHEAD_M)
    first, second = rail.tables(100.0, 0.1)[0], rail.tables(102.5, 0.1)[1]
    assert first is LOW
    cleaned = cleaning.mu_0(np.array([0.03]), np.array([10.0]))
    assert rail_at(second, 100.0)[0] == pytest.approx(float(SAND.mu_0(cleaned, np.array([1.0]))[0]))
    assert rail_at(second, 100.0)[0] > cleaned[0]


def test_published_stop_of_four_cars_is_met_with_one_sander() -> None:
    """T1107: 55 mph, 0.9 m/s2 demanded, 0.02; about 800 m with one sander at axle 3 of 16, more than 1200 without."""

    def stop_m(sand: Sand, kg_min: float) -> float:
        v, way_m = 24.6, 0.0
        while v > 0.5:
            density = kg_min * 1e3 / 60.0 / v
            grams = np.array([0.0] * 2 + [density * sand.kept**n for n in range(14)])
            mu = sand.mu_0(np.full(16, 0.02), grams)
            slows = float(np.minimum(0.9 * 9.81 * mu, 0.9).mean())
            way_m, v = way_m + 0.1 * v, v - 0.1 * slows
        return way_m

    assert stop_m(SAND, 0.0) > 1200.0
    assert stop_m(SAND, 2.0) == pytest.approx(860.0, rel=0.02)
    assert stop_m(replace(SAND, kept=0.5), 2.0) > 1100.0
