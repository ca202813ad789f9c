"""The rig's half: contact, wheelset, track, sensors."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import command
from sim_ecu.design.linear import TRACK_DECAY, model, slope_and_secant
from sim_ecu.design.make import POINTS
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between, kalker_c11, peak, traction_ratio
from sim_ecu.physics.rail import RAIL_COLUMNS, rail_table
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Simulation, advance_side_by_side
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import (
    LANES,
    LAT_ACCEL,
    MU_AVAILABLE,
    MU_USED,
    PSI,
    PSIDOT,
    SLIP,
    TORQUE,
    W_L,
    W_R,
    YAW_RATE,
    YDOT,
    Command,
    FloatArray,
    Wheelset,
    Y,
    axle_derivatives,
    constants,
)

W = Wheelset()
PEAKS = {
    "A": (0.384, 2.3), "B": (0.307, 3.0), "C": (0.216, 6.5), "E": (0.114, 5.2), "D": (0.050, 3.4), "F": (0.027, 4.0)
}  # fmt: skip


def rail(curve: CreepCurve, curvature: float = 0.0, cant: float = 0.0) -> FloatArray:
    row = np.array([[0.0, *curve.row(), curvature, cant]])
    assert row.shape[1] == RAIL_COLUMNS
    return row


def simulate(
    curve: str, drive: Command, speed: FloatArray, start: float, scale: float = 1.0, seed: int = 1, quality: float = 1.0
) -> FloatArray:
    axle = Axle(rail(CURVES[curve]), Track(QUALITY["good"] * quality, seed))
    return Simulation(W, [axle], start, step_scale=scale).advance(drive, speed).outputs[:, 0]


@pytest.mark.parametrize("name", PEAKS)
def test_peaks_of_the_curves(name: str) -> None:
    creep, mu = peak(25.0, W.contact, *CURVES[name].row())
    assert (round(mu, 3), round(100 * creep, 1)) == PEAKS[name]
    for factor in (0.9, 1.1):
        assert traction_ratio(creep * factor, 25.0, W.contact, *CURVES[name].row()) < mu


def test_small_creep_has_kalkers_slope() -> None:
    c = CURVES["C"]
    slope = W.normal_N * traction_ratio(1e-9, 25.0, W.contact, *c.row()) / 1e-9
    assert slope == pytest.approx((c.k_A + c.k_S) / 2 * W.G * W.a * W.b * kalker_c11(W.a, W.b), rel=1e-6)
    assert kalker_c11(W.a, W.b) == pytest.approx(4.31, abs=0.005)


@pytest.mark.parametrize("name", CURVES)
def test_the_family_passes_through_its_curves(name: str) -> None:
    assert curve_between(CURVES[name].mu_0).row() == pytest.approx(CURVES[name].row())


@pytest.mark.parametrize("point", POINTS, ids=lambda p: p.name)
@pytest.mark.parametrize("v", [5.0, 25.0, 55.0])
def test_the_linear_model_is_the_derivative_of_the_nonlinear_one(point: object, v: float) -> None:
    """Every term of (13)-(15) against finite differences of (1)-(12) about steady rolling at the design point."""
    p = next(q for q in POINTS if q is point)
    g11, g22 = slope_and_secant(W, p.curve, p.creep_of_peak, v)
    A, _, C = model(W, g11, g22, v)
    creep = peak(v, W.contact, *p.curve.row())[0] * p.creep_of_peak

    def rates(psi: float, ydot: float, psidot: float, y_t: float, relative: float) -> FloatArray:
        x = np.zeros(7)
        x[PSI], x[YDOT], x[PSIDOT], x[Y] = psi, ydot, psidot, relative + y_t
        x[W_R] = x[W_L] = v * (1 + creep) / W.r_0
        d = np.zeros(7)
        # the force at steady speed: friction's dependence on slip speed is part of g11
        _, accel = axle_derivatives(x, v, y_t, 0.0, rail(p.curve)[0, 1:], constants(W), W.contact, d)
        return np.array([d[PSI], d[YDOT], d[PSIDOT], accel])

    # x = [psi, y', psi', y_t, y - y_t]; the last two rows of A are the track's own model
    scale = creep * 1e-3
    steps = np.array([scale, scale * v, scale * v / W.L_g, scale * W.r_0 / W.gamma, scale * W.r_0 / W.gamma])
    for i, h in enumerate(steps):
        up, down = np.zeros(5), np.zeros(5)
        up[i], down[i] = h, -h
        slope = (rates(*up) - rates(*down)) / (2 * h)
        for row, found in zip((A[0], A[1], A[2], C[1]), slope, strict=True):
            size = np.abs(row * steps).max() / h
            assert found == pytest.approx(row[i], abs=2e-3 * size)
    assert A[3].tolist() == [0, 0, 0, TRACK_DECAY, 0]
    assert A[4].tolist() == [0, 1, 0, -TRACK_DECAY, 0]


def test_the_errata_of_the_printed_model() -> None:
    """As printed model 4 is unstable; as mended it has the poles that (1)-(12) have, and everything is observable."""
    p, v = POINTS[3], 25.0
    g11, g22 = slope_and_secant(W, p.curve, p.creep_of_peak, v)
    A, _, C = model(W, g11, g22, v)
    assert np.linalg.eigvals(A).real.max() < 1e-9
    printed = A.copy()
    printed[2, 0], printed[2, 4], printed[1, 4] = W.k_w / W.I_w, A[2, 4] / W.gamma, 0.0
    assert np.linalg.eigvals(printed).real.max() > 10.0

    def rank(a: FloatArray, c: FloatArray) -> int:
        scale = np.diag([1e-3, 1e-2, 1e-2, 1e-3, 1e-3])
        a, c = np.linalg.inv(scale) @ a @ scale / 50.0, c @ scale
        rows = np.vstack([c @ np.linalg.matrix_power(a, k) for k in range(5)])
        rows /= np.abs(rows).max(axis=1, keepdims=True)
        return int(np.linalg.matrix_rank(rows, tol=1e-9))

    assert rank(A, C) == 5
    without_n = A.copy()
    without_n[4, 3] = without_n[3, 3] = 0.0
    assert rank(without_n, C) == 4
    saturated, _, out = model(W, 0.0, g22, v)
    assert rank(saturated, out) == 5
    saturated[1, 4] = out[1, 4] = 0.0
    assert rank(saturated, out) == 3


def test_halving_the_step_changes_little() -> None:
    """Stated bound: 2 % of each output's own standard deviation, at speeds from 5 to 45 m/s."""
    for speed in (5.0, 15.0, 45.0):
        n = 1000
        drive = command(n, utilisation=np.minimum(np.arange(n) / 100, 1.0)[:, None] * 0.6, limit_of_peak=1.0)
        coarse, fine = (simulate("B", drive, np.full(n, speed), speed, scale) for scale in (1.0, 2.0))
        for column in (YAW_RATE, LAT_ACCEL, TORQUE, SLIP, MU_USED):
            change = np.abs(coarse[200:, column] - fine[200:, column]).max()
            assert change <= 0.02 * max(fine[:, column].std(), 1e-9), (speed, column)


@pytest.mark.parametrize("curve", CURVES)
def test_the_creep_controller_holds_the_peak(curve: str) -> None:
    n = 800
    drive = command(n, creep_of_peak=np.minimum(np.arange(n) / 200, 1.0)[:, None])
    out = simulate(curve, drive, np.full(n, 25.0), 25.0)
    creep, mu = peak(25.0, W.contact, *CURVES[curve].row())
    steady = out[500:]
    assert steady[:, SLIP].mean() == pytest.approx(creep, rel=0.01)
    assert steady[:, MU_USED].mean() == pytest.approx(mu, rel=0.01)
    # saturated, torque gives the level by itself
    assert steady[:, TORQUE].mean() / (2 * W.normal_N * W.r_0) == pytest.approx(mu, rel=0.01)
    assert steady[:, MU_AVAILABLE].mean() == pytest.approx(mu, rel=1e-6)


def test_braking_mirrors_traction() -> None:
    n = 600
    ramp = np.minimum(np.arange(n) / 200, 1.0)[:, None]
    forward, back = (simulate("C", command(n, creep_of_peak=s * ramp), np.full(n, 25.0), 25.0) for s in (1.0, -1.0))
    assert back[300:, TORQUE].mean() == pytest.approx(-forward[300:, TORQUE].mean(), rel=0.02)
    assert back[300:, SLIP].mean() == pytest.approx(-forward[300:, SLIP].mean(), rel=0.02)


def test_train_starts_from_standstill_and_returns() -> None:
    """A free vehicle: torque makes speed, resistance and brakes take it away, and it does not roll backwards."""
    n = 6000
    torque = np.interp(np.arange(n) / 200, [1, 2, 12, 13], [0, 6000, 6000, -8000])[:, None]
    axle = Axle(rail(CURVES["A"]), Track(QUALITY["good"], 3))
    sim = Simulation(W, [axle], 0.0)
    out = sim.advance(command(n, torque=torque, limit_of_peak=1.0), np.full(n, math.nan))
    assert np.isfinite(out.outputs).all()
    top = out.speed_m_s.max()
    # 6000 N m / 0.5 m on 15 t (and the wheels' inertia) for 10.5 s, less some resistance
    assert 0.9 < top / (12_000 / (15_000 + (W.I_R + W.I_L) / W.r_0**2) * 10.5) < 1.0
    assert 0.0 <= out.speed_m_s[-1] < 0.3
    assert (np.diff(out.distance_m) >= 0).all()


def test_chunks_do_not_matter() -> None:
    def run(chunk: int) -> FloatArray:
        sim = Simulation(W, [Axle(rail(CURVES["B"]), Track(QUALITY["poor"], 5))], 30.0)
        parts = [
            sim.advance(command(chunk, utilisation=0.4, limit_of_peak=1.0), np.full(chunk, 30.0)).outputs
            for _ in range(300 // chunk)
        ]
        return np.concatenate(parts)

    assert np.array_equal(run(300), run(20))


def test_vehicles_side_by_side_ride_as_each_alone() -> None:
    n = 200
    speed: FloatArray = np.linspace(12.0, 12.8, n)  # every vehicle takes steps of its own, and their number changes
    curves = [curve_between(mu_0) for mu_0 in np.geomspace(0.6, 0.03, LANES + 3)]
    tables = [rail_table([(0.0, CURVES["A"], 0.0, 0.0), (4.0 + k, c, 1e-3, 0.02)]) for k, c in enumerate(curves)]
    wheelsets = [replace(W, m_w=W.m_w * (1 + 0.01 * k)) for k in range(len(curves))]

    def ready() -> list[Simulation]:
        return [
            Simulation(w, [Axle(t, Track(QUALITY["good"], k))], 12.0)
            for k, (w, t) in enumerate(zip(wheelsets, tables, strict=True))
        ]

    drive = command(n, len(curves), utilisation=np.linspace(-1.2, 1.2, len(curves)), limit_of_peak=1.3)
    together = ready()
    halves = [
        advance_side_by_side(together, Command(*(c[half] for c in drive)), speed[half])
        for half in (slice(0, 90), slice(90, n))
    ]
    outputs, journey = (np.concatenate(parts) for parts in zip(*halves, strict=True))
    for k, (sim, beside) in enumerate(zip(ready(), together, strict=True)):
        alone = sim.advance(Command(*(np.ascontiguousarray(c[:, k : k + 1]) for c in drive)), speed)
        assert np.array_equal(outputs[:, k], alone.outputs[:, 0])
        assert np.array_equal(journey[:, k, 1], alone.distance_m)
        assert np.array_equal(beside.state, sim.state)


@pytest.mark.parametrize("name", SENSOR_SETS)
def test_sensor_adds_bias_noise_limit_and_steps(name: str) -> None:
    s = SENSOR_SETS[name].biased(0.01, 0.2, 100.0)
    rng = np.random.default_rng(1)
    gyro = s.yaw_rate.measure(np.zeros(20_000), rng)
    assert gyro.mean() == pytest.approx(0.01, abs=5 * s.yaw_rate.noise_rms / math.sqrt(20_000))
    assert gyro.std() == pytest.approx(s.yaw_rate.noise_rms, rel=0.03)
    assert s.lat_accel.measure(np.array([1e6]), rng)[0] == s.lat_accel.limit
    if s.lat_accel.step:
        counts = s.lat_accel.measure(np.linspace(-1, 1, 50), rng) / s.lat_accel.step
        assert counts == pytest.approx(np.round(counts))


def test_the_reference_numbers_of_the_structure() -> None:
    """g22 at the peaks and the wheelset's lateral poles at 25 m/s, to the digits that are published for this set."""
    g22s = {"A": 1.2e6, "B": 7.5e5, "C": 2.4e5, "E": 1.6e5, "D": 1.1e5, "F": 4.9e4}
    poles = {"A": -77, "B": -48, "C": -16, "E": -10, "D": -7, "F": -3}
    for name, g22 in g22s.items():
        g11, found = slope_and_secant(W, CURVES[name], 1.0, 25.0)
        assert found == pytest.approx(g22, rel=0.05)
        assert abs(g11) < 0.01 * found
        assert -2 * found / (25.0 * W.m_w) == pytest.approx(poles[name], abs=0.7)
