"""What gyros and accelerometers say and how they go together: filters and sums."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from tests.support.core_state import state
from wrcd.estimator.trust.pair import BANDS, BANDS_HZ, FOURTH_DIFFERENCE, Filters, PairSums

TICK_S, SPEED = 0.005, 25.0
NOISE = np.array([3e-4, 0.01])


def test_filters_are_butterworths_and_leave_white_noise_its_power() -> None:
    x = np.random.default_rng(1).standard_normal((20_000, 2, 2))
    f = Filters(TICK_S, 2)
    y = np.stack([f.step(row, np.ones(2, dtype=bool)) for row in x])
    for k, (low, high) in enumerate(BANDS_HZ):
        kind, corners = ("low", high) if low == 0.0 else ("band", (low, high))
        b, a = butter(1, corners, kind, fs=1 / TICK_S)
        expected = lfilter(b, a, x, axis=0)
        scale = y[-1, k, 0, 0] / expected[-1, 0, 0]
        np.testing.assert_allclose(y[:, k], scale * expected, rtol=1e-7, atol=1e-9)
    difference = np.array(FOURTH_DIFFERENCE) / np.linalg.norm(FOURTH_DIFFERENCE)
    np.testing.assert_allclose(y[4:, BANDS, 0, 0], np.convolve(x[:, 0, 0], difference, "valid"), atol=1e-9)
    assert np.square(y[1000:]).mean(axis=(0, 2, 3)) == pytest.approx(1.0, rel=0.15)


def test_span_has_powers_and_products_of_any_two_signals() -> None:
    rng = np.random.default_rng(2)
    common = rng.standard_normal(8000)
    z = NOISE[:, None] * rng.standard_normal((8000, 2, 2))
    z[:, 0, 0] += 3.0 * NOISE[0] * common
    z[:, 1, 1] -= 2.0 * NOISE[1] * common
    pairs = PairSums(NOISE, TICK_S, 2, 2.5)
    for row in z:
        pairs.step(row, np.array([True, True]))
    span = pairs.take(SPEED)
    assert span.ticks.tolist() == [8000.0, 8000.0]
    # gyro 1, gyro 2, accelerometer 1, accelerometer 2
    together = span.together[2, 0].reshape(4, 4)
    assert together.diagonal() == pytest.approx([10.0, 1.0, 1.0, 5.0], rel=0.15)
    assert together[0, 3] == pytest.approx(-6.0, rel=0.15)
    assert together[0, 1] == pytest.approx(0.0, abs=0.3)
    assert span.fine[:, 0] == pytest.approx([10.0, 1.0], rel=0.15)
    assert span.variance[:, 1] == pytest.approx([1.0, 5.0], rel=0.15)
    assert pairs.take(SPEED).ticks.tolist() == [0.0, 0.0]


def test_axle_without_data_counts_for_nothing_and_disturbs_nobody() -> None:
    z = NOISE[:, None] * np.random.default_rng(3).standard_normal((1000, 2, 2))
    both, alone = PairSums(NOISE, TICK_S, 2, 2.5), PairSums(NOISE, TICK_S, 1, 2.5)
    for row in z:
        both.step(np.where([True, False], row, np.nan), np.array([True, False]))
        alone.step(row[:, :1], np.array([True]))
    a, b = both.take(SPEED), alone.take(SPEED)
    assert a.ticks.tolist() == [1000.0, 0.0]
    np.testing.assert_allclose(a.together[..., 0, :, 0], b.together[..., 0, :, 0])
    assert not a.together[..., 1, :, :].any()
    assert not a.together[..., 1].any()
    np.testing.assert_allclose(a.variance[:, :1], b.variance)


def test_any_number_is_taken() -> None:
    pairs = PairSums(NOISE, TICK_S, 1, 2.5)
    for value in (1e300, -1e300, 0.0, 1e-300):
        pairs.step(np.full((2, 1), value), np.array([True]))
    assert np.isfinite(pairs.take(SPEED).together).all()


def test_signals_of_two_axles_are_compared_a_wheelbase_apart() -> None:
    later = round(2.5 / SPEED / TICK_S)
    track = np.random.default_rng(4).standard_normal(6000 + later)
    z = NOISE[:, None] * np.random.default_rng(5).standard_normal((6000, 2, 2))
    z[:, 0, 0] += 3.0 * NOISE[0] * track[later:]
    z[:, 1, 1] += 2.0 * NOISE[1] * track[:-later]  # the second axle comes there later
    pairs = PairSums(NOISE, TICK_S, 2, 2.5)
    pairs.take(SPEED)
    for row in z:
        pairs.step(row, np.array([True, True]))
    span = pairs.take(SPEED)
    # accelerometer of the second axle now, gyro of the first one a wheelbase ago
    assert span.apart[2, 0, 1, 1, 0, 0] == pytest.approx(6.0, rel=0.15)
    assert span.apart[2, 0, 0, 0, 1, 1] == pytest.approx(0.0, abs=0.6)
    assert span.together[2, 0, 1, 1, 0, 0] == pytest.approx(0.0, abs=0.6)


def test_reset_axle_beside_a_running_one_begins_as_a_new_one() -> None:
    """Whatever it said before."""
    z = NOISE[:, None] * np.random.default_rng(3).standard_normal((2400, 2, 2)) + [[0.3], [5.0]]
    used, both = np.array([True, False]), np.ones(2, dtype=bool)
    old, new = PairSums(NOISE, TICK_S, 2, 2.5), PairSums(NOISE, TICK_S, 2, 2.5)
    for row in z[:500]:
        old.step(row, both)
        new.step(row, used)
    old.reset(1)
    for k, row in enumerate(z[500:]):
        for pairs in (old, new):
            pairs.step(row, used if k < 800 else both)
    assert state(old) == state(new)
