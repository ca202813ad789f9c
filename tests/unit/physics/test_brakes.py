"""Wheels that lock, roll again and lose speed; a train that stops and stays."""

from collections.abc import Iterator
from itertools import islice

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import rail_table
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import MU_USED, SLIP, TORQUE, W_L, W_R, FloatArray, Wheelset

W = Wheelset()
FULL = 22_000.0
SAMPLE_S = 0.005
PLACES = (0.0, -2.5, -19.0, -21.5)


def train(curve: str, speed: float, axles: int = 1, scale: float = 1.0) -> Simulation:
    table = rail_table([(0.0, CURVES[curve], 0.0, 0.0)])
    track = Track(QUALITY["good"], 3, behind_m=25.0)
    return Simulation(W, [Axle(table, track, place) for place in PLACES[:axles]], speed, SAMPLE_S, scale)


def braked(sim: Simulation, brake_N_m: float, drive_N_m: float = 0.0) -> Iterator[Samples]:
    n = len(sim.state)
    while True:
        yield sim.step(np.full(n, drive_N_m), np.full(n, brake_N_m))


def wheel(sim: Simulation) -> FloatArray:
    """Circumferential speed of each axle, mean of its wheels."""
    speeds: FloatArray = sim.state[:, [W_R, W_L]].mean(axis=1) * W.r_0
    return speeds


@pytest.mark.parametrize(("curve", "speed"), [("C", 20.0), ("E", 8.0), ("D", 5.0), ("F", 20.0)])
@pytest.mark.parametrize("brake", [FULL, 3 * FULL])
def test_locked_wheel_slips_whole(curve: str, speed: float, brake: float) -> None:
    sim = train(curve, speed)
    list(islice(braked(sim, brake), 300))
    slips = [-float(s.outputs[0, 0, SLIP]) for s in islice(braked(sim, brake), 60)]
    assert sim.train[0] > 1.0
    assert min(slips) > 0.99
    assert max(slips) < 1.01


def test_torque_of_a_locked_wheel_is_what_the_rail_gives() -> None:
    sim = train("D", 20.0)
    out = np.array([s.outputs[0, 0] for s in islice(braked(sim, FULL), 500)])[200:]
    rail = out[:, MU_USED] * 2 * W.normal_N * W.r_0
    assert out[:, TORQUE] == pytest.approx(rail, rel=0.01)
    assert abs(out[:, TORQUE]).max() < 0.2 * FULL


@pytest.mark.parametrize("curve", "EF")
def test_released_wheel_rolls_again(curve: str) -> None:
    sim = train(curve, 15.0)
    list(islice(braked(sim, FULL), 300))
    assert abs(wheel(sim)[0]) < 0.05
    speeds = []
    for s in islice(braked(sim, 0.0), 1600):
        speeds.append(wheel(sim)[0])
        if -s.outputs[0, 0, SLIP] < 1e-3:
            break
    assert -s.outputs[0, 0, SLIP] < 1e-3
    assert np.diff(speeds).min() > -0.01  # it takes speed all the way
    # no sooner than its inertia lets the best friction of the rail turn it
    inertia = (W.I_R + W.I_L) / W.r_0**2
    assert len(speeds) * SAMPLE_S > sim.train[0] * inertia / (CURVES[curve].mu_0 * 2 * W.normal_N)


@pytest.mark.parametrize("curve", "AE")
def test_stopped_train_stays_where_it_is(curve: str) -> None:
    sim = train(curve, 3.0)
    speeds, wheels = [], []
    for s in islice(braked(sim, FULL), 1000):
        speeds.append(float(s.speed_m_s[0]))
        wheels.append(wheel(sim)[0])
        if speeds[-1] < 1e-6:
            break
    assert speeds[-1] < 1e-6
    assert min(speeds) >= 0.0
    assert min(wheels) > -0.05
    stands_m = sim.train[1]
    after = [abs(wheel(sim)[0]) for _ in islice(braked(sim, FULL), 400)]
    assert max(after) < 0.02  # the shaft rings, and is damped
    assert max(after[200:]) < 1e-4  # m/s: the contact gives way to the yaw that is left
    assert sim.train[1] - stands_m < 1e-4
    list(islice(braked(sim, 0.0, 5000.0), 200))  # and it starts again
    assert sim.train[0] > 0.3


def test_brakes_hold_a_train_against_its_drive() -> None:
    sim = train("A", 0.0)
    list(islice(braked(sim, FULL, 10_000.0), 300))
    assert sim.train.tolist() == pytest.approx([0.0, 0.0], abs=1e-2)
    assert abs(wheel(sim)[0]) < 0.02


@pytest.mark.parametrize("curve", "AE")
def test_energy_of_a_stop_is_found_in_slip_brakes_and_resistance(curve: str) -> None:
    sim = train(curve, 12.0)
    stored = [kinetic(sim)]
    found, rail = 0.0, 0.0
    before = wheel(sim)[0]
    for s in islice(braked(sim, FULL), 4000):
        y, v = s.outputs[0, 0], float(s.speed_m_s[0])
        found -= y[TORQUE] * 0.5 * (before + wheel(sim)[0]) / W.r_0 * SAMPLE_S
        rail += abs(y[MU_USED] * 2 * W.normal_N * y[SLIP] * max(v, 1.0)) * SAMPLE_S
        found += (W.resistance_0 + W.resistance_2 * v**2) * min(v / 0.1, 1.0) * v * SAMPLE_S
        before = wheel(sim)[0]
        if v < 1e-3:
            break
    assert found + rail == pytest.approx(stored[0] - kinetic(sim), rel=0.01)
    assert bool(rail > 0.8 * stored[0]) is (curve == "E")  # of the locked wheels, else of the brakes


def kinetic(sim: Simulation) -> float:
    """Of the vehicles' mass and of the wheels, J."""
    x, v = sim.state, float(sim.train[0])
    wheels = W.I_R * x[:, W_R] ** 2 + W.I_L * x[:, W_L] ** 2
    return float(0.5 * (len(x) * W.M_v * v**2 + wheels.sum()))


def test_half_the_step_gives_the_same_stop() -> None:
    """Through locking, locked, and from there to rest, on two axles."""
    runs = []
    for scale in (1.0, 2.0):
        sim = train("E", 10.0, 2, scale)
        samples = list(islice(braked(sim, FULL), 1600))
        out = np.array([s.outputs[0] for s in samples])
        runs.append((sim.train[1], out[:, :, MU_USED].sum() * SAMPLE_S, float(samples[200].speed_m_s[0])))
    assert runs[0] == pytest.approx(runs[1], rel=1e-3)


def test_axles_share_the_speed_of_their_train() -> None:
    """One of four is braked: the others roll with the train, and it takes what the one rail gives."""
    sim = train("E", 15.0, 4)
    brake = np.array([FULL, 0.0, 0.0, 0.0])
    samples = [sim.step(np.zeros(4), brake) for _ in range(400)]
    assert abs(wheel(sim)[0]) < 0.05
    assert wheel(sim)[1:] == pytest.approx([float(sim.train[0])] * 3, rel=1e-3)
    force = sum(s.outputs[0, :, MU_USED].sum() for s in samples) * 2 * W.normal_N * SAMPLE_S
    v = np.array([s.speed_m_s[0] for s in samples])
    resisted = 4 * (W.resistance_0 + W.resistance_2 * v**2).sum() * SAMPLE_S
    assert 4 * W.M_v * (15.0 - v[-1]) == pytest.approx(resisted - force, rel=1e-3)


def test_step_without_a_brake_is_advance() -> None:
    """Over more samples than one piece of track has."""
    a, b = train("C", 20.0, 2), train("C", 20.0, 2)
    for torque in [*np.linspace(0.0, 20_000.0, 450), 0.0]:
        theirs = b.advance(command(1, 2, torque=float(torque), limit_of_peak=1e3), np.array([np.nan]))
        ours = a.step(np.full(2, torque), np.zeros(2))
        assert ours.outputs.tolist() == theirs.outputs.tolist()
    assert a.state.tolist() == b.state.tolist()
    assert a.train.tolist() == b.train.tolist()
