"""What the estimator is compared with, on the same ticks: the torque ratio and other designs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.design.cases import Condition, simulate
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import LAT_ACCEL, TORQUE, YAW_RATE, Wheelset
from sim_ecu.score.baselines import Beside, GivenTicks, TorqueRatio, fitting
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import SteppedEstimator, Tick
from wrcd.core.design import load_design
from wrcd.errors import InputError

W = Wheelset()
MEMS = SENSOR_SETS["mems"]
TICK_S = 0.005


@pytest.fixture(scope="module")
def ticks() -> GivenTicks:
    """Three seconds of a wet rail: what the sensors say."""
    rng = np.random.default_rng(9)
    condition = Condition(25.0, CURVES["C"], SPECTRA["good"].scaled(1.5), 0.6, math.nan, 9)
    played = simulate(W, condition, 3.0, TICK_S)
    y = played.outputs
    z = np.stack((MEMS.yaw_rate.measure(y[..., YAW_RATE], rng), MEMS.lat_accel.measure(y[..., LAT_ACCEL], rng)), axis=1)
    ratio = np.abs(MEMS.torque.measure(y[..., TORQUE], rng)) / (2 * W.normal_N * W.r_0)
    return GivenTicks(z, np.ones(z.shape, bool), ratio, played.speed_m_s, TICK_S, np.arange(len(z)))


def test_torque_ratio_is_the_mean_of_the_newest_window(ticks: GivenTicks) -> None:
    mu = TorqueRatio(200).mu_pct(ticks)
    assert mu[500, 0] == pytest.approx(100 * ticks.torque_ratio[301:501, 0].mean())
    assert mu[9, 0] == pytest.approx(100 * ticks.torque_ratio[:10, 0].mean())


def test_another_design_runs_on_the_same_ticks_as_the_train_s(ticks: GivenTicks) -> None:
    design = load_design(LONE_DESIGN)
    late = replace(ticks, number=ticks.number + 1003)
    mu = Beside(design).mu_pct(late)
    estimator = SteppedEstimator(design, 1)
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
