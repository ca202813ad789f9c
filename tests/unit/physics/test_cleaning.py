"""The rail cleaned by the slip of the axles before."""

import numpy as np
import pytest

from sim_ecu.physics.cleaning import CELL_M, CleanedRail, Cleaning
from sim_ecu.physics.contact import CURVES, curve_between, peak
from sim_ecu.physics.rail import rail_at, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import MU_AVAILABLE, MU_USED, FloatArray, Wheelset

W = Wheelset()
CLEANING = Cleaning()
PLACES = [0.0, -2.5, -19.0, -21.5]
PATCH = rail_table([(0.0, CURVES["A"], 0.0, 0.0), (10.0, CURVES["D"], 0.0, 0.0), (60.0, CURVES["A"], 0.0, 0.0)])


def run(cleaning: Cleaning | None, places: list[float] = PLACES, samples: int = 800) -> tuple[FloatArray, FloatArray]:
    """(samples, axles, outputs) and the distances of a train whose four axles brake into leaf film, and lock there."""
    track = Track(QUALITY["good"], 3, behind_m=25.0)
    sim = Simulation(W, [Axle(PATCH, track, p) for p in places], 20.0, cleaning=cleaning)
    out = [sim.step(np.zeros(len(places)), np.full(len(places), 9000.0)) for _ in range(samples)]
    return np.array([s.outputs[0] for s in out]), np.array([s.distance_m[0] for s in out])


def test_energy_moves_a_place_from_contaminated_to_clean_and_never_back() -> None:
    c = Cleaning(energy_kJ_m=8.0, clean_mu_0=0.3)
    energy = np.linspace(0.0, 200.0, 400)
    mu = c.mu_0(np.full(400, 0.06), energy)
    assert mu[0] == 0.06
    assert np.diff(mu).min() > 0.0
    assert mu[-1] == pytest.approx(0.3)
    at_scale = c.mu_0(np.array([0.06]), np.array([8.0]))[0]
    assert np.log(at_scale / 0.06) == pytest.approx((1 - np.exp(-1)) * np.log(0.3 / 0.06))
    assert c.mu_0(np.array([0.3, 0.55]), np.array([50.0, 50.0])).tolist() == [0.3, 0.55]


def test_cleaned_place_has_the_curve_of_the_family() -> None:
    rail = rail_table([(0.0, CURVES["D"], 0.001, 0.02)])
    cleaned = CleanedRail(CLEANING, [rail, rail], [0.0, -2.5])
    cleaned.add(np.array([6.0, 0.0]), 10.0, 11.0)  # 6 kJ/m
    first, second = cleaned.tables(13.0, 0.1)
    assert first is rail
    row = rail_at(second, 10.5)
    mu = float(Cleaning().mu_0(np.array([0.06]), np.array([6.0]))[0])
    assert row[:5] == pytest.approx(curve_between(mu).row())
    assert row[5:7] == pytest.approx([0.001, 0.02])


def test_energy_is_kept_wherever_it_falls() -> None:
    rail = rail_table([(0.0, CURVES["D"], 0.0, 0.0)])
    cleaned = CleanedRail(CLEANING, [rail, rail], [0.0, -2.5])
    rng = np.random.default_rng(1)
    at, total = 0.0, 0.0
    for step in rng.uniform(0.0, 2.0, 2000):
        cleaned.add(np.array([3.0, 5.0]), at, at + step)
        at, total = at + step, total + 8.0
    assert at > 2 * 1024 * CELL_M * 0.9  # beyond what is made at once
    assert float(cleaned._energy_kJ.sum()) == pytest.approx(total)


def test_followers_find_more_on_a_leaf_patch_and_the_first_axle_does_not() -> None:
    dirty, from_m = run(None)
    clean, to_m = run(Cleaning())
    found = []
    for k, place in enumerate(PLACES):
        ours, theirs = (
            np.interp([30.0, 40.0], at + place, out[:, k, MU_AVAILABLE]) for at, out in ((to_m, clean), (from_m, dirty))
        )
        found.append(float((ours / theirs).min()))
    assert found[0] == pytest.approx(1.0, abs=0.01)  # at another speed by then
    assert 1.05 < found[1] < found[2] < found[3]


def test_first_axle_meets_the_rail_as_it_is() -> None:
    out, at = run(Cleaning(), samples=400)
    v = np.diff(at) / 0.005
    for i in (150, 250, 350):
        expected = peak(float(v[i - 1]), W.contact, *rail_at(PATCH, at[i])[:5])[1]
        assert out[i, 0, MU_AVAILABLE] == pytest.approx(expected, rel=0.01)


def test_train_without_slip_cleans_nothing() -> None:
    table = rail_table([(0.0, CURVES["D"], 0.0, 0.0)])
    track = Track(0.0, 3, behind_m=25.0)
    pair = [Simulation(W, [Axle(table, track, p) for p in PLACES], 20.0, cleaning=c) for c in (None, Cleaning())]
    for _ in range(300):
        a, b = (s.step(np.full(4, 500.0), np.zeros(4)) for s in pair)
    assert b.outputs[0, :, MU_AVAILABLE] == pytest.approx(a.outputs[0, :, MU_AVAILABLE], rel=1e-3)
    assert b.outputs[0, :, MU_USED] == pytest.approx(a.outputs[0, :, MU_USED], rel=1e-3)
