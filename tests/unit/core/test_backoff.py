"""An axle that is reset again and again waits, longer each time, and comes back by itself."""

from itertools import pairwise
from typing import Any

from tests.support.can_ids import VEHICLE_SPEED
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.core.backoff import FIRST_WAIT_S, FREE_RESETS, LAST_WAIT_S
from wrcd.core.configuration import Config

STEP_EVERY = 10  # ticks
PER_S = 200


def storm(sim: SensorSimulator, seconds: float) -> tuple[list[dict[str, Any]], list[float]]:
    """A yaw rate that steps to and fro without end: the adhesion frames, and when the axle was reset."""
    frames, resets = [], []
    for k in range(round(seconds * PER_S)):
        sim.spike = 5_000_000 if k // STEP_EVERY % 2 else 0
        before = sim.core.counts.restarts
        frames += sim.run(5)
        if sim.core.counts.restarts > before:
            resets.append(k / PER_S)
    sim.spike = 0
    return frames, resets


def test_wait_after_repeated_resets_doubles_up_to_its_bound(config: Config) -> None:
    sim = SensorSimulator(config)
    frames, resets = storm(sim, 60.0)
    gaps = [b - a for a, b in pairwise(resets)]
    assert max(gaps[: FREE_RESETS - 1]) < 0.3
    wait = FIRST_WAIT_S
    for gap in gaps[FREE_RESETS:]:
        assert wait <= gap < wait + 0.3
        wait = min(2 * wait, LAST_WAIT_S)
    assert wait == LAST_WAIT_S
    assert sim.core.waits == len(resets) - FREE_RESETS
    assert set(validities(frames[10:])) == {"NotAvailable"}


def test_axle_is_valid_again_after_its_wait(config: Config) -> None:
    sim = SensorSimulator(config)
    storm(sim, 20.0)
    waits = sim.core.waits
    frames = sim.run(12_000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    first = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert first * 0.02 <= LAST_WAIT_S + 1.2
    # a step now, and the step back, are as on the first day
    for spike in (1_000_000, 0):
        sim.spike = spike
        sim.run(500)
    assert validities(sim.run(1000)) == ["NotAvailable", "Valid"]
    assert sim.core.waits == waits


def of_axle_2(frame: Frame) -> Frame:
    can_id = frame.can_id + 1
    return Frame(frame.stamp_us, can_id, protect(frame.data, can_id, frame.data[1] & 0x0F))


def test_other_axles_do_not_wait(config: Config) -> None:
    sim, other = SensorSimulator(config), SensorSimulator(config)
    for k in range(20 * PER_S):
        sim.spike = 5_000_000 if k // STEP_EVERY % 2 else 0
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
        for frame in other.frames():
            if frame.can_id != VEHICLE_SPEED:
                sim.out += sim.core.feed(of_axle_2(frame))
        sim.out += sim.core.advance(sim.t)
    assert sim.core.waits > 0
    assert validities(sim.adhesion(sim.out, 1)) == ["NotAvailable"]
    assert validities(sim.adhesion(sim.out, 2)) == ["NotAvailable", "Valid"]


def test_repeated_speed_jumps_make_all_axles_wait(config: Config) -> None:
    """Believed at its second frame each time: without a wait that is a reset every few frames."""
    sim = SensorSimulator(config)
    sim.run(2000)
    for k in range(20 * PER_S):
        sim.speed = 25.0 if k % 8 < 4 else 28.0
        sim.run(5)
    assert sim.core.counts.restarts < 40
    assert sim.core.waits == sim.core.counts.restarts - FREE_RESETS
    sim.speed = 25.0
    assert validities(sim.run(11_000)) == ["NotAvailable", "Valid"]


def test_time_step_ends_the_wait(config: Config) -> None:
    sim = SensorSimulator(config)
    storm(sim, 10.0)
    sim.t -= 3_600_000_000
    frames = sim.run(1200)
    assert validities(frames) == ["NotAvailable", "Valid"]
