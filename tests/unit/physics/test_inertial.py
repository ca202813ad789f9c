"""Inner sampling of gyro and accelerometer, their mounting, and what they misread."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from sim_ecu.physics.axlebox import FRAME_SHARE, QUIET, AxleBox, FloatArray, drawn_box
from sim_ecu.physics.inertial import InertialStream
from sim_ecu.physics.sensors import BOGIE_FRAME, RECTIFICATION, SENSOR_SETS, G, Sampling, SensorSet, drawn
from sim_ecu.physics.wheelset import FRAME_LAT_ACCEL, FRAME_YAW_RATE, LAT_ACCEL, OUTPUTS, ROLL_RATE, YAW_RATE

TICK_S = 0.005
GYRO, LATERAL = 0, 1
MEMS = SENSOR_SETS["mems"]
CLEAN = Sampling(range_m_s2=1e6, rectification=0.0)  # neither clips nor rectifies


def sampling(**changes: Any) -> SensorSet:
    return replace(MEMS, sampling=replace(CLEAN, **changes))


def outputs(samples: int, **columns: float | FloatArray) -> FloatArray:
    """What a simulation gives, nothing but these columns."""
    places = {"yaw": YAW_RATE, "lateral": LAT_ACCEL, "roll": ROLL_RATE,
              "frame_yaw": FRAME_YAW_RATE, "frame_lateral": FRAME_LAT_ACCEL}  # fmt: skip
    out = np.zeros((samples, OUTPUTS))
    for name, values in columns.items():
        out[:, places[name]] = values
    return out


def feel(
    sensors: SensorSet, y: FloatArray, box: AxleBox = QUIET, speed_m_s: float = 20.0, seed: int = 1
) -> tuple[FloatArray, InertialStream]:
    """The pair's samples (t, 2) at a held speed."""
    stream = InertialStream(sensors, box, TICK_S, np.random.default_rng(seed))
    n = len(y)
    return stream.next(y, speed_m_s * TICK_S * np.arange(1.0, n + 1.0), np.full(n, speed_m_s)), stream


def amplitude_at(hz: float, x: FloatArray) -> float:
    t = TICK_S * np.arange(len(x))
    return float(2 * abs(np.mean(x * np.exp(-2j * math.pi * hz * t))))


def noise(samples: int, size: float = 1.0) -> FloatArray:
    return np.asarray(size * np.random.default_rng(5).standard_normal(samples))


def test_plain_pair_gives_the_simulations_means() -> None:
    y = outputs(50, yaw=noise(50), lateral=noise(50, 3.0))
    felt, _ = feel(MEMS, y)
    assert np.array_equal(felt, y[:, [YAW_RATE, LAT_ACCEL]])


def test_inner_sampling_with_a_far_corner_gives_the_simulations_means() -> None:
    """The hold neither delays nor folds; a near corner takes what lies above it."""
    y = outputs(400, yaw=noise(400), lateral=noise(400, 3.0))
    assert feel(sampling(corner_hz=1000.0), y)[0] == pytest.approx(y[:, [YAW_RATE, LAT_ACCEL]], abs=1e-6)
    assert feel(sampling(corner_hz=20.0), y)[0].std(axis=0) == pytest.approx([0.45, 1.35], rel=0.2)


def test_low_pass_begins_settled() -> None:
    felt, _ = feel(sampling(corner_hz=5.0, order=4), outputs(10, yaw=0.3, lateral=-2.0))
    assert felt == pytest.approx(np.tile([0.3, -2.0], (10, 1)))


def test_clipping_is_at_the_inner_rate_and_counted() -> None:
    """Vibration far above the low-pass clips, though what is handed on stays small."""
    box = AxleBox(vibration_m_s2=30.0, band_hz=(500.0, 1000.0))
    felt, stream = feel(sampling(range_m_s2=2 * G, corner_hz=40.0, order=4), outputs(2000), box)
    # of a Gaussian, so much lies beyond 2 g
    assert stream.clipped / (2000 * 20) == pytest.approx(math.erfc(2 * G / 30.0 / math.sqrt(2)), rel=0.05)
    assert np.abs(felt[:, LATERAL]).max() < 2 * G
    assert feel(sampling(corner_hz=40.0), outputs(2000), box)[1].clipped == 0
    held, stream = feel(sampling(range_m_s2=20.0), outputs(10, lateral=30.0))
    assert stream.clipped == 10 * 20
    assert held[-1, LATERAL] == pytest.approx(20.0, abs=1e-3)


def test_clipping_to_one_side_leaves_an_offset() -> None:
    box = AxleBox(vibration_m_s2=10.0, band_hz=(500.0, 1000.0))
    y = outputs(2000, lateral=15.0)
    cut, whole = (feel(sampling(range_m_s2=limit), y, box)[0][100:, LATERAL].mean() for limit in (2 * G, 1e6))
    assert whole == pytest.approx(15.0, abs=0.1)
    assert cut < 13.5


def test_rectified_offset_is_the_coefficient_times_the_mean_square() -> None:
    box = AxleBox(vibration_m_s2=30.0, band_hz=(200.0, 1000.0), gyro_per_m_s2=0.0)
    calm, _ = feel(sampling(), outputs(4000), box)
    shaken, _ = feel(sampling(rectification=RECTIFICATION, gyro_rectification=2e-7), outputs(4000), box)
    assert (shaken - calm)[20:].mean(axis=0) == pytest.approx([2e-7 * 900.0, RECTIFICATION * 900.0], rel=0.02)
    # the data sheet's figure
    assert pytest.approx(0.1 * G) == RECTIFICATION * (7.5 * G) ** 2


def test_tone_above_100_hz_folds_unless_the_low_pass_takes_it() -> None:
    """Corrugation of 50 mm at 9.5 m/s is a tone of 190 Hz, in samples of 200 Hz one of 10 Hz."""
    box = AxleBox(corrugation_m_s2=2.0 * (25.0 / 9.5) ** 2, corrugation_wavelength_m=0.05)
    open_, _ = feel(sampling(corner_hz=500.0), outputs(2000), box, 9.5)
    closed, _ = feel(sampling(corner_hz=40.0, order=4), outputs(2000), box, 9.5)
    assert amplitude_at(10.0, open_[:, LATERAL]) == pytest.approx(2.0, rel=0.05)
    assert amplitude_at(10.0, closed[20:, LATERAL]) < 0.01
    # without inner sampling the mean over a sample leaves little of it
    assert amplitude_at(10.0, feel(MEMS, outputs(2000), box, 9.5)[0][:, LATERAL]) == pytest.approx(
        2.0 * np.sinc(0.95), rel=0.01
    )


def test_misaligned_gyro_reads_the_roll_rate() -> None:
    y = outputs(50, yaw=noise(50), roll=noise(50, 7.0)[::-1])
    felt, _ = feel(replace(MEMS, misalignment_rad=0.03), y)
    assert felt[:, GYRO] == pytest.approx(math.cos(0.03) * y[:, YAW_RATE] + math.sin(0.03) * y[:, ROLL_RATE])


def test_gyro_reads_acceleration_by_its_g_sensitivity() -> None:
    y = outputs(50, yaw=noise(50), lateral=noise(50, 7.0)[::-1])
    felt, _ = feel(replace(MEMS, g_sensitivity=0.002), y)
    assert felt[:, GYRO] == pytest.approx(y[:, YAW_RATE] + 0.002 * y[:, LAT_ACCEL])


@pytest.mark.parametrize("sensors", [MEMS, sampling(corner_hz=1000.0)])
def test_accelerometer_is_read_before_the_gyro(sensors: SensorSet) -> None:
    """A whole sample before gives the sample before; without inner sampling half a sample gives the middle."""
    y = outputs(50, yaw=noise(50), lateral=noise(50, 7.0)[::-1])
    felt, _ = feel(replace(sensors, lateral_lead_s=TICK_S), y)
    assert felt[:, GYRO] == pytest.approx(y[:, YAW_RATE], abs=1e-5)
    assert felt[1:, LATERAL] == pytest.approx(y[:-1, LAT_ACCEL], abs=1e-5)
    if sensors.sampling is None:
        half, _ = feel(replace(sensors, lateral_lead_s=0.5 * TICK_S), y)
        assert half[1:, LATERAL] == pytest.approx(0.5 * (y[1:, LAT_ACCEL] + y[:-1, LAT_ACCEL]))


def test_jitter_reads_each_sensor_early_at_random() -> None:
    ramp: FloatArray = TICK_S * np.arange(1.0, 2001.0)
    felt, _ = feel(replace(MEMS, jitter_s=0.002), outputs(2000, yaw=ramp, lateral=ramp))
    early: FloatArray = (ramp[:, None] - felt)[1:]
    assert 0.0 <= early.min() < 5e-5
    assert 0.00195 < early.max() <= 0.002
    assert early.mean(axis=0) == pytest.approx([0.001, 0.001], rel=0.1)
    assert abs(np.corrcoef(early[:, 0], early[:, 1])[0, 1]) < 0.1


def test_pair_on_the_frame_reads_the_frame_and_less_vibration() -> None:
    y = outputs(2000, yaw=1.0, lateral=2.0, frame_yaw=0.3, frame_lateral=0.4)
    box = AxleBox(vibration_m_s2=3.0)
    frame, _ = feel(replace(MEMS, mounting=BOGIE_FRAME), y, box)
    below, _ = feel(MEMS, y, box)
    assert frame.mean(axis=0) == pytest.approx([0.3, 0.4], abs=0.01)
    assert frame[:, LATERAL].std() == pytest.approx(FRAME_SHARE * below[:, LATERAL].std())


@pytest.mark.parametrize("sensors", [
    MEMS, SENSOR_SETS["mems-axle-box"], replace(MEMS, lateral_lead_s=0.007, jitter_s=0.001),
    replace(drawn(np.random.default_rng(3)), lateral_lead_s=0.007, jitter_s=0.001),
])  # fmt: skip
def test_blocks_of_any_size_give_the_same_samples(sensors: SensorSet) -> None:
    """Also where the accelerometer is read in the sample before."""
    box = AxleBox(
        vibration_m_s2=90.0, joint_m_s2=5.0, crossing_m_s2=5.0, crossing_at_m=40.0, corrugation_m_s2=9.0,
        corrugation_m=(10.0, 60.0), flat_m_s2=90.0,
    )  # fmt: skip
    n = 1500
    y = outputs(n, yaw=noise(n), lateral=noise(n, 9.0), roll=noise(n, 0.1))
    v = np.linspace(8.0, 24.0, n)
    distance = np.cumsum(v) * TICK_S - 20.0

    def pair() -> InertialStream:
        return InertialStream(sensors, box, TICK_S, *(np.random.default_rng(k) for k in range(3)))

    whole, parts = pair(), pair()
    cuts = [0, 1, 2, 9, 200, 201, 900, n]
    pieces = [parts.next(y[a:b], distance[a:b], v[a:b]) for a, b in pairwise(cuts)]
    assert np.array_equal(whole.next(y, distance, v), np.concatenate(pieces))
    assert whole.clipped == parts.clipped
    assert (whole.clipped > 0) == (sensors.sampling is not None)


def test_inner_rate_must_be_a_multiple_of_the_samples() -> None:
    with pytest.raises(ValueError, match="multiple"):
        feel(sampling(rate_hz=1100.0), outputs(1))
    with pytest.raises(ValueError, match="lateral_lead_s"):
        feel(replace(MEMS, lateral_lead_s=0.02), outputs(1))
    with pytest.raises(ValueError, match="corner_hz"):
        Sampling(rate_hz=1000.0, corner_hz=500.0)


def test_friction_brakes_part_of_the_torque_is_misread() -> None:
    """Traction is read as it is; full braking by friction alone that is not read leaves nothing."""
    torque = np.array([5000.0, -4000.0])
    assert replace(MEMS, friction_share=0.5, friction_gain=0.6).known_torque(torque).tolist() == [5000.0, -3200.0]
    assert replace(MEMS, friction_share=1.0, friction_gain=0.0).known_torque(torque).tolist() == [5000.0, 0.0]
    assert MEMS.known_torque(torque).tolist() == torque.tolist()


def test_drawn_sensors_fill_their_ranges_and_wider_ones_reach_further() -> None:
    def extremes(wider: float) -> dict[str, float]:
        rng = np.random.default_rng(1)
        sets = [drawn(rng, wider) for _ in range(400)]
        inner = [s.sampling for s in sets if s.sampling is not None]
        assert len(inner) == 400
        return {
            "corner": max(s.corner_hz for s in inner),
            "rectification": max(s.rectification for s in inner) / RECTIFICATION,
            "misalignment": max(math.degrees(abs(s.misalignment_rad)) for s in sets),
            "lead": max(s.lateral_lead_s for s in sets),
            "speed": max(abs(s.speed.gain - 1.0) for s in sets),
            "slow": min(s.rate_hz for s in inner),
            "fast": max(s.rate_hz for s in inner),
        }

    trained = {"corner": 60.0, "rectification": 1.0, "misalignment": 2.0, "lead": 0.005, "speed": 0.03}
    for wider in (1.0, 1.5):
        found = extremes(wider)
        assert [found.pop("slow"), found.pop("fast")] == [1000.0, 8000.0]
        for name, most in found.items():
            assert 0.95 * wider * trained[name] < most <= wider * trained[name]


def test_every_drawn_pair_can_be_felt() -> None:
    rng = np.random.default_rng(2)
    for wider in (1.0, 1.5) * 10:
        felt, _ = feel(drawn(rng, wider), outputs(60, lateral=1.0), drawn_box(rng, wider))
        assert np.isfinite(felt).all()


def test_drawn_axle_boxes_shake_by_some_m_s2_most_of_it_above_the_band() -> None:
    rng = np.random.default_rng(3)
    boxes = [drawn_box(rng) for _ in range(400)]
    sizes = [b.vibration_m_s2 for b in boxes]
    assert 2.0 <= min(sizes) < 2.2
    assert 18.0 < max(sizes) <= 20.0
    assert not any(b.flat_m_s2 for b in boxes)  # flats are of judging alone
    assert max(drawn_box(rng, 1.5).vibration_m_s2 for _ in range(400)) > 25.0
    below, _ = feel(sampling(corner_hz=60.0, order=4), outputs(4000), AxleBox(
        vibration_m_s2=30.0, band_hz=(20.0, 1000.0), vibration_power=2.0))  # fmt: skip
    assert 0.2 < below[:, LATERAL].std() < 0.8
