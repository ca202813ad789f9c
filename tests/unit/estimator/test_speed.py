"""The filtered speed: smooth, without lag, and quick to believe another train."""

import math

import numpy as np
import pytest

from wrcd.estimator.design import FloatArray
from wrcd.estimator.speed import MAX_ERROR_M_S, SpeedFilter

TICK_S = 0.005
CYCLE = 4  # ticks between two messages of the speed


def filtered(signal: FloatArray) -> FloatArray:
    f = SpeedFilter(TICK_S)
    return np.array([f.step(float(v)) for v in signal])


def held(signal: FloatArray) -> FloatArray:
    """As the bus tells it: the newest of every CYCLE ticks."""
    return signal[np.arange(len(signal)) // CYCLE * CYCLE]


@pytest.mark.parametrize("rate_m_s2", [-1.2, 0.8, 2.0])
def test_filtered_speed_has_no_lag_on_a_ramp(rate_m_s2: float) -> None:
    true = np.asarray(40.0 + rate_m_s2 * TICK_S * np.arange(2400), np.float64)
    assert filtered(true)[1200:] == pytest.approx(true[1200:], abs=0.005)
    # of a signal that comes every 20 ms half a cycle's lag is its own
    late = held(true) - true
    assert filtered(held(true))[1200:] == pytest.approx(true[1200:] + late.mean(), abs=0.01)


def test_filtered_speed_has_less_noise() -> None:
    rng = np.random.default_rng(1)
    noise = held(0.03 * rng.standard_normal(20_000))
    out = filtered(25.0 + noise)[1000:] - 25.0
    assert out.std() < 0.35 * noise.std()
    assert np.abs(np.diff(out)).max() < 0.05 * np.abs(np.diff(noise)).max()
    assert abs(out.mean()) < 0.002


def test_steps_of_a_coarse_signal_are_smoothed() -> None:
    """A signal in steps of 0.1 km/h, on a train that brakes gently."""
    true = np.asarray(25.0 - 0.3 * TICK_S * np.arange(4000), np.float64)
    step = 0.1 / 3.6
    out = filtered(np.asarray(np.round(held(true) / step) * step))[1000:]
    assert out == pytest.approx(true[1000:], abs=0.6 * step)
    assert np.abs(np.diff(out)).max() < 0.1 * step


def test_the_first_signal_is_the_speed() -> None:
    assert filtered(np.full(3, 31.4)) == pytest.approx([31.4] * 3)


def test_a_change_of_speed_is_followed() -> None:
    """From a steady speed to a braking at 1.2 m/s2: a hundredth of the speed behind at the most, and then no more."""
    t = TICK_S * np.arange(4000)
    true = 30.0 - np.where(t > 5.0, 1.2 * (t - 5.0), 0.0)
    assert np.abs(filtered(true) - true).max() < 0.25
    assert np.abs(filtered(true) - true)[1600:].max() < 0.005


@pytest.mark.parametrize("jump", [-8.0, 2.0])
def test_speed_jump_restarts_the_filter(jump: float) -> None:
    signal = np.full(600, 25.0)
    signal[300:] += jump
    out = filtered(signal)
    assert abs(jump) > MAX_ERROR_M_S
    assert out[300:] == pytest.approx(signal[300:])


def test_rate_from_before_a_speed_jump_is_dropped() -> None:
    ramp = 20.0 + 2.0 * TICK_S * np.arange(1000)
    out = filtered(np.concatenate((ramp, np.full(400, 50.0))))
    assert out[1000:] == pytest.approx(np.full(400, 50.0))


def test_missing_speed_is_unknown_then_restarts_the_filter() -> None:
    f = SpeedFilter(TICK_S)
    for _ in range(100):
        f.step(25.0)
    assert math.isnan(f.step(math.nan))
    assert math.isnan(f.step(math.inf))
    assert f.step(26.0) == 26.0
    assert f.step(26.0) == 26.0
