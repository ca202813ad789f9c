"""Forces and energy of the wheelset against its equations, written down a second time."""

import math

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES, traction_ratio
from sim_ecu.physics.rail import RailSection, rail_at, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, Track, irregularity
from sim_ecu.physics.wheelset import (
    GRAVITY,
    PSI,
    PSIDOT,
    THETA,
    W_L,
    W_R,
    YDOT,
    FloatArray,
    Wheelset,
    Y,
    axle_derivatives,
    constants,
)

W = Wheelset()
SAMPLE_S = 5e-4


def creepages(x: FloatArray, v: float, y_t: float, k: float) -> FloatArray:
    """lambda_xL, lambda_xR, lambda_y: (1)-(3), the yaw rate being that of the wheelset in space."""
    a = W.L_g * (x[PSIDOT] - v * k) / v + W.gamma * (x[Y] - y_t) / W.r_0
    return np.array([(W.r_0 * x[W_L] - v) / v + a, (W.r_0 * x[W_R] - v) / v - a, x[YDOT] / v - x[PSI]])


def forces(lam: FloatArray, v: float, curve: FloatArray) -> FloatArray:
    """F_xL, F_xR, F_yL, F_yR: (4)-(6), each wheel's force over its own creepage."""
    total = np.hypot(lam[:2], lam[2])
    F = np.array([W.normal_N * traction_ratio(t, v, W.contact, *curve[:5]) for t in total])
    return np.concatenate([F * lam[:2] / total, F * lam[2] / total])


def states(seed: int, n: int = 50) -> FloatArray:
    """States of a wheelset that slips and steers somehow, the two wheels not alike."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((n, 7)) * [5e-3, 0.05, 3e-3, 0.1, 0.0, 0.0, 2e-3]
    x[:, [W_R, W_L]] = 25.0 / W.r_0 * (1 + rng.uniform(-0.05, 0.05, (n, 2)))
    return x


@pytest.mark.parametrize("curve", "ACF")
def test_equations_7_to_12(curve: str) -> None:
    """(7)-(12) written down again: the moment of (8) is the right force less the left one, as printed."""
    row = np.array([*CURVES[curve].row(), 1 / 700, 0.04, 0.0])
    v, torque, y_t = 25.0, 9000.0, 1e-3
    for x in states(1):
        F_xL, F_xR, F_yL, F_yR = forces(creepages(x, v, y_t, row[5]), v, row)
        T_s = W.k_s * x[THETA] + W.C_s * (x[W_R] - x[W_L])
        F_c = W.m_w * (v**2 * row[5] - GRAVITY * row[6])
        F_g = -2 * W.normal_N * W.gamma / W.L_g * (x[Y] - y_t)
        d = np.zeros(7)
        pull, accel = axle_derivatives(x, v, y_t, torque, row, constants(W), W.contact, d)
        assert pull == pytest.approx(F_xR + F_xL)
        assert W.I_w * d[PSIDOT] == pytest.approx((F_xR - F_xL) * W.L_g - W.k_w * x[PSI])
        assert W.m_w * d[YDOT] == pytest.approx(-F_yL - F_yR + F_c + F_g, abs=1e-6)
        assert W.I_R * d[W_R] == pytest.approx(torque - T_s - W.r_0 * F_xR)
        assert W.I_L * d[W_L] == pytest.approx(T_s - W.r_0 * F_xL)
        # an accelerometer feels what the rails do to the wheelset, and leans with it
        leaning = GRAVITY * W.gamma / W.L_g * (x[Y] - y_t)
        assert accel == pytest.approx((-F_yL - F_yR + F_g) / W.m_w + leaning, abs=1e-9)


def test_the_printed_yaw_moment_is_right() -> None:
    """(8), (F_xR - F_xL) L_g, is the moment of the two forces about the vertical axis: x forward, y left, z up."""
    left, right = np.array([0.0, W.L_g, 0.0]), np.array([0.0, -W.L_g, 0.0])
    for F_xL, F_xR in ((1000.0, 0.0), (0.0, 1000.0), (300.0, -800.0)):
        moment = np.cross(left, [F_xL, 0.0, 0.0])[2] + np.cross(right, [F_xR, 0.0, 0.0])[2]
        assert moment == pytest.approx((F_xR - F_xL) * W.L_g)
    row = np.array([*CURVES["A"].row(), 0.0, 0.0, 0.0])

    def yaw_acceleration(**state: float) -> float:
        x, d = np.zeros(7), np.zeros(7)
        x[W_R] = x[W_L] = 25.0 / W.r_0
        for name, value in state.items():
            x[{"psidot": PSIDOT, "y": Y, "w_R": W_R}[name]] += value
        axle_derivatives(x, 25.0, 0.0, 0.0, row, constants(W), W.contact, d)
        return float(d[PSIDOT])

    assert yaw_acceleration(w_R=0.01) > 0  # the right wheel pulls: the wheelset turns to the left
    assert yaw_acceleration(y=1e-4) < 0  # to the left of the track it steers back to the right
    assert yaw_acceleration(psidot=1e-3) < 0  # turning is damped


@pytest.mark.parametrize(("curve", "torque"), [("A", 9000.0), ("C", -6000.0)])
def test_energy_is_neither_made_nor_lost(curve: str, torque: float) -> None:
    """A vehicle runs freely through a transition into a curve on rough track. What the drive gives is stored, lost in
    contact, shaft and running resistance, or done by what turns and displaces the track under the wheelset.

    (1)-(12) are linear in the angles: wheels push at r_0 on a radius r_0 + gamma y, and the yawed lateral force has no
    forward part in (7). Both show in the balance as work and are small.
    """
    track = Track(QUALITY["poor"], 4)
    rail = rail_table([RailSection(0.0, CURVES[curve]), RailSection(10.0, CURVES[curve], 1 / 400, 0.02, 25.0)])
    sim = Simulation(W, [Axle(rail, track)], 30.0, SAMPLE_S)
    n = 2400
    stored, power = np.empty(n), np.empty((n, 7))
    drive, free = command(1, torque=torque, limit_of_peak=50.0), np.full(1, math.nan)
    for i in range(n):
        sim.advance(drive, free)
        stored[i] = energy(sim.state[0], sim.train[0])
        power[i] = powers(sim, rail, track, torque)
    drive_W, slip, shaft, resistance, track_W, yaw, linear = (power[1:].sum(0) + power[:-1].sum(0)) / 2 * SAMPLE_S
    gained = stored[-1] - stored[0]
    assert (power[:, 1:4] >= 0).all()  # losses are losses
    # of 400 to 700 kJ
    assert gained == pytest.approx(drive_W - slip - shaft - resistance + track_W + yaw + linear, abs=0.02)
    assert abs(linear) < 5e-3 * abs(drive_W)
    # each is there, or this would prove nothing about it
    assert slip > 100.0
    assert abs(track_W) > 5.0
    assert abs(yaw) > 0.035


def energy(x: FloatArray, v: float) -> float:
    """Kinetic energy, and that of shaft and yaw spring, J."""
    inertias = W.M_v * v**2 + W.m_w * x[YDOT] ** 2 + W.I_w * x[PSIDOT] ** 2 + W.I_R * x[W_R] ** 2 + W.I_L * x[W_L] ** 2
    return float(inertias + W.k_s * x[THETA] ** 2 + W.k_w * x[PSI] ** 2) / 2


def powers(sim: Simulation, rail: FloatArray, track: Track, torque: float) -> tuple[float, ...]:
    """In W: of the drive; lost in contact, shaft and resistance; of F_c, F_g and the turning track; of d(v k)/dt;
    and of the second order, which the equations leave out."""
    x, (v, at) = sim.state[0], sim.train
    r = rail_at(rail, at)
    y_t = irregularity(track.nodes, at)
    lam = creepages(x, v, y_t, r[5])
    F_xL, F_xR, F_yL, F_yR = forces(lam, v, r)
    resistance = (W.resistance_0 + W.resistance_2 * v**2) * v
    across = W.m_w * (v**2 * r[5] - GRAVITY * r[6]) - 2 * W.normal_N * W.gamma / W.L_g * (x[Y] - y_t)
    acceleration = (F_xL + F_xR - resistance / v) / W.M_v
    return (
        torque * x[W_R],
        v * (F_xL * lam[0] + F_xR * lam[1] + (F_yL + F_yR) * lam[2]),
        W.C_s * (x[W_R] - x[W_L]) ** 2,
        resistance,
        across * x[YDOT] + (F_xR - F_xL) * W.L_g * v * r[5],
        W.I_w * (v**2 * r[7] + acceleration * r[5]) * x[PSIDOT],
        (F_xL - F_xR) * v * W.gamma * (x[Y] - y_t) / W.r_0 - v * x[PSI] * (F_yL + F_yR),
    )
