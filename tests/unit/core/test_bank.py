"""The bank between the design's speeds; the filtered speed: smooth, without lag, and quick to believe another train."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.resources import PAPER_DESIGN
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.stepped import SteppedEstimator, Tick
from wrcd.checksum import checksum
from wrcd.core.design import MAX_STATES, STATES, FloatArray, load_design, parse_design
from wrcd.core.terms import MODELS
from wrcd.errors import InputError

MAX_ERROR_M_S = 1.5


@pytest.mark.parametrize("file", [LONE_DESIGN, PAPER_DESIGN], ids=["wrcd", "paper"])
def test_every_filter_forgets_at_every_speed(file: Path) -> None:
    """An axle's first measurement is its offset: it is predicted from what is known, here one state each."""
    design = load_design(file)
    for speed in np.arange(design.speeds_m_s[0], 1.3 * design.speeds_m_s[-1], 0.37):
        e = SteppedEstimator(design, STATES)
        x = np.zeros((STATES, MODELS, MAX_STATES))
        x[np.arange(STATES), :, np.arange(STATES)] = 1.0
        e._axle["bank_x"] = x.reshape(STATES, -1)
        here = np.ones((2, STATES), dtype=bool)
        e.step(Tick(0, np.zeros((2, STATES)), here, np.zeros(STATES), float(speed)))
        after = e._axle["bank_x"].reshape(STATES, MODELS, MAX_STATES)[..., :STATES].transpose(1, 2, 0)
        decay = np.abs(np.linalg.eigvals(after)).max(axis=1)
        assert (decay < 1.0).all(), (speed, decay)
        assert decay.max() > 0.5


def test_unstable_kalman_filter_is_rejected() -> None:
    document: dict[str, Any] = json.loads(LONE_DESIGN.read_text())
    K = np.array(document["bank"]["K"])
    K[7, 3] *= -1.0
    document["bank"]["K"] = K.tolist()
    document["checksum"] = checksum(document)
    with pytest.raises(InputError, match=r"bank\.K: "):
        parse_design(document, "x.json")


TICK_S = 0.005
CYCLE = 4  # ticks between two messages of the speed


class SpeedFilter:
    """The estimator's, of a train that moves and measures nothing."""

    def __init__(self) -> None:
        self._estimator, self._ticks = SteppedEstimator(load_design(LONE_DESIGN), 1), 0
        assert self._estimator.design.tick_s == TICK_S

    def step(self, speed_m_s: float) -> float:
        nothing = np.full((2, 1), np.nan)
        self._estimator.step(Tick(self._ticks, nothing, np.zeros((2, 1), dtype=bool), nothing[0], speed_m_s))
        self._ticks += 1
        return float(self._estimator._train["speed_m_s"])


def filtered(signal: FloatArray) -> FloatArray:
    f = SpeedFilter()
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


def test_a_change_of_speed_is_followed() -> None:
    """From a steady speed to a braking at 1.2 m/s2: a hundredth of the speed behind at the most, and then no more."""
    t = TICK_S * np.arange(4000)
    true = 30.0 - np.where(t > 5.0, 1.2 * (t - 5.0), 0.0)
    assert np.abs(filtered(true) - true).max() < 0.25
    assert np.abs(filtered(true) - true)[1600:].max() < 0.005


@pytest.mark.parametrize(
    ("before", "speed_m_s"),
    [
        (np.empty(0), 31.4),  # the first signal is the speed
        (np.full(300, 25.0), 17.0),
        (np.full(300, 25.0), 27.0),
        (20.0 + 2.0 * TICK_S * np.arange(1000), 50.0),  # the rate from before is dropped
    ],
    ids=["first", "down", "up", "after a ramp"],
)
def test_speed_jump_restarts_the_filter(before: FloatArray, speed_m_s: float) -> None:
    assert not len(before) or abs(speed_m_s - before[-1]) > MAX_ERROR_M_S
    after = np.full(400, speed_m_s)
    assert filtered(np.concatenate((before, after)))[len(before) :] == pytest.approx(after)


def test_missing_speed_is_unknown_then_restarts_the_filter() -> None:
    f = SpeedFilter()
    for _ in range(100):
        f.step(25.0)
    assert math.isnan(f.step(math.nan))
    assert math.isnan(f.step(math.inf))
    assert f.step(26.0) == 26.0
    assert f.step(26.0) == 26.0
