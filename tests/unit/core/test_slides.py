"""What slides reveal of the estimates before them: signals of a wet rail while little is in use, then those of a
wheelset that slides, whatever its rail bears."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tests.oracle.comparison import Comparison
from tests.support import sensor_simulator
from tests.support.estimator_runs import PER_S, tick, track
from tests.support.sensor_simulator import SensorSimulator
from tests.support.stepped import SteppedEstimator
from wrcd.config.config import load_packaged
from wrcd.config.packaged_designs import design_path
from wrcd.core.design import Design, FloatArray, load_design
from wrcd.core.estimator import Estimator
from wrcd.core.records import Estimate, Ticks

CALM, SLIDE = 4 * PER_S, 2 * PER_S  # ticks; a slide may tell every 5 s
BEFORE = 0.05  # in use


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(design_path("lone-wheelset"))


def slides(
    count: int, bears: float, axles: int = 1, before: float = BEFORE, idle: int = 0, after: int = 0
) -> tuple[FloatArray, FloatArray]:
    """z (ticks, 2, axles) and torque ratio (ticks, axles): slides on a rail that bears so much, and calm at the end;
    idle: ticks of coasting before each slide; after: ticks in which it is wet again, and as much is in use."""
    wet, sliding = track(12.0, torque_Nm=5000.0), track(4.0, curve="D", torque_Nm=4500.0)
    z = [part for _ in range(count) for part in (wet[: CALM + idle], sliding[:SLIDE], wet[:after])]
    ratio = np.repeat(
        [*(before, 1e-3, bears) * count, before], [*(CALM, idle, SLIDE + after) * count, 8 * PER_S]
    )  # fmt: skip
    both = np.concatenate((*z, wet[: 8 * PER_S]))
    return np.repeat(both, axles, axis=2), np.repeat(ratio[:, None], axles, axis=1)


def run(e: Estimator, z: FloatArray, ratio: FloatArray, first: int = 0) -> Estimate:
    e.run(Ticks(first, z, np.isfinite(z), ratio, [25.0] * len(z)), 0, len(z), True)
    return e.estimate()


def alone(design: Design) -> Estimate:
    z, ratio = slides(0, BEFORE)
    return run(Estimator(design, 1), z, ratio)


@pytest.mark.parametrize("bears", [0.12, 0.20, 0.60])
def test_slides_that_contradict_the_estimates_before_widen_the_interval(design: Design, bears: float) -> None:
    before, e = alone(design), Estimator(design, 1)
    found = run(e, *slides(6, bears))
    mu, (weight, _, _, bias) = float(before.mu_available_pct[0]), e.slides
    assert weight == pytest.approx(6.0, abs=0.4)
    assert bias == pytest.approx(min(math.log(mu / (100.0 * bears)), 0.7), abs=0.1)
    assert found.mu_available_pct[0] == pytest.approx(mu, rel=0.03)
    off = abs(1.0 - math.exp(-bias)) * mu
    assert found.half_width_pp[0] - before.half_width_pp[0] == pytest.approx(off, rel=0.1)


@pytest.mark.parametrize(
    "played",
    [
        lambda: slides(2, 0.12),  # too few
        lambda: slides(6, 0.33),  # as was said
        lambda: slides(6, 0.12, before=0.11),  # nothing more was asked for: the rail became worse
        lambda: slides(6, 0.12, idle=7 * PER_S),  # the estimate before is too old
        lambda: slides(6, 0.20, after=3 * PER_S),  # the rail has become better, and the estimate was late
    ],
)
def test_other_slides_widen_nothing(design: Design, played: Callable[[], tuple[FloatArray, FloatArray]]) -> None:
    e, (z, ratio) = Estimator(design, 1), played()
    found, before = run(e, z, ratio), run(Estimator(design, 1), z[-8 * PER_S :], ratio[-8 * PER_S :])
    assert e.slides[3] == 0.0
    assert found.half_width_pp[0] == pytest.approx(float(before.half_width_pp[0]), rel=0.05)


def test_axles_that_slide_together_tell_once_and_all_intervals_are_wider(design: Design) -> None:
    e, before = Estimator(design, 3), alone(design)
    z, ratio = slides(6, 0.12, axles=3)
    ratio[:, 2] = BEFORE
    found = run(e, z, ratio)
    assert e.slides[0] == pytest.approx(6.0, abs=0.4)
    assert np.all(found.half_width_pp > before.half_width_pp[0] + 10.0)


def test_where_most_is_in_use_the_estimate_is_known_without_the_rules(design: Design) -> None:
    e, before = Estimator(design, 1), Estimator(design, 1)
    z, ratio = slides(6, 0.12)
    run(e, z, ratio)
    sliding = track(4.0, curve="D", torque_Nm=4500.0)
    later = len(z), sliding, np.full((len(sliding), 1), 0.12)
    assert e.slides[3] > 0.0
    found, fresh = (run(of, *later[1:], first=later[0]) for of in (e, before))
    assert found.half_width_pp[0] == pytest.approx(float(fresh.half_width_pp[0]), abs=0.05)


def test_what_slides_revealed_outlasts_a_standstill(design: Design) -> None:
    e = Estimator(design, 1)
    run(e, *slides(6, 0.12))
    told = e.slides
    e.library.wrcd_reset(e.addresses[0], e.addresses[1], 0)
    assert e.slides == told
    assert told[3] > 0.0


def test_core_learns_from_slides_as_its_oracle(design: Design) -> None:
    e = SteppedEstimator(design, 1)
    both = Comparison(e)
    z, ratio = slides(4, 0.12)
    for k, row in enumerate(z):
        t = tick(k, row, float(ratio[k, 0]))
        both.stepped(t, e.step(t))
        if k % 97 == 0:
            both.estimated(e.estimate())
    assert len(both.oracle.slides.told) == 4
    assert both.oracle.slides.bias > 0.5


def test_slide_of_sensors_that_turn_out_broken_tells_nothing(design: Design) -> None:
    e, (z, ratio) = Estimator(design, 1), slides(6, 0.12)
    for k in range(6):
        first, slide = k * (CALM + SLIDE), k * (CALM + SLIDE) + CALM + PER_S
        run(e, z[first:slide], ratio[first:slide], first)
        e._axle["log_odds"][0, 1:] = 14.0  # as the health of the sensors says it
        run(e, z[slide : slide + 20], ratio[slide : slide + 20], slide)
        e._axle["log_odds"][0, 1:] = -14.0
        run(e, z[slide + 20 : first + CALM + SLIDE], ratio[slide + 20 : first + CALM + SLIDE], slide + 20)
    assert e.slides[0] == 0.0


@pytest.mark.parametrize(("total", "weight"), [(True, 3.0), (False, 0.0)])
def test_torque_that_is_not_all_of_it_tells_nothing(
    monkeypatch: pytest.MonkeyPatch, total: bool, weight: float
) -> None:
    """Of a train whose friction brakes are not on the bus: while it brakes the torque is a part."""
    config = replace(load_packaged(1, "lone-wheelset"), torque_is_total=total)
    z, ratio = slides(3, 0.12)
    monkeypatch.setattr(sensor_simulator, "measured", lambda: z[..., 0])
    sim, rises = SensorSimulator(config), np.convolve(ratio[:, 0], np.full(20, 1 / 20), "same")  # as no jump
    for r in rises:
        sim.torque = -float(r) * 2.0 * config.design.normal_N * config.design.r_0
        sim.core.feed(sim.frames())
    assert sim.core.estimator.slides[0] == pytest.approx(weight, abs=0.2)
