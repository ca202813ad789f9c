"""Sensors that stand still, values that jump, and the register of what was reached."""

import math
import random

import pytest

from tests.support.sensor_simulator import SensorSimulator
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.plausibility import MAX_SHARE, STUCK, JumpCheck, StuckCheck
from wrcd.core.reach import Reach

MS = 1000


def noisy(steps: float, frames: int) -> list[float]:
    """White noise of so many steps of the converter, as the converter gives it."""
    rng = random.Random(7)
    return [float(round(rng.gauss(0, steps))) for _ in range(frames)]


@pytest.mark.parametrize("steps", [0.3, 1.0, 5.0, 100.0])
def test_coarse_sensor_is_not_stuck(steps: float) -> None:
    """Ten minutes at 200 Hz; how often neighbours are equal is learnt from the sensor itself."""
    r = StuckCheck()
    for k, value in enumerate(noisy(steps, 400)):
        r.check(value, k * 5 * MS, moving=True)
    verdicts = [r.check(v, (400 + k) * 5 * MS, moving=True) for k, v in enumerate(noisy(steps, 120_000))]
    assert verdicts.count(Reason.STUCK) == 0


@pytest.mark.parametrize(("steps", "doubted_ms", "stuck_ms"), [(100.0, 20, 80), (5.0, 20, 80), (1.0, 80, 160)])
def test_stuck_sensor_is_unchanged_at_its_timeout_then_rejected(steps: float, doubted_ms: int, stuck_ms: int) -> None:
    r = StuckCheck()
    for k, value in enumerate(noisy(steps, 2000)):
        r.check(value, k * 5 * MS, moving=True)
    r.check(0.5, 10_000 * MS, moving=True)
    doubted = stuck = None
    for k in range(1, 100):
        verdict = r.check(0.5, (10_000 + 5 * k) * MS, moving=True)
        if doubted is None and r.unchanged((10_000 + 5 * k + 4) * MS, 15 * MS):
            doubted = 5 * k
        if stuck is None and verdict is Reason.STUCK:
            stuck = 5 * k
    assert doubted is not None
    assert doubted <= doubted_ms
    assert stuck is not None
    assert doubted <= stuck <= stuck_ms
    # being stuck for long does not teach it that this is how it always is
    assert r.check(0.5, 12_000 * MS, moving=True) is Reason.STUCK
    assert r.check(0.6, 12_005 * MS, moving=True) is None
    assert not r.unchanged(12_006 * MS, 15 * MS)


def test_very_coarse_sensor_is_rejected_after_the_run_that_max_share_allows() -> None:
    """More than nine of ten neighbours are equal; without a bound it would be watched by ever longer runs."""
    r = StuckCheck()
    for k, value in enumerate(noisy(0.25, 40_000)):
        r.check(value, k * 5 * MS, moving=True)
    r.check(7.5, 40_000 * 5 * MS, moving=True)
    stuck = next(k for k in range(1, 1000) if r.check(7.5, (40_000 + k) * 5 * MS, moving=True) is Reason.STUCK)
    assert stuck == math.ceil(STUCK / math.log(MAX_SHARE))


def test_stuck_check_learns_and_rejects_nothing_at_standstill() -> None:
    r = StuckCheck()
    for k in range(1000):
        assert r.check(0.0, k * 5 * MS, moving=False) is None
    stuck = next(k for k in range(1000) if r.check(0.0, (1000 + k) * 5 * MS, moving=True) is Reason.STUCK)
    assert stuck < 15


def test_jump_check_accepts_a_step_at_its_second_frame() -> None:
    s = JumpCheck(1.0, 60 * MS)
    assert s.check(10.0, 0) is None
    assert s.check(10.9, 20 * MS) is None
    assert s.check(50.0, 40 * MS) is Reason.JUMP
    assert s.check(11.0, 60 * MS) is None  # it was one bad frame
    assert s.check(50.0, 80 * MS) is Reason.JUMP
    assert s.check(50.1, 100 * MS) is None
    assert s.check(11.0, 100 * MS + 60 * MS + 1) is None  # after a gap any value is as good
    assert s.check(50.0, 180 * MS) is Reason.JUMP
    assert s.check(90.0, 200 * MS) is Reason.JUMP  # another one confirms nothing
    assert s.check(11.0, 220 * MS) is None


def test_step_of_the_torque_leaves_no_jump_behind(sim: SensorSimulator) -> None:
    sim.torque = 1_000.0
    sim.run(100)
    sim.torque = 9_000.0
    sim.run(100)
    torque = next(k for k, i in enumerate(sim.config.inputs) if i.source.quantity is Quantity.TORQUE)
    assert sim.core.counts.rejected[Reason.JUMP] == 1
    assert sim.core.check_all(torque, [9_000.0, 9_100.0], [sim.t, sim.t + 10 * MS])


def test_jump_check_allows_a_slow_message_more() -> None:
    s = JumpCheck(1.0, 3000 * MS)
    assert s.check(10.0, 0) is None
    assert s.check(11.5, 1000 * MS) is None  # braking, told once a second
    assert s.check(30.0, 2000 * MS) is Reason.JUMP


def test_stuck_check_does_not_learn_from_freezes() -> None:
    r = StuckCheck()
    stamp = 0
    for value in noisy(100.0, 200):
        for _ in range(30):  # each half a second still, then moving for as long
            stamp += 5 * MS
            r.check(value, stamp, moving=True)
        for k in range(100):
            stamp += 5 * MS
            r.check(value + 1 + k, stamp, moving=True)
    r.check(0.5, stamp + 5 * MS, moving=True)
    verdicts = [r.check(0.5, stamp + (10 + 5 * k) * MS, moving=True) for k in range(20)]
    assert verdicts.index(Reason.STUCK) < 15
    assert r.unchanged(stamp + 31 * MS, 15 * MS)


def test_reach_register_shifts_each_timeout_and_keeps_the_reason() -> None:
    reach = Reach([15 * MS, 0])
    assert reach.read(0, 0) == (0, "None")
    for k in range(8):
        reach.accept(0, 15 * MS * (100 + k))
    assert reach.read(0, 15 * MS * 107) == (0b01111111, "None")
    assert reach.read(0, 15 * MS * 108) == (0b11111111, "None")
    reach.reject(0, 15 * MS * 108, Reason.DATA_ID)
    reach.accept(0, 15 * MS * 110)
    assert reach.read(0, 15 * MS * 111) == (0b11111001, "DataId")
    assert reach.read(0, 15 * MS * 116) == (0b00100000, "DataId")
    assert reach.read(0, 15 * MS * 117) == (0b01000000, "None")
    assert reach.read(0, 15 * MS * 1000) == (0, "None")
    reach.accept(0, 15 * MS * 1000)
    reach.reset()
    assert reach.read(0, 15 * MS * 1001) == (0, "None")
