"""What the estimator is compared with: extended Kalman filters, raw signals through the rules, other designs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.brief import load_source
from sim_ecu.design.cases import Condition, command, simulate
from sim_ecu.design.linear import model, slope_and_secant
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import QUALITY, SPECTRA, Track
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, TORQUE, YAW_RATE, Wheelset
from sim_ecu.score.baselines import Beside, GivenTicks, Offsetless, fitting, without_offset
from sim_ecu.score.ekf import THETA, Ekf, table
from sim_ecu.score.run_score import ScoreRequest, make_baselines
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.errors import InputError
from wrcd.estimator.design import load_design
from wrcd.estimator.estimator import OFFSET_WINDOWS, Estimator
from wrcd.estimator.records import Tick
from wrcd.estimator.signals.noise import Offset
from wrcd.resources import DESIGN

W = Wheelset()
MEMS = SENSOR_SETS["mems"]
TICK_S = 0.005
WINDOW = 200


def measured(samples: Samples, seed: int) -> tuple[GivenTicks, np.ndarray]:
    """What the sensors say, and the truth in percent (t, n)."""
    rng = np.random.default_rng(seed)
    y = samples.outputs
    z = np.stack((MEMS.yaw_rate.measure(y[..., YAW_RATE], rng), MEMS.lat_accel.measure(y[..., LAT_ACCEL], rng)), axis=1)
    ratio = np.abs(MEMS.torque.measure(y[..., TORQUE], rng)) / (2 * W.normal_N * W.r_0)
    return GivenTicks(z, np.ones(z.shape, bool), ratio, samples.speed_m_s, TICK_S, np.arange(len(z))), 100 * y[
        ..., MU_AVAILABLE
    ]


def played(curve: CreepCurve, utilisation: float, creep_of_peak: float, seed: int, speed: float = 25.0) -> Samples:
    return simulate(
        W, Condition(speed, curve, SPECTRA["good"].scaled(1.5), utilisation, creep_of_peak, seed), 3.0, TICK_S
    )


def quiet(ticks: int, axles: int, speed: float = 25.0) -> GivenTicks:
    z = np.zeros((ticks, 2, axles))
    return GivenTicks(
        z, np.ones(z.shape, bool), np.full((ticks, axles), 0.01), np.full(ticks, speed), TICK_S, np.arange(ticks)
    )


def test_the_offset_is_taken_off_as_the_train_does_it() -> None:
    rng = np.random.default_rng(2)
    z = np.array([0.02, 0.5])[:, None] + rng.standard_normal((700, 2, 3))
    present = rng.random(z.shape) > 0.2
    ticks = replace(quiet(len(z), 3), z=np.where(present, z, np.nan), present=present)
    train = Offset(OFFSET_WINDOWS * WINDOW, 3)
    expected = np.stack([train.step(np.nan_to_num(one), there) for one, there in zip(ticks.z, present, strict=True)])
    assert np.array_equal(without_offset(ticks, WINDOW).z, np.where(present, expected, np.nan), equal_nan=True)


@pytest.fixture(scope="module")
def ekf() -> Ekf:
    return Ekf(W, MEMS, TICK_S)


@pytest.mark.parametrize("name", "ACF")
def test_at_the_peak_the_ekf_finds_it(ekf: Ekf, name: str) -> None:
    ticks, truth = measured(played(CURVES[name], math.nan, 1.0, 1), 1)
    mu = ekf.mu_pct(ticks)
    assert mu[400:].mean() == pytest.approx(truth[-1, 0], rel=0.12, abs=0.3)


def test_below_half_utilisation_the_ekf_knows_more_than_the_torque(ekf: Ekf) -> None:
    wrong, torque_wrong = [], []
    for i, (curve, speed) in enumerate(zip(CURVES.values(), (15.0, 40.0) * 3, strict=True)):
        ticks, truth = measured(played(curve, 0.2 + 0.04 * i, math.nan, 100 + i, speed), i)
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


@pytest.mark.parametrize("missing", [(0,), (0, 1)])
def test_missing_channels_are_left_out(ekf: Ekf, missing: tuple[int, ...]) -> None:
    ticks, _ = measured(played(CURVES["C"], 0.5, math.nan, 5), 5)
    present = ticks.present.copy()
    for channel in missing:
        present[50:90, channel] = False
    ratio = ticks.torque_ratio.copy()
    ratio[60:70] = np.nan
    blind = replace(ticks, z=np.where(present, ticks.z, np.nan), present=present, torque_ratio=ratio)
    wild = replace(ticks, z=np.where(present, ticks.z, 5.0), present=present, torque_ratio=ratio)
    for baseline in (ekf, Offsetless(ekf, WINDOW)):
        mu = baseline.mu_pct(blind)
        assert np.isfinite(mu).all()
        assert np.array_equal(mu, baseline.mu_pct(wild))
        assert not np.array_equal(mu, baseline.mu_pct(ticks))


def test_speeds_and_axles_do_not_mix(ekf: Ekf) -> None:
    ticks, _ = measured(played(CURVES["B"], 0.5, math.nan, 6), 6)
    speed = np.linspace(24.0, 27.0, len(ticks.speed_m_s))
    ramp = replace(ticks, speed_m_s=speed)
    double = GivenTicks(
        np.concatenate((ramp.z[:, :, ::-1] * 0.5, ramp.z), axis=2),
        np.repeat(ramp.present, 2, axis=2),
        np.repeat(ramp.torque_ratio, 2, axis=1),
        speed,
        TICK_S,
        ramp.number,
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


def test_an_offset_does_not_reach_a_baseline(ekf: Ekf) -> None:
    ticks, _ = measured(played(CURVES["B"], 0.5, math.nan, 8), 8)
    off = replace(ticks, z=ticks.z + np.array([0.009, 0.05])[:, None])
    assert without_offset(off, WINDOW).z == pytest.approx(without_offset(ticks, WINDOW).z)
    fair = Offsetless(ekf, WINDOW)
    assert fair.mu_pct(off) == pytest.approx(fair.mu_pct(ticks), rel=1e-6)
    assert np.abs(ekf.mu_pct(off) - ekf.mu_pct(ticks))[-1, 0] > 1.0  # alone it is thrown off


def test_another_design_runs_on_the_same_ticks_as_the_train_s() -> None:
    design = load_design(LONE_DESIGN)
    ticks, _ = measured(played(CURVES["C"], 0.6, math.nan, 9), 9)
    late = replace(ticks, number=ticks.number + 1003)
    mu = Beside(design).mu_pct(late)
    estimator = Estimator(design, 1)
    for k in range(len(late.number)):
        number = int(late.number[k])
        estimator.step(Tick(number, late.z[k], late.present[k], late.torque_ratio[k], float(late.speed_m_s[k])))
        if k == 400:
            assert mu[k, 0] == pytest.approx(estimator.estimate().mu_available_pct[0], rel=1e-9)
    assert mu[401, 0] == mu[400, 0]  # until the next frame
    assert np.isnan(mu[0, 0])


def test_a_design_for_another_wheelset_cannot_run_beside() -> None:
    design = load_design(LONE_DESIGN)
    fitting("same", design, design)
    with pytest.raises(InputError, match="r_0"):
        fitting("other", replace(design, r_0=0.42), design)


def test_ekfs_stand_beside_a_lone_wheelset_only() -> None:
    """Their model has no frame."""
    lone, train = (make_baselines(load_source(f), ScoreRequest(f, None, ())) for f in (LONE_DESIGN, DESIGN))
    assert lone.keys() - train.keys() == {"12 EKFs"}
