"""Energy of a bogie that brakes to a stop, against its equations written down a second time."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES, traction_ratio
from sim_ecu.physics.rail import CANT, CURVATURE, CURVATURE_SLOPE, RailSection, rail_at, rail_table
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, Track, irregularity
from sim_ecu.physics.wheelset import FRAME_YAW_RATE, GRAVITY, ROLLING_START, Bogie, FloatArray, Wheelset

B = Bogie()
W = replace(Wheelset(), M_v=B.carried_kg(Wheelset().m_w), bogie=B)
ARMS = np.array([B.semi_wheelbase_m, -B.semi_wheelbase_m])
RAIL = rail_table([RailSection(0.0, CURVES["C"])])
SAMPLE_S = 5e-4
BRAKE_N_M = 7500.0  # of a wheelset: 1 m/s2


def test_energy_of_a_stop_is_neither_made_nor_lost() -> None:
    """A bogie brakes from 5 m/s to a stand, out of a straight into a canted curve, on rough track and with its flanges
    at the rail. What it had goes into brakes, contact, dampers and running resistance, to less than any of them.

    As for the lone wheelset, the equations are linear in the angles: that is a part of the balance, and small.
    """
    track = Track(QUALITY["poor"], 4)
    straight = RailSection(0.0, CURVES["C"])
    rail = rail_table([straight, RailSection(3.0, CURVES["C"], 1 / 700, 0.02, 6.0)])
    sim = Simulation(W, [Axle(rail, track, B.wheelbase_m), Axle(rail, track)], 5.0, SAMPLE_S)
    x, frame, train = [sim.state.copy()], [sim.bogies[0].copy()], [sim.train.copy()]
    while sim.train[0] > 0.02:
        sim.step(np.zeros(2), np.full(2, BRAKE_N_M))
        x.append(sim.state.copy())
        frame.append(sim.bogies[0].copy())
        train.append(sim.train.copy())
    stored, power = energies_and_powers(np.array(x), np.array(frame), np.array(train), rail, track)
    work = {name: float((p[1:].sum() + p[:-1].sum()) / 2 * SAMPLE_S) for name, p in power.items()}
    lost = stored[0] - stored[-1]
    assert lost > 3.9e5
    assert sum(work.values()) == pytest.approx(-lost, abs=0.05)
    # each is there, or this would prove nothing about it; losses are losses
    for name in ("brake", "contact", "shaft", "resistance", "primary", "secondary"):
        assert power[name].max() <= 0.0
        assert work[name] < -0.2
    assert min(abs(work[name]) for name in ("track", "track under frame and body", "flange")) > 1.0
    assert abs(work["linear"]) < 2e-3 * lost


def test_a_frame_that_cannot_move_holds_its_wheelsets_as_the_ground_does() -> None:
    heavy = Bogie(
        frame_mass_kg=1e15, frame_yaw_inertia_kg_m2=1e15, primary_lateral_N_m=1e-3, primary_lateral_damping_N_s_m=0.0,
        primary_yaw_N_m_rad=Wheelset().k_w, primary_yaw_damping_N_m_s_rad=0.0, flange_clearance_m=1.0,
    )  # fmt: skip
    alone, held = (
        Simulation(w, [Axle(RAIL, track, B.wheelbase_m), Axle(RAIL, track)], 25.0).advance(
            command(200, axles=2, utilisation=0.5), np.full(200, 25.0)
        )
        for w, track in ((w, Track(QUALITY["good"], 3)) for w in (Wheelset(), replace(Wheelset(), bogie=heavy)))
    )
    difference = np.abs(held.outputs - alone.outputs)[:, :, :FRAME_YAW_RATE].max(0)
    assert (difference < 1e-8 * np.abs(alone.outputs)[:, :, :FRAME_YAW_RATE].max(0)).all()


def energies_and_powers(
    x: FloatArray, frame: FloatArray, train: FloatArray, rail: FloatArray, track: Track
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """What is stored (n,), in J, and what is done to it (n,), in W, at each of n moments: states of the wheelsets
    (n, 2, 7), of frame and body (n, 6), speed and distance (n, 2).

    track: of the cant, the curve and the irregularity under the wheelsets. linear: what equations linear in the angles
    leave.
    """
    y, y_dot, psi, psi_dot, w_R, w_L, theta = np.moveaxis(x, 2, 0)
    y_f, y_f_dot, psi_f, psi_f_dot, y_b, y_b_dot = frame[:, :, None].transpose(1, 0, 2)
    v, at = train[:, :1], train[:, 1:] + [B.wheelbase_m, 0.0]
    u = np.maximum(v, ROLLING_START)
    rows = np.array([[rail_at(rail, place) for place in both] for both in at])
    y_t = np.array([[irregularity(track.nodes, place - track.start_m) for place in both] for both in at])
    k, cant, k_slope = rows[:, :, CURVATURE], rows[:, :, CANT], rows[:, :, CURVATURE_SLOPE]
    beside = y - y_t
    pressed = np.sign(beside) * np.maximum(np.abs(beside) - B.flange_clearance_m, 0.0)
    a = (W.L_g * (psi_dot - v * k)) / u + W.gamma * beside / W.r_0
    along = np.stack([(W.r_0 * w_L - v) / u + a, (W.r_0 * w_R - v) / u - a])
    across = y_dot / u - psi
    total = np.hypot(along, across)
    ratio = np.frompyfunc(lambda creep, speed: traction_ratio(creep, speed, W.contact, *CURVES["C"].row()), 2, 1)
    q = W.normal_N * ratio(total, np.broadcast_to(u, total.shape)).astype(float) / total
    F_x, F_y = q * along, (q * across).sum(0)
    apart = y_f + ARMS * psi_f + ARMS**2 * k / 2 - y
    parting = y_f_dot + ARMS * psi_f_dot + ARMS**2 * v * k_slope / 2 - y_dot
    turned = psi_f + ARMS * k - psi
    turning = psi_f_dot + ARMS * v * k_slope - psi_dot
    primary_N = B.primary_lateral_N_m * apart + B.primary_lateral_damping_N_s_m * parting
    primary_N_m = B.primary_yaw_N_m_rad * turned + B.primary_yaw_damping_N_m_s_rad * turning
    resistance = (W.resistance_0 + W.resistance_2 * v**2) * np.minimum(v / 0.1, 1.0)
    v_dot = ((F_x.sum(0)).sum(1, keepdims=True) / 2 - resistance) / W.M_v
    outwards = v**2 * k - GRAVITY * cant
    mean_outwards, mean_k, mean_slope = (c.mean(1, keepdims=True) for c in (outwards, k, k_slope))
    stored = (
        2 * W.M_v * v**2 + B.frame_mass_kg * y_f_dot**2 + B.frame_yaw_inertia_kg_m2 * psi_f_dot**2
        + B.body_mass_kg * y_b_dot**2 + B.secondary_lateral_N_m * (y_b - y_f) ** 2
        + B.secondary_yaw_N_m_rad * psi_f**2
        + (
            W.m_w * y_dot**2 + W.I_w * psi_dot**2 + W.I_R * w_R**2 + W.I_L * w_L**2 + W.k_s * theta**2
            + B.primary_lateral_N_m * apart**2 + B.primary_yaw_N_m_rad * turned**2 + B.flange_N_m * pressed**2
        ).sum(1, keepdims=True)
    ) / 2  # fmt: skip
    power = {
        "brake": -BRAKE_N_M * w_R,
        "contact": -u * ((F_x * along).sum(0) + F_y * across),
        "shaft": -W.C_s * (w_R - w_L) ** 2,
        "resistance": -resistance * v * np.ones(2),
        "primary": -B.primary_lateral_damping_N_s_m * parting**2 - B.primary_yaw_damping_N_m_s_rad * turning**2,
        "secondary": -B.secondary_lateral_damping_N_s_m * (y_b_dot - y_f_dot) ** 2
        - B.secondary_yaw_damping_N_m_s_rad * psi_f_dot**2,
        "track": (W.m_w * outwards - 2 * W.normal_N * W.gamma / W.L_g * beside) * y_dot
        + (F_x[1] - F_x[0]) * W.L_g * v * k
        + W.I_w * (v**2 * k_slope + v_dot * k) * psi_dot
        + primary_N * ARMS**2 * v * k_slope / 2
        + primary_N_m * ARMS * v * k_slope,
        "flange": -B.flange_N_m * pressed * np.gradient(y_t, SAMPLE_S, axis=0),
        "track under frame and body": mean_outwards * (B.frame_mass_kg * y_f_dot + B.body_mass_kg * y_b_dot)
        + B.frame_yaw_inertia_kg_m2 * (v**2 * mean_slope + v_dot * mean_k) * psi_f_dot,
        "linear": -u * ((F_x[1] - F_x[0]) * W.gamma * beside / W.r_0 + psi * F_y),
    }
    return stored[:, 0], {name: p.sum(1) for name, p in power.items()}
