"""Pulses of the axle box, found in the lateral acceleration."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.c_parts import Joints
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.signals import HUNTS_FROM_S, hunting, measured
from tests.support.stepped import SteppedEstimator, Tick
from wrcd.core.design import BoolArray, Design, FloatArray, load_design
from wrcd.core.estimator import step_through
from wrcd.core.terms import EstimateDoubt

HOLD_TICKS, RECOVERY_TICKS, MAX_TICKS = 4, 80, 24
MAX_PULSE = 0.02, 6.0  # rad/s, m/s2
AT = 1500  # a pulse's first tick
RMS = 0.01


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(LONE_DESIGN)


def pulse(height: float, ticks: int = 6) -> FloatArray:
    """One period of a sine: a joint of 30 ms."""
    return height * np.sin(2 * np.pi * (np.arange(ticks) + 0.5) / ticks)


def track(ticks: int = 3000) -> FloatArray:
    """Lateral acceleration on a track, (ticks,)."""
    return np.array(measured(seconds=20.0)[:ticks, 1])


def found(design: Design, a: FloatArray, there: BoolArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Ticks that are a pulse, and those that are one or just behind."""
    joints, out = Joints(1, replace(design, noise_rms=np.array([1.0, RMS]))), []
    for k, x in enumerate(a):
        out.append(joints.step(np.array([x]), np.array([there is None or bool(there[k])])))
    both = np.array(out)[:, :, 0]
    return both[:, 0], both[:, 1]


@pytest.mark.parametrize("height", [0.3, 0.7, 2.0])
def test_a_joint_is_found_with_the_ticks_behind(design: Design, height: float) -> None:
    a = track()
    a[AT : AT + 6] += pulse(height)
    is_pulse, near = found(design, a)
    assert is_pulse[AT : AT + 3].any()
    assert near[AT + 2 : AT + 6 + HOLD_TICKS].all()
    assert not near[:AT].any()
    assert not near[AT + 60 :].any()
    last = int(np.flatnonzero(is_pulse)[-1])
    assert near[last : last + HOLD_TICKS + 1].all()
    assert not near[last + HOLD_TICKS + 1]


def test_every_joint_of_a_rail_is_found(design: Design) -> None:
    """One a second, at 25 m/s: the second as well as the tenth."""
    a = track()
    begins = np.arange(200, 3000 - 60, 200)
    for k in begins:
        a[k : k + 6] += pulse(1.0)
    is_pulse, near = found(design, a)
    assert all(is_pulse[k : k + 6].any() for k in begins)
    assert near.mean() < 0.15


def test_a_track_and_vibration_are_no_joints(design: Design) -> None:
    """Vibration is there all the time: it is what is usual."""
    _, near = found(design, track())
    assert not near.any()
    for rms in (0.03, 0.3, 1.0):
        a = track() + rms * np.random.default_rng(1).standard_normal(3000)
        assert found(design, a)[1][600:].mean() < 0.01


def test_a_long_pulse_is_no_joint(design: Design) -> None:
    a = track()
    a[AT : AT + 60] += 1.0 * np.tile([1.0, 1.0, -1.0, -1.0], 15)  # 50 Hz that never passes zero at a tick
    is_pulse, near = found(design, a)
    assert is_pulse[AT : AT + MAX_TICKS - 4].all()
    assert is_pulse.sum() <= MAX_TICKS + 2
    assert not near[AT + MAX_TICKS + HOLD_TICKS + 1 : AT + 60].any()


def test_starting_vibration_is_usual_after_a_while(design: Design) -> None:
    a = track()
    a[AT:] += 1.0 * np.random.default_rng(2).standard_normal(3000 - AT)
    _, near = found(design, a)
    assert near[AT : AT + 20].any()
    assert near[AT + 300 :].mean() < 0.02


def test_an_offset_is_no_pulse(design: Design) -> None:
    """Neither at the start, nor where a measurement is missing."""
    rng = np.random.default_rng(3)
    a = RMS * rng.standard_normal(3000) + 0.5
    there = rng.random(3000) > 0.05
    assert not found(design, a, there)[1].any()
    a[100:106] += pulse(0.3)
    assert found(design, a)[0][100:106].any()  # half a second after the start


def test_quieter_than_its_noise_a_sensor_is_judged_by_that_noise(design: Design) -> None:
    """A frozen one that moves by a step of its own: a pulse is five times four fifths of the design's noise."""
    for height, is_pulse in ((0.9, False), (1.1, True)):
        a = np.zeros(3000)
        a[AT] = height * 5.0 * 0.8 * RMS / float(design.highpass[:, 0].prod())
        assert found(design, a)[0][AT] == is_pulse


def test_axles_are_apart_and_a_reset_forgets(design: Design) -> None:
    joints = Joints(2, replace(design, noise_rms=np.array([1.0, RMS])))
    yes = np.ones(2, dtype=bool)
    a = track()
    a[AT : AT + 6] += pulse(2.0)
    for k in range(AT + 8):
        _, near = joints.step(np.array([a[k], track()[k]]), yes)
    assert near.tolist() == [True, False]
    assert joints.recovering == [True, False]
    joints.reset(0)
    assert joints.recovering == [False, False]
    _, near = joints.step(np.array([0.0, 0.0]), yes)
    assert not near[0]


class Seen:
    """What an estimator made of every tick of a track on which something happens at AT."""

    def __init__(self, design: Design, more: FloatArray, channel: int = 1) -> None:
        z = np.array(measured(seconds=20.0)[: AT + 400])
        z[AT : AT + len(more), channel] += more
        estimator, live, calm, outliers, e = SteppedEstimator(design, 1), [], [], [], []
        for k, row in enumerate(z):
            found = estimator.step(Tick(k, row[:, None], np.ones((2, 1), dtype=bool), np.full(1, 0.13), 25.0))
            live.append(bool(found.live[0]))
            calm.append(bool(found.calm[0]))
            outliers.append(bool(found.outliers[0]))
            e.append(found.innovations)
        assert np.isfinite(e).all()
        # innovations enter the window HOLD_TICKS late
        self.live, self.calm = (np.array(x[HOLD_TICKS:]) for x in (live, calm))
        self.outliers = np.array(outliers)


def test_ticks_before_and_behind_a_joint_stay_out_of_the_window(design: Design) -> None:
    seen = Seen(design, pulse(2.0))
    dead = np.flatnonzero(~seen.live[10:]) + 10
    assert AT - HOLD_TICKS <= dead[0] <= AT + 1 - HOLD_TICKS
    assert dead[-1] >= AT + 5 + HOLD_TICKS
    assert len(dead) == dead[-1] - dead[0] + 1
    assert len(dead) < 40
    assert not seen.outliers.any()
    # what the filters swing like afterwards is live, but shows no change of rail
    swings = np.flatnonzero(seen.live & ~seen.calm)
    assert RECOVERY_TICKS - 10 < len(swings[swings > AT]) < RECOVERY_TICKS + 10


@pytest.mark.parametrize("channel", [0, 1])
def test_sample_beyond_any_joint_is_an_outlier(design: Design, channel: int) -> None:
    """Larger than any joint: an outlier, and no pulse that excuses it."""
    seen = Seen(design, np.array([20.0 * MAX_PULSE[channel]]), channel)
    assert np.flatnonzero(seen.outliers).tolist() == [AT]
    assert not seen.live[AT]
    assert seen.live[AT - HOLD_TICKS : AT].all()


def test_hunting_wheelset_is_not_harsh(design: Design) -> None:
    """Its yaw rate is beyond any joint's in most ticks; its acceleration, which is judged, is not and has no pulse."""
    ticks = hunting()
    begins = round(HUNTS_FROM_S / design.tick_s)
    yaw_rate, lat_accel = np.abs(ticks.z[begins:, :, 0]).T
    assert (yaw_rate > MAX_PULSE[0]).mean() > 0.7
    assert (lat_accel < MAX_PULSE[1]).all()
    estimator = SteppedEstimator(design, 1)
    doubts = [estimator.estimate().doubt[0] for _ in step_through(estimator, ticks, range(begins, len(ticks), 4))]
    assert EstimateDoubt.HARSH not in doubts
    assert doubts.count(EstimateDoubt.NONE) > 0.9 * len(doubts)
