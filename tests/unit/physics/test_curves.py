"""A wheelset on curves: what the sensors read in steady states that can be calculated by hand, and in transitions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import BLEND_M, CURVATURE, CURVATURE_SLOPE, RailSection, rail_at, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import Track
from sim_ecu.physics.wheelset import GRAVITY, LAT_ACCEL, PSI, THETA, YAW_RATE, FloatArray, Wheelset, Y

W = Wheelset()
DRY = CURVES["A"]
TICK_S = 0.005
STRAIGHT = RailSection(0.0, DRY)


def coast(w: Wheelset, sections: list[RailSection], speed: FloatArray) -> tuple[FloatArray, Simulation]:
    """Outputs (t, OUTPUTS) of a wheelset without torque on a smooth track, and where it ends."""
    sim = Simulation(w, [Axle(rail_table(sections), Track(0.0, 1))], float(speed[0]), TICK_S)
    return sim.advance(command(len(speed), torque=0.0, limit_of_peak=1.0), speed).outputs[:, 0], sim


def steady(w: Wheelset, section: RailSection, v: float) -> tuple[float, float, Simulation]:
    """(yaw rate, lateral acceleration) that the sensors end up with, and the simulation there."""
    out, sim = coast(w, [section], np.full(1600, v))
    assert np.ptp(out[-200:, [YAW_RATE, LAT_ACCEL]], axis=0) == pytest.approx([0.0, 0.0], abs=1e-5)
    return float(out[-1, YAW_RATE]), float(out[-1, LAT_ACCEL]), sim


def kalker(w: Wheelset) -> float:
    """Force over creep of one wheel at small creep, N."""
    return (DRY.k_A + DRY.k_S) * 2 / math.pi * w.contact.stiffness_N


@pytest.mark.parametrize(("radius", "cant"), [(5000.0, 0.0), (-5000.0, 0.0), (5000.0, 0.05), (3000.0, 0.0)])
def test_a_steady_curve_as_calculated_by_hand(radius: float, cant: float) -> None:
    """Coasting, the wheels' forces are g a and -g a with a = gamma y / r_0 - L_g k. With (8) and (9) at rest
    k_w psi = -2 g a L_g and 2 g psi + F_c = k_g y, two equations for y and psi."""
    v, k = 25.0, 1 / radius
    yaw_rate, accel, sim = steady(W, RailSection(0.0, DRY, k, cant), v)
    g, uncompensated = kalker(W), v**2 * k - GRAVITY * cant
    F_c, k_g = W.m_w * uncompensated, 2 * W.normal_N * W.gamma / W.L_g
    y = (F_c + 4 * g**2 * W.L_g**2 * k / W.k_w) / (k_g + 4 * g**2 * W.L_g * W.gamma / (W.r_0 * W.k_w))
    psi = (k_g * y - F_c) / (2 * g)
    assert sim.state[0, Y] == pytest.approx(y, rel=0.03)
    assert sim.state[0, PSI] == pytest.approx(psi, rel=0.03)
    # nearly the rolling line: the outer wheel rolls on its larger radius
    assert y == pytest.approx(W.L_g * W.r_0 * k / W.gamma, rel=0.1)
    # counter-clockwise is positive, so a right-hand curve reads negative
    assert yaw_rate == pytest.approx(-v * k, rel=1e-3)
    roll = W.gamma * y / W.L_g
    assert accel == pytest.approx(-uncompensated + GRAVITY * roll, rel=5e-3)


def test_cylinders_feel_the_whole_creep_of_the_curve() -> None:
    """Without conicity nothing makes up for the longer outer rail: creep of -L_g k left and L_g k right, the shaft
    twisted by the left wheel's force, the wheelset turned outwards against its spring."""
    w, k = replace(W, gamma=1e-9), 1 / 20_000
    _, _, sim = steady(w, RailSection(0.0, DRY, k, 25.0**2 * k / GRAVITY), 25.0)
    F_xL = -kalker(w) * w.L_g * k
    assert w.k_s * sim.state[0, THETA] == pytest.approx(w.r_0 * F_xL, rel=0.02)
    assert sim.state[0, PSI] == pytest.approx(-2 * F_xL * w.L_g / w.k_w, rel=0.02)


def test_balanced_cant_leaves_no_lateral_acceleration() -> None:
    v, k = 30.0, 1 / 1000
    flat = steady(W, RailSection(0.0, DRY, k), v)[1]
    canted = steady(W, RailSection(0.0, DRY, k, v**2 * k / GRAVITY), v)
    assert flat == pytest.approx(-(v**2) * k, rel=0.01)
    roll = GRAVITY * W.gamma / W.L_g * canted[2].state[0, Y]
    assert canted[1] == pytest.approx(roll, abs=1e-3)
    assert canted[0] == pytest.approx(-v * k, rel=1e-3)


def test_cant_alone_lets_it_lean_on_the_lower_rail() -> None:
    """On a straight with the left rail up the wheelset sinks to the right, and the sensor's axis feels + g cant."""
    yaw_rate, accel, sim = steady(W, RailSection(0.0, DRY, 0.0, 0.05), 25.0)
    assert sim.state[0, Y] < 0
    assert yaw_rate == pytest.approx(0.0, abs=1e-6)
    assert accel == pytest.approx(GRAVITY * 0.05, rel=0.01)


@pytest.mark.parametrize("ramp", [0.0, 1.5])
def test_wheelset_without_friction_runs_straight_on(ramp: float) -> None:
    """Nothing holds it: it keeps its heading and its line, so both sensors read nothing, while the transition curve
    turns away to the right by k' s^3 / 6. A force or a rate that were counted twice would show here."""
    w = replace(W, gamma=1e-9, k_w=1e-3)
    ice = replace(DRY, mu_0=1e-9)
    k, length = 1 / 600, 130.0
    sections = [RailSection(0.0, ice), RailSection(20.0, ice, k, 0.0, length)]
    out, sim = coast(w, sections, 20.0 + ramp * TICK_S * np.arange(1000.0))
    within = sim.train[1] - 20.0
    assert 75.0 < within < length
    assert np.abs(out[:, YAW_RATE]).max() < 1e-6
    assert np.abs(out[:, LAT_ACCEL]).max() < 1e-6
    assert sim.state[0, PSI] == pytest.approx(k / length * within**2 / 2, rel=1e-3)
    if not ramp:  # else the vehicle takes it along, and the track is not where it heads
        assert sim.state[0, Y] == pytest.approx(k / length * within**3 / 6, rel=1e-3)


@pytest.mark.parametrize("ramp", [0.0, 0.8])
def test_a_transition_curve_is_a_clothoid(ramp: float) -> None:
    """Curvature and cant grow along the distance, whatever the speed; the sensors follow."""
    k, cant = 1 / 900, 0.02
    speed = 20.0 + ramp * TICK_S * np.arange(1600.0)
    out, _ = coast(W, [STRAIGHT, RailSection(60.0, DRY, k, cant, 60.0)], speed)
    # gyro and accelerometer are means over the sample
    middle = np.cumsum(speed) * TICK_S - speed * TICK_S / 2
    share = np.clip((middle - 60.0) / 60.0, 0.0, 1.0)
    uncompensated = share * (speed**2 * k - GRAVITY * cant)
    roll = GRAVITY * W.gamma / W.L_g * share * W.L_g * W.r_0 * k / W.gamma
    assert out[:, YAW_RATE] == pytest.approx(-speed * share * k, abs=5e-4)
    assert out[:, LAT_ACCEL] == pytest.approx(-uncompensated + roll, abs=0.015)


def test_rail_table_is_read() -> None:
    wet = CURVES["C"]
    table = rail_table([STRAIGHT, RailSection(100.0, wet, 0.002, 0.05, 40.0), (200.0, DRY, 0.0, 0.0)])
    assert rail_at(table, 99.0)[:5] == pytest.approx(DRY.row())
    # the film's edge is short, the transition is long
    at_edge = rail_at(table, 100.0 + BLEND_M)
    assert at_edge[:5] == pytest.approx(wet.row())
    assert at_edge[CURVATURE] == pytest.approx(0.002 * BLEND_M / 40.0)
    middle = rail_at(table, 120.0)
    assert middle[5:] == pytest.approx([0.001, 0.025, 0.002 / 40.0])
    assert rail_at(table, 170.0)[5:] == pytest.approx([0.002, 0.05, 0.0])
    assert rail_at(table, 200.25)[CURVATURE_SLOPE] == pytest.approx(-0.002 / BLEND_M)
    assert rail_at(table, 900.0)[5:] == pytest.approx([0.0, 0.0, 0.0])
    assert rail_at(table, -50.0)[:5] == pytest.approx(DRY.row())


def test_a_section_inside_the_transition_before_it_is_refused() -> None:
    with pytest.raises(ValueError, match="130"):
        rail_table([STRAIGHT, RailSection(100.0, DRY, 0.002, 0.0, 40.0), RailSection(130.0, DRY)])
