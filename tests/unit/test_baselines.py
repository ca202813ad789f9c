"""What the estimator is compared with: extended Kalman filters, interacting multiple models."""

import math
from dataclasses import replace

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import multivariate_normal

from sim_ecu.design.cases import Condition, command, simulate
from sim_ecu.design.gains import steady_state
from sim_ecu.design.linear import model, slope_and_secant
from sim_ecu.design.make import POINTS
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, TORQUE, YAW_RATE, Wheelset
from sim_ecu.score.ekf import Ekf
from sim_ecu.score.ekf_table import THETA, table
from sim_ecu.score.imm import STAY, Imm
from sim_ecu.score.ticks import Ticks

W = Wheelset()
MEMS = SENSOR_SETS["mems"]
TICK_S = 0.005


def measured(samples: Samples, seed: int) -> tuple[Ticks, np.ndarray]:
    """What the sensors say, and the truth in percent (t, n)."""
    rng = np.random.default_rng(seed)
    y = samples.outputs
    z = np.stack((MEMS.yaw_rate.measure(y[..., YAW_RATE], rng), MEMS.lat_accel.measure(y[..., LAT_ACCEL], rng)), axis=1)
    ratio = np.abs(MEMS.torque.measure(y[..., TORQUE], rng)) / (2 * W.normal_N * W.r_0)
    return Ticks(z, np.ones(z.shape, bool), ratio, samples.speed_m_s, TICK_S), 100 * y[..., MU_AVAILABLE]


def played(curve: CreepCurve, utilisation: float, creep_of_peak: float, seed: int, speed: float = 25.0) -> Samples:
    return simulate(W, Condition(speed, curve, 1.5 * QUALITY["good"], utilisation, creep_of_peak, seed), 3.0, TICK_S)


def quiet(ticks: int, axles: int, speed: float = 25.0) -> Ticks:
    z = np.zeros((ticks, 2, axles))
    return Ticks(z, np.ones(z.shape, bool), np.full((ticks, axles), 0.01), np.full(ticks, speed), TICK_S)


@pytest.fixture(scope="module")
def ekf() -> Ekf:
    return Ekf(W, MEMS, TICK_S)


@pytest.fixture(scope="module")
def imm() -> Imm:
    return Imm(W, POINTS, MEMS, TICK_S, 1.0)


@pytest.mark.parametrize("name", CURVES)
def test_at_the_peak_the_ekf_finds_it(ekf: Ekf, name: str) -> None:
    ticks, truth = measured(played(CURVES[name], math.nan, 1.0, 1), 1)
    mu = ekf.mu_pct(ticks)
    assert mu[400:].mean() == pytest.approx(truth[-1, 0], rel=0.12, abs=0.3)


def test_below_half_utilisation_the_ekf_knows_more_than_the_torque(ekf: Ekf) -> None:
    wrong, torque_wrong = [], []
    for i, (curve, speed) in enumerate((c, v) for c in CURVES.values() for v in (15.0, 40.0)):
        ticks, truth = measured(played(curve, 0.2 + 0.02 * i, math.nan, 100 + i, speed), i)
        wrong.append(abs(ekf.mu_pct(ticks)[400:].mean() - truth[-1, 0]))
        torque_wrong.append(abs(100 * ticks.torque_ratio[400:].mean() - truth[-1, 0]))
    assert np.mean(wrong) < 0.5 * np.mean(torque_wrong)


def test_the_ekf_follows_a_changed_rail(ekf: Ekf) -> None:
    rail = np.zeros((3, RAIL_COLUMNS))
    rail[:, 0] = 0.0, 75.0, 76.0
    rail[:, 1:6] = CURVES["A"].row(), CURVES["A"].row(), CURVES["D"].row()
    sim = Simulation(W, [Axle(rail, Track(QUALITY["good"], 3))], 25.0, TICK_S)
    n = round(6.0 / TICK_S)
    ticks, truth = measured(sim.advance(command(n, utilisation=0.5, limit_of_peak=1.3), np.full(n, 25.0)), 3)
    mu = ekf.mu_pct(ticks)[:, 0]
    assert truth[0, 0] > 35 > 6 > truth[-1, 0]
    assert mu[400:580].mean() > 20
    assert abs(mu[-100:].mean() - truth[-1, 0]) < 3


def test_friction_below_what_is_in_use_is_ruled_out(ekf: Ekf) -> None:
    ticks = replace(quiet(400, 1), torque_ratio=np.full((400, 1), 0.25))
    assert (ekf.mu_pct(ticks) >= 25.0 - 1e-9).all()


@pytest.mark.parametrize("missing", [(0,), (1,), (0, 1)])
def test_missing_channels_are_left_out(ekf: Ekf, imm: Imm, missing: tuple[int, ...]) -> None:
    ticks, _ = measured(played(CURVES["C"], 0.5, math.nan, 5), 5)
    present = ticks.present.copy()
    for channel in missing:
        present[50:90, channel] = False
    ratio = ticks.torque_ratio.copy()
    ratio[60:70] = np.nan
    blind = replace(ticks, z=np.where(present, ticks.z, np.nan), present=present, torque_ratio=ratio)
    wild = replace(ticks, z=np.where(present, ticks.z, 5.0), present=present, torque_ratio=ratio)
    mu = ekf.mu_pct(blind)
    assert np.isfinite(mu).all()
    assert np.array_equal(mu, ekf.mu_pct(wild))
    assert not np.array_equal(mu, ekf.mu_pct(ticks))
    first = slice(0, 120)
    cut = [
        Ticks(t.z[first], t.present[first], t.torque_ratio[first], t.speed_m_s[first], TICK_S) for t in (blind, wild)
    ]
    p, q = (imm.probabilities(t) for t in cut)
    assert np.isfinite(p).all()
    assert np.array_equal(p, q)
    assert np.isfinite(imm.mu_pct(cut[0])).all()


def test_speeds_and_axles_do_not_mix(ekf: Ekf) -> None:
    ticks, _ = measured(played(CURVES["B"], 0.5, math.nan, 6), 6)
    speed = np.linspace(24.0, 27.0, len(ticks.speed_m_s))
    ramp = replace(ticks, speed_m_s=speed)
    double = Ticks(
        np.concatenate((ramp.z[:, :, ::-1] * 0.5, ramp.z), axis=2),
        np.repeat(ramp.present, 2, axis=2),
        np.repeat(ramp.torque_ratio, 2, axis=1),
        speed,
        TICK_S,
    )
    assert np.array_equal(ekf.mu_pct(double)[:, 1], ekf.mu_pct(ramp)[:, 0])


def test_the_table_is_the_linear_model_at_the_operating_point() -> None:
    at, v = 30, 30.0
    curve = curve_between(math.exp(THETA[at]))
    t = table(W, v, TICK_S, (0.01, 0.01, 0.01))
    g11, g22 = slope_and_secant(W, curve, 1.0, v)
    A, _, H = model(W, g11, g22, v)
    assert t.entries[at, 0, 25:30] == pytest.approx(H[1], rel=1e-4)
    Phi = t.entries[at, 0, :25].reshape(5, 5)
    rates = np.linalg.eigvals(A[np.ix_([0, 1, 2, 4], [0, 1, 2, 4])])
    assert np.sort_complex(np.linalg.eigvals(Phi[np.ix_([0, 1, 2, 4], [0, 1, 2, 4])])) == pytest.approx(
        np.sort_complex(np.exp(rates * TICK_S)), rel=1e-4
    )


def test_the_modes_of_the_imm_are_the_design_points(imm: Imm) -> None:
    """Its first tick by hand: likelihoods of the mixed and predicted filters, which start in their steady state."""
    ticks = quiet(1, 1)
    ticks.z[0, :, 0] = 3e-4, 0.03
    gains = [steady_state(W, p, 25.0, TICK_S, (MEMS.yaw_rate.noise_rms, MEMS.lat_accel.noise_rms)) for p in POINTS]
    likelihood = []
    for j, g in enumerate(gains):
        mixed = sum((STAY if i == j else (1 - STAY) / 3) * other.P for i, other in enumerate(gains))
        S = g.H @ (g.Phi @ mixed @ g.Phi.T + g.Q) @ g.H.T + g.R
        likelihood.append(multivariate_normal.pdf(ticks.z[0, :, 0], np.zeros(2), S))
    assert imm.probabilities(ticks)[0, 0] == pytest.approx(np.array(likelihood) / sum(likelihood), rel=1e-9)


def test_the_probabilities_add_up_over_a_long_quiet_record_and_through_outliers(imm: Imm) -> None:
    ticks = quiet(1500, 1)
    ticks.z[1000:1400:2, 1, 0] = np.geomspace(0.1, 20.0, 200)  # up to where every likelihood underflows
    p = imm.probabilities(ticks)
    assert np.isfinite(p).all()
    assert p.sum(axis=2) == pytest.approx(1.0)
    assert np.ptp(p[900:1000], axis=0).max() < 1e-3


def test_where_every_likelihood_underflows_what_was_expected_stands(imm: Imm, monkeypatch: pytest.MonkeyPatch) -> None:
    before = imm.probabilities(quiet(5, 1))[-1, 0]
    usual = KalmanFilter.likelihood.fget
    ticks = quiet(7, 1)
    ticks.z[5:, 0, 0] = 1.0
    monkeypatch.setattr(KalmanFilter, "likelihood", property(lambda f: 0.0 if f.z[0] else usual(f)))
    after = imm.probabilities(ticks)[5:, 0]
    transition = np.full((4, 4), (1 - STAY) / 3) + np.eye(4) * (STAY - (1 - STAY) / 3)
    assert after[0] == pytest.approx(before @ transition)
    assert after[1] == pytest.approx(before @ transition @ transition)


def test_the_imm_is_never_below_the_torque(imm: Imm) -> None:
    ticks, _ = measured(played(CURVES["A"], 0.9, math.nan, 7), 7)
    part = Ticks(ticks.z[:300], ticks.present[:300], ticks.torque_ratio[:300], ticks.speed_m_s[:300], TICK_S)
    mu = imm.mu_pct(part)
    assert mu.shape == (300, 1)
    assert (mu >= 100 * part.torque_ratio).all()
