"""The small-signal wheelset in its bogie, and the filters' steady gain."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from sim_ecu.design.brief import of_a_train, read_brief
from sim_ecu.design.linear import TRACK_DECAY, Gains, Point, model, slope_and_secant, steady_state
from sim_ecu.design.make import POINTS
from sim_ecu.design.train_worlds import SUSPENSION
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.stability import system_matrix
from sim_ecu.physics.wheelset import AXLE_STATES, FRAME_Y, FRAME_YDOT, GRAVITY, PSI, PSIDOT, YDOT, Wheelset, Y
from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles, vehicle_path
from wrcd.config.settings import read_toml
from wrcd.core.design import filters_stable

MU = load_vehicle("multiple-unit")
NOISE = SENSOR_SETS["mems"].yaw_rate.noise_rms, SENSOR_SETS["mems"].lat_accel.noise_rms


@pytest.mark.parametrize("name", ["multiple-unit", "high-speed-coach"])
@pytest.mark.parametrize("v", [5.0, 25.0, 55.0])
def test_model_in_a_bogie_is_the_linear_vehicle_whose_wheelsets_move_alike(name: str, v: float) -> None:
    w = load_vehicle(name)
    whole = system_matrix(w, CURVES["B"], v)  # both wheelsets, then frame and half body
    frame = 2 * AXLE_STATES
    g11, g22 = slope_and_secant(w, CURVES["B"], 1e-4, v)
    A, _, C = model(w, g11, g22, v)

    def moved(*of: int) -> np.ndarray:
        return np.array(whole[:, of].sum(axis=1))

    both = {q: moved(q, AXLE_STATES + q) for q in (PSI, YDOT, PSIDOT, Y)}
    # x = [psi, y', psi', y_t, y - y_t, y_f, y_f']: at y_t = 0 its fifth is y; y_t alone moves y and not y - y_t
    columns = {0: both[PSI], 1: both[YDOT], 2: both[PSIDOT], 4: both[Y], 5: moved(frame + FRAME_Y)}
    columns[6] = moved(frame + FRAME_YDOT)
    for column, rates in columns.items():
        for row, place in ((1, YDOT), (2, PSIDOT), (6, frame + FRAME_YDOT)):
            size = np.abs(A[row]).max()
            assert A[row, column] == pytest.approx(rates[place], abs=2e-3 * size), (column, row)
    F_g = 2 * w.normal_N * w.gamma / (w.L_g * w.m_w)
    yawed = 2 * w.L_g * w.gamma * g11 / (w.r_0 * w.I_w)
    np.testing.assert_allclose(A[[1, 2, 6], 3], A[[1, 2, 6], 4] + [F_g, yawed, 0.0], rtol=1e-9)
    assert A[3].tolist() == [0, 0, 0, TRACK_DECAY, 0, 0, 0]
    assert C[1].tolist() == pytest.approx((A[1] + GRAVITY * w.gamma / w.L_g * np.eye(7)[4]).tolist())


@pytest.mark.parametrize("w", [Wheelset(), MU], ids=["lone", "bogie"])
@pytest.mark.parametrize("k", range(4))
def test_steady_gain_solves_riccatis_equation(w: Wheelset, k: int) -> None:
    for v in (3.0, 25.0, 60.0):
        assert _misfit(steady_state(w, POINTS[k], v, 0.005, NOISE)) < 1e-8


def test_gain_is_found_where_the_solver_cannot_order_its_eigenvalues() -> None:
    brief = read_brief(read_toml(vehicle_path("multiple-unit")))
    refused = 0
    for v in 3.0 * 20.0 ** (np.arange(96) / 95):
        g = steady_state(brief.wheelset, brief.points[0], float(v), brief.tick_s, NOISE)
        assert _misfit(g) < 1e-8
        try:
            solve_discrete_are(g.Phi.T, g.H.T, g.Q, g.R)
        except ValueError:
            refused += 1
    assert refused


SOFT = Path(__file__).parents[2] / "data" / "soft-bogie.toml"
DRAWN_FROM = packaged_vehicles()
SPEEDS_M_S = 3.0 * 20.0 ** (np.arange(48) / 47)


def drawn_vehicle(seed: int) -> Wheelset:
    """A packaged vehicle with half to twice of each suspension constant, up to nine times the yaw damper."""
    rng, w = np.random.default_rng(seed), load_vehicle(DRAWN_FROM[seed % len(DRAWN_FROM)])

    def times(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    bogie = w.bogie and replace(w.bogie, **{
        name: getattr(w.bogie, name) * times(0.5, 9.0 if name == "secondary_yaw_damping_N_m_s_rad" else 2.0)
        for name in SUSPENSION
    })  # fmt: skip
    return replace(w, k_w=w.k_w * times(0.5, 2.0), gamma=w.gamma * times(0.6, 1.6), bogie=bogie)


def check_gains(w: Wheelset, points: Sequence[Point]) -> None:
    """Whether every filter of a bank solves its equation, and forgets, between two speeds of its grid too."""
    bank = [[steady_state(w, p, float(v), 0.005, NOISE) for p in points] for v in SPEEDS_M_S]
    assert max(_misfit(g) for row in bank for g in row) < 1e-6
    assert filters_stable(*(np.array([[getattr(g, name) for g in row] for row in bank]) for name in ("Phi", "K", "H")))


def test_soft_bogie_with_strong_yaw_dampers_has_gains_where_the_solver_may_give_up() -> None:
    brief = read_brief(read_toml(SOFT))
    check_gains(brief.wheelset, POINTS)
    check_gains(brief.wheelset, brief.points)


@pytest.mark.parametrize("w", [Wheelset(), MU], ids=["lone", "bogie"])
@pytest.mark.parametrize("k", range(4))
def test_gain_without_the_solver_is_the_solvers(w: Wheelset, k: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: object) -> None:
        raise ValueError

    speeds = (3.0, 25.0, 60.0)
    solved = [steady_state(w, POINTS[k], v, 0.005, NOISE) for v in speeds]
    monkeypatch.setattr("sim_ecu.design.linear.solve_discrete_are", refuses)
    for v, g in zip(speeds, solved, strict=True):
        K = steady_state(w, POINTS[k], v, 0.005, NOISE).K
        assert (np.abs(K - g.K) / np.abs(g.K).max(axis=0)).max() < 2e-7


@pytest.mark.parametrize("seed", range(6))
def test_plausible_vehicle_has_gains(seed: int) -> None:
    check_gains(drawn_vehicle(seed), of_a_train().points)


@pytest.mark.night
def test_two_hundred_plausible_vehicles_have_gains() -> None:
    for seed in range(200):
        w = drawn_vehicle(seed)
        check_gains(w, POINTS if seed % 5 == 0 or w.bogie is None else of_a_train().points)


def _misfit(g: Gains) -> float:
    """What a step of the filter changes at the covariance, in its own standard deviations."""
    P = g.Phi @ (g.P - g.K @ g.H @ g.P) @ g.Phi.T + g.Q
    sigma = np.sqrt(np.diag(g.P))
    return float(np.abs((P - g.P) / np.outer(sigma, sigma)).max())
