"""Clocks that step, and frames that come late."""

import struct
from dataclasses import replace

import pytest

from tests.support.can_ids import (
    TORQUE_A1,
    VEHICLE_SPEED,
)
from tests.support.sensor_simulator import MS, SensorSimulator, validities
from wrcd.bus.frame import Frame


@pytest.mark.parametrize("step_ms", [-3_600_000, -50, 2_000, 3_600_000, 86_400_000])
def test_clock_step_costs_one_window(sim: SensorSimulator, step_ms: int) -> None:
    sim.run(2000)
    sim.t += step_ms * MS
    before = len(sim.out)
    frames = sim.run(2000)
    # Valid only after a full window
    assert validities(frames) == ["NotAvailable", "Valid"]
    # no burst of slots, however far the step
    assert len(frames) <= 102
    assert len(sim.out) - before < 1000
    assert sim.core.counts.time_steps == 1


def test_frame_from_before_a_clock_step_fills_no_slots(sim: SensorSimulator) -> None:
    """The clock steps back by a day on a silent bus; then a frame comes that was stamped before."""
    sim.run(2000)
    stamp = sim.t
    for k in range(10):
        sim.core.advance(sim.t - 86_400_000 * MS + k * 5 * MS)
    ticks = sim.core.counts.ticks
    sim.out += sim.core.feed(Frame(stamp, VEHICLE_SPEED, sim.frame(VEHICLE_SPEED, struct.pack("<H", 10_000)).data))
    assert sim.core.counts.ticks - ticks < 10
    assert sim.core.counts.time_steps == 2
    assert validities(sim.run(2000))[-2:] == ["NotAvailable", "Valid"]


@pytest.mark.parametrize(
    ("step_us", "anew", "filled"),
    [
        (-10_000, 0, 0),
        (-10_001, 1, 0),
        (1_000_000, 0, 50),
        (1_000_001, 1, 0),
        (59_990_000, 1, 0),
        (3_600_000_000, 1, 0),
    ],
)
def test_time_step_is_found_from_frames_alone(step_us: int, anew: int, filled: int, sim: SensorSimulator) -> None:
    sim.t += 4_000  # frames at a tick's beginning
    for _ in range(40):
        for frame in sim.frames():
            sim.core.feed(frame)
    before = sim.core.counts.accepted
    assert before == 160
    out = sim.core.feed(replace(frame, stamp_us=frame.stamp_us + step_us, data=sim.frames()[-1].data))
    assert sim.core.counts.time_steps == anew
    assert sim.core.counts.accepted == before + 1
    assert len(sim.adhesion(out)) == filled
    # what follows is no step of its own, and a late frame is counted as one
    sim.core.feed(replace(frame, stamp_us=frame.stamp_us + step_us + 5_000, data=sim.frames()[-1].data))
    assert sim.core.counts.time_steps == anew


@pytest.mark.parametrize(("step_us", "anew"), [(1_000_000, 0), (1_005_000, 1), (-10_000, 0), (-10_001, 1)])
def test_time_step_is_found_from_the_clock_alone(step_us: int, anew: int, sim: SensorSimulator) -> None:
    sim.run(200)
    sim.core.advance(sim.t + step_us)
    assert sim.core.counts.time_steps == anew


def test_frame_slightly_out_of_order_is_used(sim: SensorSimulator) -> None:
    sim.run(1500)
    late = sim.frame(TORQUE_A1, struct.pack("<i", 1_000_100)[:3])
    sim.core.feed(Frame(sim.t - 3000, TORQUE_A1, late.data))
    assert sim.core.counts.time_steps == 0
    assert sim.core.counts.late == 1
    assert validities(sim.run(200)) == ["Valid"]


def test_frame_of_a_closed_tick_counts_as_late(sim: SensorSimulator) -> None:
    sim.run(200)
    for stamp_us in (sim.t, sim.t - 1, sim.t - 3_000):
        sim.core.feed(replace(sim.frame(TORQUE_A1, struct.pack("<i", 1_000_000)[:3]), stamp_us=stamp_us))
        sim.counter += 1
    assert sim.core.counts.late == 2
