"""How noisy the sensors are, measured from what they say."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.c_parts import NoiseLevel
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.signals import measured
from wrcd.core.design import BoolArray, FloatArray, load_design

RMS = np.array([3e-4, 0.01])
TICKS = 6000
MIN_FACTOR, MAX_FACTOR = 0.1, 2.2


def noise_level(axles: int) -> NoiseLevel:
    return NoiseLevel(axles, replace(load_design(LONE_DESIGN), noise_rms=RMS))


def levels(z: FloatArray, used: BoolArray | None = None) -> FloatArray:
    """The factors (ticks, 2) of one axle that says z (ticks, 2)."""
    level, out = noise_level(1), []
    for k, row in enumerate(z):
        level.step(row[:, None], np.array([used is None or bool(used[k])]))
        out.append(level.factor[:, 0])
    return np.array(out)


def white(factor: float, ticks: int = TICKS, seed: int = 1) -> FloatArray:
    return np.asarray(factor * RMS * np.random.default_rng(seed).standard_normal((ticks, 2)))


@pytest.mark.parametrize("factor", [0.5, 0.67, 1.0, 1.5, 2.0])
def test_white_noise_is_measured_within_three_percent(factor: float) -> None:
    found = levels(white(factor))[1000:]
    assert found.mean(axis=0) == pytest.approx([factor, factor], rel=0.03)
    assert np.abs(found / factor - 1.0).max() < 0.2  # at every moment, from 400 differences that overlap


@pytest.mark.parametrize("kind", ["mems", "tactical"])
@pytest.mark.parametrize("curve", ["A", "F"])
def test_track_does_not_raise_the_noise_level(kind: str, curve: str) -> None:
    """Beside a gyro six times as good as the design's, steps of its signal and a little of the track are noise, too."""
    found = levels(measured(curve, 3000.0, seconds=20.0, sensors=kind))[1000:].mean(axis=0)
    expected, within = ((1.0, 1.0), (0.06, 0.06)) if kind == "mems" else ((5e-5 / 3e-4, 0.005 / 0.01), (0.3, 0.06))
    assert np.all(np.abs(found / expected - 1.0) < within)


def test_noise_level_starts_at_the_designs_and_follows_within_seconds() -> None:
    found = levels(np.concatenate((white(1.0), white(2.0, seed=2))))
    assert found[0] == pytest.approx([1.0, 1.0])
    assert found[TICKS + 1200 :].mean(axis=0) == pytest.approx([2.0, 2.0], rel=0.05)
    assert found[TICKS + 100].max() < 1.6


def test_joints_do_not_move_the_noise_level() -> None:
    z = white(1.0)
    calm = levels(z)
    z[1000::200, 1] += 2.0
    z[1001::200, 1] -= 2.0
    found = levels(z)[1000:]
    assert found[:, 1].mean() < 1.25
    assert np.array_equal(found[:, 0], calm[1000:, 0])


def test_missing_tick_breaks_the_chain_of_differences() -> None:
    """A sample that is not used, whatever it holds, is in no difference; nor is what spans the gap."""
    rng = np.random.default_rng(4)
    z, used = white(1.0), rng.random(TICKS) > 0.1
    z[~used] = np.nan
    z += np.cumsum(~used)[:, None] * 100.0 * RMS  # after each gap the signal is elsewhere
    assert levels(z, used)[1000:].mean(axis=0) == pytest.approx([1.0, 1.0], rel=0.04)


def test_vibration_counts_as_the_designs_noise() -> None:
    level = noise_level(3)
    for row in white(1.0):
        level.step(np.stack((row, 2.6 * row, 10.0 * row), axis=1), np.ones(3, dtype=bool))
    true, mixed, vibrating = level.sensor_factor().T
    assert true == pytest.approx([1.0, 1.0], rel=0.15)
    assert np.all((mixed > 1.0) & (mixed < MAX_FACTOR))  # it goes back without a step
    assert np.array_equal(vibrating, [1.0, 1.0])
    assert level.factor[:, 2] == pytest.approx([10.0, 10.0], rel=0.15)


def test_frozen_signal_is_not_taken_for_a_noiseless_sensor() -> None:
    level = noise_level(1)
    for _ in range(TICKS):
        level.step(np.array([[0.02], [0.3]]), np.array([True]))
    assert np.array_equal(level.sensor_factor(), [[MIN_FACTOR], [MIN_FACTOR]])


def test_a_reset_axle_is_as_new() -> None:
    level, fresh = noise_level(2), noise_level(1)
    yes = np.ones(2, dtype=bool)
    for row in white(2.0):
        level.step(np.stack((row, row), axis=1), yes)
    before = level.factor[:, 1].copy()
    level.reset(0)
    assert np.array_equal(level.factor, np.stack((np.ones(2), before), axis=1))
    for row in white(0.5, 300, seed=3):
        level.step(np.stack((row, row), axis=1), yes)
        fresh.step(row[:, None], yes[:1])
    assert np.array_equal(level.factor[:, :1], fresh.factor)
