"""The small-signal wheelset in its bogie, and the filters' steady gain."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from sim_ecu.design.brief import read_brief
from sim_ecu.design.linear import TRACK_DECAY, Gains, model, slope_and_secant, steady_state
from sim_ecu.design.make import POINTS
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.stability import system_matrix
from sim_ecu.physics.wheelset import AXLE_STATES, FRAME_Y, FRAME_YDOT, GRAVITY, PSI, PSIDOT, YDOT, Wheelset, Y
from sim_ecu.play.vehicles import load_vehicle, vehicle_path
from wrcd.config.settings import read_toml

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


def _misfit(g: Gains) -> float:
    """What a step of the filter changes at the covariance, in its own standard deviations."""
    P = g.Phi @ (g.P - g.K @ g.H @ g.P) @ g.Phi.T + g.Q
    sigma = np.sqrt(np.diag(g.P))
    return float(np.abs((P - g.P) / np.outer(sigma, sigma)).max())
