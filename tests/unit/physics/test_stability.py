"""Hunting: the linear system against the same one written down from masses, dampers and springs, and against time."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.stability import hunting_speed_m_s, system_matrix
from sim_ecu.physics.track import Track
from sim_ecu.physics.wheelset import Bogie, FloatArray, Wheelset, Y

DRY = CURVES["A"]
LONE = Wheelset()
BOGIE = Bogie()
UNIT = replace(LONE, M_v=BOGIE.carried_kg(LONE.m_w), bogie=BOGIE)


def springs_and_dampers(v: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M, C, K of y and psi of the leading and the trailing wheelset and of the frame, and y of the half body."""
    b, w = BOGIE, UNIT
    M = np.diag([w.m_w, w.I_w, w.m_w, w.I_w, b.frame_mass_kg, b.frame_yaw_inertia_kg_m2, b.body_mass_kg])
    C, K = np.zeros((7, 7)), np.zeros((7, 7))

    def between(stiffness: float, damping: float, **ends: float) -> None:
        d = np.zeros(7)
        for name, arm in ends.items():
            d[["y1", "psi1", "y2", "psi2", "y_f", "psi_f", "y_b"].index(name)] = arm
        C[:] += damping * np.outer(d, d)
        K[:] += stiffness * np.outer(d, d)

    slope = (DRY.k_A + DRY.k_S) * 2 / math.pi * w.contact.stiffness_N  # dF/dcreep of a wheel at no creep
    for j, s in (("1", b.semi_wheelbase_m), ("2", -b.semi_wheelbase_m)):
        between(b.primary_lateral_N_m, b.primary_lateral_damping_N_s_m, y_f=1.0, psi_f=s, **{f"y{j}": -1.0})
        between(b.primary_yaw_N_m_rad, b.primary_yaw_damping_N_m_s_rad, psi_f=1.0, **{f"psi{j}": -1.0})
        y = 2 * (int(j) - 1)
        psi = y + 1
        C[y, y] += 2 * slope / v
        K[y, psi] -= 2 * slope
        K[y, y] += 2 * w.normal_N * w.gamma / w.L_g
        C[psi, psi] += 2 * slope * w.L_g**2 / v
        K[psi, y] += 2 * slope * w.L_g * w.gamma / w.r_0
    between(b.secondary_lateral_N_m, b.secondary_lateral_damping_N_s_m, y_b=1.0, y_f=-1.0)
    between(b.secondary_yaw_N_m_rad, b.secondary_yaw_damping_N_m_s_rad, psi_f=1.0)
    return M, C, K


def test_the_linear_system_is_that_of_its_springs_and_dampers() -> None:
    M, C, K = springs_and_dampers(40.0)
    right = np.block([[np.zeros((7, 7)), np.eye(7)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    across = [0, 2, 7, 9, 14, 16, 18, 1, 3, 8, 10, 15, 17, 19]  # not the wheels' turning
    matrix = system_matrix(UNIT, DRY, 40.0)[np.ix_(across, across)]
    assert matrix == pytest.approx(right, abs=1e-7 * np.abs(right).max())


@pytest.mark.parametrize(("w", "hunts_m_s"), [(LONE, 108.6), (UNIT, 146.7)], ids=["lone", "multiple-unit"])
def test_hunting_begins_above_60_m_s_on_dry_rail(w: Wheelset, hunts_m_s: float) -> None:
    assert w.gamma == 0.15
    assert hunting_speed_m_s(w, DRY) == pytest.approx(hunts_m_s, abs=0.1)


def test_a_flatter_wheel_hunts_later_and_a_wet_rail_need_not_hunt_at_all() -> None:
    assert hunting_speed_m_s(replace(UNIT, gamma=0.10), DRY) > hunting_speed_m_s(UNIT, DRY) + 30.0
    assert hunting_speed_m_s(UNIT, CURVES["C"]) == math.inf


@pytest.mark.parametrize(("share", "grows"), [(0.93, False), (1.07, True)])
def test_a_disturbance_grows_in_time_where_the_linear_system_says_so(share: float, grows: bool) -> None:
    v = share * hunting_speed_m_s(UNIT, DRY)
    rail, track = rail_table([RailSection(0.0, DRY)]), Track(0.0, 1)
    sim = Simulation(UNIT, [Axle(rail, track, BOGIE.wheelbase_m), Axle(rail, track)], v, step_scale=2.0)
    sim.state[:, Y] = 1e-6
    y = np.empty(400)
    for i in range(len(y)):
        sim.advance(command(1, torque=0.0, axles=2), np.array([v]))
        y[i] = abs(sim.state[0, Y])
    assert (y[-60:].max() > 1.5 * y[60:120].max()) == grows
    assert grows or y[-60:].max() < 0.7 * y[60:120].max()
