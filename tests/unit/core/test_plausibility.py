"""Single wrong samples, samples that go on being wrong, values that jump, and sensors that stand still."""

import math
import random
from dataclasses import replace
from typing import Any

import pytest

from tests.support.can_ids import LAT_ACCEL_A1
from tests.support.core_state import state
from tests.support.sensor_simulator import MS, SensorSimulator, until_ms, validities
from tests.support.stages import JumpCheck, StuckCheck
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.coarse_sensors import cost_of_step
from wrcd.native import library

SPIKE = 5_000_000  # 5 rad/s
# A run that would come about by chance once in so many frames is refused; so many may go on at most.
STUCK, MAX_SHARE = math.log(1e-12), 0.9


def noisy(steps: float, frames: int) -> list[float]:
    """White noise of so many steps of the converter, as the converter gives it."""
    rng = random.Random(7)
    return [float(round(rng.gauss(0, steps))) for _ in range(frames)]


def taught(steps: float, frames: int) -> StuckCheck:
    """A check that has seen so many frames of it at 200 Hz."""
    r = StuckCheck()
    for k, value in enumerate(noisy(steps, frames)):
        r.check(value, k * 5 * MS, moving=True)
    return r


@pytest.mark.parametrize("steps", [0.3, 1.0, 5.0, 100.0])
def test_coarse_sensor_is_not_stuck(steps: float) -> None:
    """Five minutes at 200 Hz; how often neighbours are equal is learnt from the sensor itself."""
    r = taught(steps, 400)
    verdicts = {r.check(v, (400 + k) * 5 * MS, moving=True) for k, v in enumerate(noisy(steps, 60_000))}
    assert Reason.STUCK not in verdicts


@pytest.mark.parametrize("steps", [1.0, 2.0, 4.0])
def test_sensor_as_coarse_as_its_noise_is_not_doubted(steps: float) -> None:
    """Half an hour, in the middle of a step, where it repeats itself most. Each doubt costs a window of a second."""
    r, doubts, was_doubted = taught(steps, 400), 0, False
    for k, value in enumerate(noisy(steps, 360_000)):
        r.check(value, (400 + k) * 5 * MS, moving=True)
        is_doubted = r.unchanged((400 + k) * 5 * MS, 15 * MS)
        doubts, was_doubted = doubts + (is_doubted and not was_doubted), is_doubted
    assert doubts <= 1


@pytest.mark.parametrize(("steps", "doubted_ms", "stuck_ms"), [(100.0, 30, 80), (5.0, 30, 80), (1.0, 80, 160)])
def test_stuck_sensor_is_unchanged_at_its_timeout_then_rejected(steps: float, doubted_ms: int, stuck_ms: int) -> None:
    r = taught(steps, 2000)
    r.check(0.5, 10_000 * MS, moving=True)
    doubted, stuck = [], []
    for k in range(5, 500, 5):
        if r.check(0.5, (10_000 + k) * MS, moving=True) is Reason.STUCK:
            stuck.append(k)
        if r.unchanged((10_000 + k + 4) * MS, 15 * MS):
            doubted.append(k)
    print(f"step of {1 / steps:.2g} times the noise: Unchanged after {doubted[0]} ms, refused after {stuck[0]} ms")
    assert doubted[0] <= doubted_ms
    assert doubted[0] <= stuck[0] <= stuck_ms
    # being stuck for long does not teach it that this is how it always is
    assert r.check(0.5, 12_000 * MS, moving=True) is Reason.STUCK
    assert r.check(0.6, 12_005 * MS, moving=True) is None
    assert not r.unchanged(12_006 * MS, 15 * MS)


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        (1.0, "a frozen one is found after 16 repeats, and a sound one may be taken for it"),
        (2.0, "a frozen one is found after 43 repeats, and a sound one may be taken for it"),
        (4.0, "a sound one is taken for frozen"),
    ],
)
def test_what_a_step_costs_is_said(steps: float, said: str) -> None:
    assert cost_of_step(steps) == said


def test_very_coarse_sensor_is_rejected_after_the_run_that_max_share_allows() -> None:
    """More than nine of ten neighbours are equal; without a bound it would be watched by ever longer runs."""
    r = taught(0.25, 40_000)
    r.check(7.5, 40_000 * 5 * MS, moving=True)
    stuck = next(k for k in range(1, 1000) if r.check(7.5, (40_000 + k) * 5 * MS, moving=True) is Reason.STUCK)
    assert stuck == math.ceil(STUCK / math.log(MAX_SHARE))


@pytest.mark.parametrize(
    ("runs", "refused"),
    [
        ([], 11),  # log 1e-12 / log(1.5 * 0.05), rounded up
        ([0] * 2000, 11),
        ([1] * 10, 32),  # 0.275 of (20 + 20) frames repeat the one before
        ([3] * 4, 46),
        ([4] * 3, 56),  # four of a run are learnt from
        ([6] * 3, 56),
        ([10] * 5, 116),
        ([11] * 5, 11),  # refused: nothing is learnt from it
        ([12] * 5 + [1] * 10, 32),
        ([0] * 3000 + [1] * 300, 26),  # the newest thousand frames count
        ([3] * 400, 263),
    ],
    ids=str,
)
def test_run_that_is_refused_follows_from_the_runs_before(runs: list[int], refused: int) -> None:
    """Repeats of each value so far; the repeat from which on the next is refused."""
    r = StuckCheck()
    sent = [float(k) for k, repeats in enumerate([*runs, refused]) for _ in range(repeats + 1)]
    verdicts = [r.check(value, k * 5 * MS, moving=True) for k, value in enumerate(sent)]
    assert verdicts[-2:] == [None, Reason.STUCK]


@pytest.mark.parametrize(
    ("share", "repeats"), [(0.0, 6), (0.05, 6), (0.1, 8), (0.3, 18), (0.5, 49), (0.59, 114), (0.6, 132), (0.61, 0)]
)
def test_repeats_after_which_a_sensor_is_doubted(share: float, repeats: int) -> None:
    assert library().wrcd_repeats_doubted(share) == repeats


@pytest.mark.parametrize(("value", "repeats"), [(0.5, 6), (5.0, 4), (-5.0, 4), (4.999, 6)])
def test_sensor_is_unchanged_past_its_timeout_and_sooner_at_an_end(value: float, repeats: int) -> None:
    r = StuckCheck((-5.0, 5.0))
    for _ in range(repeats + 1):
        assert not r.unchanged(1_000 * MS, 15 * MS)
        r.check(value, 5 * MS, moving=True)
    assert r.unchanged(20 * MS + 1, 15 * MS)
    assert not r.unchanged(20 * MS, 15 * MS)


@pytest.mark.parametrize(("end", "still_found"), [(5.0, True), (6.0, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_clipped_runs_do_not_teach_that_a_sensor_is_coarse(end: float, still_found: bool, sign: float) -> None:
    r = StuckCheck((-end, end))
    for k in range(4000):  # every run of three repeats stands at 5
        r.check(sign * 5.0 if k % 8 < 4 else float(k), k * 5 * MS, moving=True)
    verdicts = [r.check(0.5, (4000 + k) * 5 * MS, moving=True) for k in range(15)]
    assert (Reason.STUCK in verdicts) is still_found


def test_stuck_check_learns_and_rejects_nothing_at_standstill() -> None:
    r = StuckCheck()
    for k in range(1000):
        assert r.check(0.0, k * 5 * MS, moving=False) is None
    stuck = next(k for k in range(1000) if r.check(0.0, (1000 + k) * 5 * MS, moving=True) is Reason.STUCK)
    assert stuck < 15


def test_stuck_check_does_not_learn_from_freezes() -> None:
    r = StuckCheck()
    stamp = 0
    for value in noisy(100.0, 200):
        for k in range(130):  # each time still for 150 ms, then moving for half a second
            stamp += 5 * MS
            r.check(value + max(0, k - 29), stamp, moving=True)
    r.check(0.5, stamp + 5 * MS, moving=True)
    verdicts = [r.check(0.5, stamp + (10 + 5 * k) * MS, moving=True) for k in range(20)]
    assert verdicts.index(Reason.STUCK) < 15
    assert r.unchanged(stamp + 31 * MS, 15 * MS)


@pytest.mark.parametrize(
    ("window_ms", "frames"),
    [
        # one bad frame, then one that the next confirms
        (
            60,
            [
                (10.0, 0, True),
                (10.9, 20, True),
                (50.0, 40, False),
                (11.0, 60, True),
                (50.0, 80, False),
                (50.1, 99, True),
            ],
        ),
        (60, [(50.1, 0, True), (11.0, 60.001, True)]),  # after a gap any value is as good
        (60, [(11.0, 0, True), (50.0, 20, False), (90.0, 40, False), (11.0, 60, True)]),  # another confirms nothing
        (3000, [(10.0, 0, True), (11.5, 1000, True), (30.0, 2000, False)]),  # a slow message: braking is allowed
        (3000, [(0.0, 0, True), (9.5, 1000, True), (19.5, 2000, True), (9.25, 3000, False)]),  # by 1 in each 100 ms
        # to the last bit
        (60, [(10.0, 0, True), (11.0, 20, True), (12.0625, 40, False), (13.0625, 60, True)]),
        (60, [(10.0, 0, True), (50.0, 60, False)]),
    ],
)
def test_jump_check_accepts_a_step_at_its_second_frame(window_ms: int, frames: list[tuple[float, float, bool]]) -> None:
    s = JumpCheck(1.0, window_ms * MS)
    assert [s.check(value, round(ms * MS)) for value, ms, _ in frames] == [
        None if accepted else Reason.JUMP for *_, accepted in frames
    ]


def test_step_of_the_torque_leaves_no_jump_behind(sim: SensorSimulator) -> None:
    for torque_Nm in (1_000.0, 9_000.0):
        sim.torque = torque_Nm
        sim.run(100)
    assert sim.core.counts.rejected[Reason.JUMP] == 1


def test_single_outlier_leaves_the_estimate(sim: SensorSimulator) -> None:
    twin = SensorSimulator(sim.config)
    for each, spike in ((sim, SPIKE), (twin, 0)):
        each.run(1500)
        each.during(5, spike=spike)
    mine, its = sim.run(1000), twin.run(1000)
    assert sim.core.estimator._train["outliers"] == 1
    assert validities(mine) == ["Valid"]
    assert max(abs(a["MuAvailable"] - b["MuAvailable"]) for a, b in zip(mine, its, strict=True)) < 1.5
    assert sim.decoded("WrcdLink")[-1]["Outliers"] == 1
    assert "Yes" in {row["Outlier"] for row in sim.decoded("InputHealth_A1")}


@pytest.mark.parametrize("tick", [7, 12, 19, 24])
def test_outlier_during_start_up_resets_the_axle(sim: SensorSimulator, tick: int) -> None:
    """Later all looks usual beside it, and the estimate would be Valid and wrong."""
    clean = SensorSimulator(sim.config)
    for each, spike in ((sim, SPIKE), (clean, 0)):
        each.run(5 * tick)
        each.during(5, spike=spike)
    pairs = list(zip(sim.run(3000), clean.run(3000), strict=True))
    assert sim.core.counts.restarts == 1 or sim.core.estimator._train["outliers"] == 1
    off = [f["MuAvailable"] - g["MuAvailable"] for f, g in pairs if f["Validity"] == "Valid"]
    assert len(off) > 80
    assert max(map(abs, off)) < 3.0


def test_continued_outliers_reset_the_axle(sim: SensorSimulator) -> None:
    undisturbed = SensorSimulator(sim.config).run(5000)[-1]["MuAvailable"]
    sim.run(1500)
    sim.spike = 1_000_000
    frames = sim.run(3500)
    assert sim.core.counts.restarts == 1
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    assert until_ms(frames, "NotAvailable") <= 15 + 40  # as a silent sensor would be
    assert frames[-1]["MuAvailable"] == pytest.approx(undisturbed, abs=1.0)
    assert sim.causes()[-2:] == ["Restarted", "None"]
    (text,) = [c.text for c in sim.core.events.since(0) if "Restarted" in c.text]
    assert "waits" not in text


def test_clock_step_clears_the_outlier(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.during(5, spike=SPIKE)
    sim.t -= 3_600_000 * MS
    sim.run(1000)
    assert sim.core.counts.rejected.total() == 0  # the first frame after the step is not held against the old chain
    assert sim.decoded("InputHealth_A1")[-1]["Outlier"] == "No"


def test_how_coarse_a_sensor_is_is_known_after_a_step_of_time(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.during(200, frozen=True)  # a coarse one
    known = state(sim.core)
    sim.core.advance(sim.t + 3_600_000 * MS)
    now = state(sim.core)
    assert now["input_state.run"] != known["input_state.run"]
    assert known["input_state.frames"] != "[20.0]"
    for name in ("share", "frames"):
        assert now[f"input_state.{name}"] == known[f"input_state.{name}"]


@pytest.mark.parametrize("jump", [{"speed": 0.5}, {"speed": 120.0}, {"torque": -80_000.0}], ids=str)
def test_jump_is_accepted_at_its_second_frame(sim: SensorSimulator, jump: dict[str, Any]) -> None:
    sim.run(1500)
    sim.during(5, **jump)
    assert validities(sim.run(500)) == ["Valid"]
    assert sim.core.counts.rejected == {Reason.JUMP: 1}
    sim.during(500, **jump)
    assert sim.core.counts.rejected == {Reason.JUMP: 2}


def test_confirmed_speed_jump_resets_the_axle(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.speed = 28.0
    frames = sim.run(1500)
    assert validities(frames)[-2:] == ["NotAvailable", "Valid"]
    assert "Valid" not in {f["Validity"] for f in frames[2:40]}
    assert sim.core.counts.restarts == 1  # the others have not started yet
    sim.torque += 9000.0  # a torque may do that, though the sensors of this sim do not feel it
    assert "NotAvailable" not in validities(sim.run(500))
    assert sim.core.counts.restarts == 1


def test_stuck_gyro_of_a_moving_train_is_rejected(sim: SensorSimulator) -> None:
    sim.run(2000)
    frames = sim.during(500, frozen=True)
    # not Valid from the time-out and a cycle after the last true sample, refused soon after, then NotAvailable
    assert validities(frames[2:]) == ["Degraded", "NotAvailable"]
    assert sim.core.counts.rejected[Reason.STUCK] > 80
    row = sim.decoded("InputHealth_A1")[-1]
    names = ("RefusedYawRate", "ReachYawRate", "ReachTorque", "Unchanged")
    assert [row[name] for name in names] == ["Stuck", 0, 255, "Yes"]
    frames = sim.run(1500)
    assert validities(frames) == ["NotAvailable", "Valid"]
    assert until_ms(frames, "Valid") <= 1080


def test_stuck_accelerometer_is_told_as_unchanged(sim: SensorSimulator) -> None:
    def frozen(frames: list[Frame]) -> list[Frame]:
        still = protect(b"\0\0\x10\0\0", LAT_ACCEL_A1, (sim.counter - 1) % 15)
        return [replace(f, data=still) if f.can_id == LAT_ACCEL_A1 else f for f in frames]

    sim.run(2000)
    sim.run(500, frozen)
    row = sim.decoded("InputHealth_A1")[-1]
    assert [row[name] for name in ("RefusedLatAccel", "RefusedYawRate", "Unchanged")] == ["Stuck", "None", "Yes"]


def test_stuck_sensor_at_standstill_is_accepted(sim: SensorSimulator) -> None:
    sim.during(2000, speed=0.0, frozen=True)
    assert sim.core.counts.rejected.total() == 0
    assert validities(sim.run(1500)) == ["NotAvailable", "Valid"]
    assert sim.core.counts.rejected == {Reason.JUMP: 1}  # from rest to 25 m/s at once
