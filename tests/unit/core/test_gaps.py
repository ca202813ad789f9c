"""Inputs that fall silent, for a frame, for some ticks or for good."""

import pytest

from tests.support.can_ids import (
    LAT_ACCEL_A1,
    TORQUE_A1,
    VEHICLE_SPEED,
    YAW_RATE_A1,
)
from tests.support.sensor_simulator import SensorSimulator, validities


def test_one_lost_frame_leaves_the_axle_valid(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.silent = {LAT_ACCEL_A1}
    sim.run(5)
    sim.silent = set()
    assert validities(sim.run(500)) == ["Valid"]


@pytest.mark.parametrize("can_id", [YAW_RATE_A1, TORQUE_A1])
def test_short_gap_is_degraded_while_it_lasts(sim: SensorSimulator, can_id: int) -> None:
    """40 ms past the time-out are bridged; the estimate goes on."""
    sim.run(2000)
    sim.silent = {can_id}
    during = sim.run({YAW_RATE_A1: 40, TORQUE_A1: 60}[can_id])
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(during)[-1] == "Degraded"
    assert validities(frames) == ["Valid"]


def test_longer_gap_is_degraded_for_one_window(sim: SensorSimulator) -> None:
    sim.run(2000)
    sim.silent = {YAW_RATE_A1}
    sim.run(80)
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(frames) == ["Degraded", "Valid"]
    assert isinstance(frames[0]["MuAvailable"], float)
    assert 980 <= [f["Validity"] for f in frames].index("Valid") * 20 <= 1020


@pytest.mark.parametrize("missing", [YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED])
def test_silent_input_is_degraded_then_not_available(sim: SensorSimulator, missing: int) -> None:
    sim.run(2000)
    sim.silent = {missing}
    frames = sim.run(300)
    assert [v for v in validities(frames) if v != "Valid"] == ["Degraded", "NotAvailable"]
    timeout = {YAW_RATE_A1: 15, LAT_ACCEL_A1: 15, TORQUE_A1: 30, VEHICLE_SPEED: 60}[missing]
    degraded = next(i for i, f in enumerate(frames) if f["Validity"] == "Degraded")
    gone = next(i for i, f in enumerate(frames) if f["Validity"] == "NotAvailable")
    # never Valid longer than the time-out and one cycle after the last frame, 4 ms before the silence began
    assert degraded * 20 <= timeout + 20
    assert 100 - 4 <= (gone + 1) * 20 <= 100 + 20
    sim.silent = set()
    frames = sim.run(2000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    back = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert 1000 <= (back + 1) * 20 <= 1040


def test_sensor_slower_than_the_tick_is_never_valid(sim: SensorSimulator) -> None:
    """Gains made for every tick are wrong for every second one; no number is better than a wrong one."""
    for _ in range(400):
        for frame in sim.frames():
            if sim.counter % 2 or frame.can_id not in (YAW_RATE_A1, LAT_ACCEL_A1):
                sim.out += sim.core.feed(frame)
        sim.out += sim.core.advance(sim.t)
    frames = sim.adhesion(sim.out)
    assert {f["MuAvailable"] for f in frames} == {"NotAvailable"}
    assert "Valid" not in {f["Validity"] for f in frames}
