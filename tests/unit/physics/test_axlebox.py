"""What an axle box feels beyond the track's spectrum: vibration in its band, joints and a crossing at their places."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from sim_ecu.physics.axlebox import CROSSING, AxleBox, AxleBoxStream, FloatArray

TICK_S = 0.005
GYRO, LATERAL = 0, 1


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def ride(speed_m_s: float, seconds: float) -> tuple[FloatArray, FloatArray]:
    """Distance and speed at the end of each sample."""
    n = round(seconds / TICK_S)
    return speed_m_s * TICK_S * np.arange(1.0, n + 1.0), np.full(n, speed_m_s, dtype=np.float64)


def test_default_axle_box_adds_nothing_and_draws_no_random_number() -> None:
    used, fresh = rng(), rng()
    assert not AxleBox().felt(*ride(25.0, 2.0), TICK_S, used).any()
    assert AxleBox().quiet
    AxleBox(crossing_m_s2=1.0).felt(*ride(25.0, 2.0), TICK_S, used)
    assert used.random() == fresh.random()


@pytest.mark.parametrize("band", [(20.0, 100.0), (0.0, 100.0), (20.0, 500.0), (5.0, 15.0)])
def test_vibration_has_its_rms_and_stays_in_its_band(band: tuple[float, float]) -> None:
    felt = AxleBox(vibration_m_s2=0.3, band_hz=band, gyro_per_m_s2=0.004).felt(*ride(20.0, 200.0), TICK_S, rng())
    # at the seams between its pieces too
    assert felt.std(axis=0) == pytest.approx([0.3 * 0.004, 0.3], rel=0.02)
    f, power = (np.asarray(a) for a in welch(felt[:, LATERAL], fs=1 / TICK_S, nperseg=2000, detrend=False))
    outside = (f < band[0] - 1) | (f > min(band[1], 100.0) + 1)
    inside = (f > band[0] + 1) & (f < min(band[1], 100.0) - 1)
    assert power[inside].mean() == pytest.approx(0.3**2 / (min(band[1], 100.0) - band[0]), rel=0.05)
    assert power[outside].sum() <= 1e-6 * power.sum()
    # the gyro vibrates by itself
    assert abs(np.corrcoef(felt[:, GYRO], felt[:, LATERAL])[0, 1]) < 0.05


def test_a_narrow_band_of_a_short_ride_still_vibrates() -> None:
    several = [
        AxleBox(vibration_m_s2=1.0, band_hz=(30.0, 30.5)).felt(*ride(20.0, 0.2), TICK_S, rng(k)) for k in range(99)
    ]
    assert np.sqrt(np.mean([f[:, LATERAL] ** 2 for f in several])) == pytest.approx(1.0, rel=0.2)


@pytest.mark.parametrize("speed", [10.0, 25.0, 60.0])
def test_a_joint_comes_every_25_m_with_its_peak_and_duration(speed: float) -> None:
    """Bipolar: as much to one side as to the other, so a joint leaves no step in the lateral velocity."""
    distance, v = ride(speed, 1000.0 / speed)
    felt = AxleBox(joint_m_s2=2.0).felt(distance, v, TICK_S, rng())[:, LATERAL]
    struck = np.flatnonzero(felt)
    begins = distance[struck[np.diff(struck, prepend=-99) > 1]]
    assert len(begins) in (40, 41)
    assert np.diff(begins) == pytest.approx(25.0, abs=1.01 * speed * TICK_S)
    assert 1.7 < np.abs(felt).max() <= 2.0
    # 30 ms in samples of 5 ms: six or, cut at both ends, seven
    assert 6 * (len(begins) - 1) <= len(struck) <= 7 * len(begins)
    whole = felt[struck[0] : struck[0] + 8]
    assert whole.sum() == pytest.approx(0.0, abs=1e-9)


def test_a_unipolar_joint_leaves_the_step_that_half_a_sine_has() -> None:
    distance, v = ride(25.0, 4.0)
    felt = AxleBox(joint_m_s2=2.0, joint_shape="unipolar").felt(distance, v, TICK_S, rng())[:, LATERAL]
    first = np.flatnonzero(felt)[0]
    assert abs(felt[first : first + 8].sum() * TICK_S) == pytest.approx(2.0 * 0.03 * 2 / math.pi, rel=1e-9)


def test_the_gyro_feels_the_same_pulses() -> None:
    felt = AxleBox(joint_m_s2=2.0, gyro_per_m_s2=0.003).felt(*ride(25.0, 4.0), TICK_S, rng())
    assert felt[:, GYRO] == pytest.approx(0.003 * felt[:, LATERAL])


def test_joints_closer_than_a_pulse_add_up() -> None:
    """At 60 m/s a pulse of 30 ms lasts 1.8 m: of joints every metre two are felt at a time."""
    box = AxleBox(joint_m_s2=1.0, joint_every_m=1.0, joint_shape="unipolar")
    felt = box.felt(*ride(60.0, 5.0), TICK_S, rng())[100:, LATERAL]
    # one joint's gathered push times 60 joints a second
    assert abs(felt.mean()) == pytest.approx(60 * 0.03 * 2 / math.pi, rel=0.01)


def test_a_crossing_is_one_burst_at_its_place() -> None:
    distance, v = ride(20.0, 10.0)
    felt = AxleBox(crossing_m_s2=8.0, crossing_at_m=100.0).felt(distance, v, TICK_S, rng())[:, LATERAL]
    struck = distance[felt != 0]
    assert struck.min() == pytest.approx(100.0, abs=0.11)
    assert struck.max() == pytest.approx(100.0 + CROSSING[-1][0] + 20.0 * 0.03, abs=0.11)
    assert 5.0 < np.abs(felt).max() < 12.0


def test_standing_on_a_joint_feels_nothing() -> None:
    box = AxleBox(joint_m_s2=2.0, crossing_m_s2=2.0, crossing_at_m=3.0)
    assert not box.felt(np.full(200, 3.0), np.zeros(200), TICK_S, rng()).any()


def test_blocks_do_not_matter() -> None:
    box = AxleBox(vibration_m_s2=0.1, joint_m_s2=1.0, crossing_m_s2=4.0, crossing_at_m=40.0)
    distance, v = ride(25.0, 90.0)  # three pieces of vibration
    whole = box.felt(distance, v, TICK_S, rng())
    stream = AxleBoxStream(box, TICK_S, rng())
    parts = [stream.next(distance[k : k + 30], v[k : k + 30]) for k in range(0, len(distance), 30)]
    assert np.array_equal(whole, np.concatenate(parts))


@pytest.mark.parametrize(
    "wrong", [{"joint_shape": "square"}, {"band_hz": (50.0, 20.0)}, {"joint_s": 0.0}, {"joint_every_m": -25.0}]
)
def test_senseless_vibration_is_rejected(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        AxleBox(**wrong)


def test_a_band_beyond_the_nyquist_frequency_is_refused() -> None:
    with pytest.raises(ValueError, match="Nyquist"):
        AxleBox(vibration_m_s2=0.1, band_hz=(150.0, 300.0)).felt(*ride(20.0, 1.0), TICK_S, rng())


def test_corrugation_lies_at_its_place_and_shakes_with_the_square_of_the_speed() -> None:
    """Sampled at 4 kHz: 50 mm at 25 m/s are 500 Hz."""
    tick_s = 1 / 4000
    box = AxleBox(corrugation_m_s2=10.0, corrugation_wavelength_m=0.05, corrugation_m=(50.0, 75.0))

    def at(speed: float) -> tuple[FloatArray, FloatArray]:
        distance = speed * tick_s * np.arange(1.0, 100.0 / (speed * tick_s) + 1.0)
        return distance, box.felt(distance, np.full(len(distance), speed), tick_s, rng())[:, LATERAL]

    distance, felt = at(25.0)
    shaken = distance[felt != 0]
    assert [shaken.min(), shaken.max()] == pytest.approx([50.0, 75.0], abs=0.02)
    f, power = (np.asarray(a) for a in welch(felt[felt != 0], fs=4000, nperseg=400))
    assert f[power.argmax()] == 500.0
    rms = felt[felt != 0].std()
    assert rms == pytest.approx(10.0 / math.sqrt(2) * np.sinc(500 / 4000), rel=0.01)
    slow = at(12.5)[1]
    assert slow[slow != 0].std() == pytest.approx(0.25 * 10.0 / math.sqrt(2) * np.sinc(250 / 4000), rel=0.02)


def test_a_flat_strikes_once_a_turn() -> None:
    tick_s = 1 / 4000
    distance = 20.0 * tick_s * np.arange(1.0, 4001.0)
    felt = AxleBox(flat_m_s2=50.0).felt(distance, np.full(4000, 20.0), tick_s, rng())[:, LATERAL]
    begins = distance[np.flatnonzero(np.diff((felt != 0).astype(int)) == 1)]
    assert len(begins) in (6, 7)
    assert np.diff(begins) == pytest.approx(math.pi, abs=0.011)
    assert 45.0 < felt.max() <= 50.0
    # 4 ms are 16 inner samples; in samples of 5 ms little is left of the sine period
    assert np.count_nonzero(felt) / len(begins) == pytest.approx(16.5, abs=2.0)
    coarse = AxleBox(flat_m_s2=50.0).felt(*ride(20.0, 4.0), TICK_S, rng())[:, LATERAL]
    assert 0.0 < np.abs(coarse).max() < 15.0


def test_vibration_may_rise_with_frequency() -> None:
    box = AxleBox(vibration_m_s2=30.0, band_hz=(20.0, 1000.0), vibration_power=2.0)
    distance = 0.005 * np.arange(0.0, 40_000.0)
    felt = box.felt(distance, np.full(40_000, 20.0), 1 / 4000, rng())[:, LATERAL]
    assert felt.std() == pytest.approx(30.0, rel=0.02)
    f, power = (np.asarray(a) for a in welch(felt, fs=4000, nperseg=1000))
    at = [power[np.abs(f - hz) < 40].mean() for hz in (200.0, 800.0)]
    assert at[1] / at[0] == pytest.approx(16.0, rel=0.1)
