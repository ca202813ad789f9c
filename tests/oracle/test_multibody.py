"""The rig's bogie against the same one in a multibody code of others."""

import math

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import SPACING_M, Track
from sim_ecu.physics.wheelset import Bogie, Wheelset
from tests.oracle.multibody import Ride, ride

BOGIE = Bogie()
W = Wheelset(M_v=BOGIE.carried_kg(Wheelset().m_w), bogie=BOGIE)
SAMPLES, SAMPLE_S = 400, 0.005
# The irregularity: length (m), amplitude (m), phase. No flange comes to the rail: their model has none.
WAVES = ((4.0, 1.0e-3, 0.3), (9.0, 1.0e-3, 1.1), (17.0, 1.2e-3, 2.0), (40.0, 1.5e-3, 0.7))
# Of each one's largest value. Their bodies turn by angles, where the rig's equations are linear in them: at 2 mrad that
# is the difference left.
AGREE = 1e-6


def y_t(x_m: float) -> float:
    return math.fsum(a * math.sin(2 * math.pi * x_m / length + phase) for length, a, phase in WAVES)


def waves(end_m: float) -> Track:
    """The same as nodes for the rig."""
    track = Track(0.0, 1)
    x = np.arange(0.0, end_m, SPACING_M)
    nodes = np.zeros((len(x), track.nodes.shape[1]))
    for length, a, phase in WAVES:
        turn = 2 * math.pi / length
        nodes[:, 0] += a * np.sin(turn * x + phase)
        nodes[:, 1] += a * turn * np.cos(turn * x + phase)
    track.nodes = nodes
    return track


def rigs(curve: str, speed_m_s: float, torque_N_m: float) -> Ride:
    """The rig's own ride, in steps so short that halving them changes nothing that is compared here."""
    rail = rail_table([RailSection(0.0, CURVES[curve])])
    track = waves(speed_m_s * SAMPLES * SAMPLE_S + 50.0)
    sim = Simulation(W, [Axle(rail, track, BOGIE.wheelbase_m), Axle(rail, track)], speed_m_s, SAMPLE_S, step_scale=4.0)
    one = command(1, torque=torque_N_m, limit_of_peak=50.0, axles=2)
    wheelsets, vehicle = np.empty((SAMPLES, 2, 7)), np.empty((SAMPLES, 6))
    for i in range(SAMPLES):
        sim.advance(one, np.array([speed_m_s]))
        wheelsets[i], vehicle[i] = sim.state, sim.bogies[0]
    return Ride(wheelsets, vehicle)


@pytest.mark.parametrize(
    ("curve", "speed_m_s", "use"), [("A", 25.0, 0.3), ("A", 12.0, 0.3), ("C", 25.0, 0.8), ("C", 12.0, 0.8)]
)
def test_a_bogie_moves_as_in_a_multibody_code_of_others(curve: str, speed_m_s: float, use: float) -> None:
    mu = peak(speed_m_s, W.contact, *CURVES[curve].row())[1]
    torque_N_m = use * mu * 2 * W.normal_N * W.r_0
    steps = 10 if (curve, speed_m_s) != ("A", 12.0) else 20  # the contact is the stiffer the steeper and the slower
    theirs = ride(W, BOGIE, CURVES[curve], speed_m_s, torque_N_m, y_t, SAMPLES, SAMPLE_S, steps)
    ours = rigs(curve, speed_m_s, torque_N_m)
    for name in ("wheelsets", "vehicle"):
        a, b = getattr(ours, name), getattr(theirs, name)
        assert np.max(np.abs(a - b).max(0) / np.abs(b).max(0)) < AGREE
    # all of it moves, or this would prove nothing
    assert (np.abs(theirs.vehicle).max(0) > [1e-3, 3e-3, 1e-4, 2e-3, 1e-3, 2e-3]).all()
    assert (np.abs(theirs.wheelsets[:, :, :4]).max(0) > [1e-3, 2e-3, 3e-4, 2e-2]).all()
