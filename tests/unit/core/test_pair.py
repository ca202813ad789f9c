"""What gyros and accelerometers say and how they go together: filters and sums."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfreqz

from tests.support.c_parts import Pairs
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd.core.design import load_design
from wrcd.core.design_members import BANDS_HZ, band_filters
from wrcd.core.terms import COLUMNS

TICK_S, SPEED, WHEELBASE_TICKS = 0.005, 25.0, 20
NOISE = np.array([3e-4, 0.01])
FINE, POWER, CROSS, APART = slice(1, 3), slice(7, 13), slice(13, 16), slice(16, 22)
THEIRS, ACROSS, NOW = slice(22, 28), slice(28, 52), slice(52, 58)


def pairs_of(axles: int) -> Pairs:
    design = replace(load_design(LONE_DESIGN), noise_rms=NOISE)
    assert (design.tick_s, round(design.wheelbase_m / SPEED / TICK_S)) == (TICK_S, WHEELBASE_TICKS)
    return Pairs(axles, design)


def test_filters_are_butterworths_that_leave_white_noise_its_power() -> None:
    for section, (low, high) in zip(band_filters(TICK_S), BANDS_HZ, strict=True):
        kind, corners = ("low", high) if low == 0.0 else ("band", (low, high))
        _, expected = sosfreqz(butter(1, corners, kind, fs=1 / TICK_S, output="sos"))
        np.testing.assert_allclose(sosfreqz(section[None])[1], expected, atol=1e-9)
    z = NOISE[:, None] * np.random.default_rng(1).standard_normal((20_000, 2, 2))
    pairs = pairs_of(2)
    for row in z:
        pairs.step(row, [True, True])
    mean = pairs.total / len(z)
    assert mean[:, POWER] == pytest.approx(np.ones((2, 6)), rel=0.2)
    assert mean[:, THEIRS] == pytest.approx(mean[::-1, POWER])
    assert mean[:, FINE] == pytest.approx(np.ones((2, 2)), rel=0.1)


def test_products_are_of_the_two_signals_of_a_pair() -> None:
    rng = np.random.default_rng(2)
    common = rng.standard_normal(8000)
    z = NOISE[:, None] * rng.standard_normal((8000, 2, 2))
    z[:, 0, 0] += 3.0 * NOISE[0] * common
    z[:, 1, 0] -= 2.0 * NOISE[1] * common
    pairs = pairs_of(2)
    for row in z:
        pairs.step(row, [True, True])
    mean = pairs.total / len(z)
    assert mean[0, POWER][4:] == pytest.approx([10.0, 5.0], rel=0.15)  # of the highest band
    assert mean[0, CROSS][2] == pytest.approx(-6.0, rel=0.15)
    assert mean[1, CROSS][2] == pytest.approx(0.0, abs=0.3)
    assert mean[:, ACROSS] == pytest.approx(np.zeros((2, 24)), abs=0.6)


def test_axle_without_data_counts_for_nothing_and_disturbs_nobody() -> None:
    z = NOISE[:, None] * np.random.default_rng(3).standard_normal((1000, 2, 2))
    both, alone = pairs_of(2), pairs_of(1)
    for row in z:
        both.step(np.where([True, False], row, np.nan), [True, False])
        alone.step(row[:, :1], [True])
    assert both.total[:, 0].tolist() == [1000.0, 0.0]
    np.testing.assert_array_equal(both.total[0], alone.total[0])
    assert not both.total[1, : THEIRS.start].any()


def test_any_number_is_taken() -> None:
    pairs = pairs_of(1)
    for value in (1e300, -1e300, 0.0, 1e-300):
        pairs.step(np.full((2, 1), value), [True])
    assert np.isfinite(pairs.total).all()


def test_signals_of_two_axles_are_compared_a_wheelbase_apart() -> None:
    later = WHEELBASE_TICKS
    track = np.random.default_rng(4).standard_normal(6000 + later)
    z = NOISE[:, None] * np.random.default_rng(5).standard_normal((6000, 2, 2))
    z[:, 0, 0] += 3.0 * NOISE[0] * track[later:]
    z[:, 1, 1] += 2.0 * NOISE[1] * track[:-later]  # the second axle comes there later
    pairs = pairs_of(2)
    pairs.look(SPEED, np.zeros(2), np.zeros((2, COLUMNS)))
    for row in z:
        pairs.step(row, [True, True])
    # accelerometer of the second axle now, gyro of the first one a wheelbase ago
    across = (pairs.total / len(z))[:, ACROSS].reshape(2, 2, 4, 3)[..., 2]  # axle, way, signals, of the highest band
    expected = np.zeros((2, 2, 4))
    expected[1, 0, 3] = expected[0, 1, 2] = 6.0
    assert across == pytest.approx(expected, rel=0.15, abs=0.6)


def test_a_late_signal_and_swapped_wires_are_in_products_of_their_own() -> None:
    later = WHEELBASE_TICKS
    rng = np.random.default_rng(6)
    late, swapped = rng.standard_normal((2, 6000 + later))
    z = NOISE[:, None] * rng.standard_normal((6000, 2, 2))
    z[:, 0, 0] += 3.0 * NOISE[0] * late[:-later]  # the first axle's gyro comes a wheelbase later than its accelerometer
    z[:, 1, 0] += 2.0 * NOISE[1] * late[later:]
    z[:, 0, 1] += 3.0 * NOISE[0] * swapped[later:]  # the second one's gyro goes with the first one's accelerometer
    z[:, 1, 0] += 2.0 * NOISE[1] * swapped[later:]
    pairs = pairs_of(2)
    pairs.look(SPEED, np.zeros(2), np.zeros((2, COLUMNS)))
    for row in z:
        pairs.step(row, [True, True])
    mean = pairs.total / len(z)
    apart, now = (mean[:, at].reshape(2, 2, 3)[..., 2] for at in (APART, NOW))  # axle, way, of the highest band
    assert apart == pytest.approx(np.array([[6.0, 0.0], [0.0, 0.0]]), rel=0.15, abs=0.6)
    assert now == pytest.approx(np.array([[0.0, 6.0], [6.0, 0.0]]), rel=0.15, abs=0.6)


def test_reset_axle_beside_a_running_one_begins_as_a_new_one() -> None:
    """Whatever it said before."""
    z = NOISE[:, None] * np.random.default_rng(3).standard_normal((2400, 2, 2)) + [[0.3], [5.0]]
    used, both = [True, False], [True, True]
    old, new = pairs_of(2), pairs_of(2)
    for row in z[:500]:
        old.step(row, both)
        new.step(row, used)
    old.reset(1)
    for k, row in enumerate(z[500:]):
        for pairs in (old, new):
            pairs.step(row, used if k < 800 else both)
    assert old.estimator.state == new.estimator.state
