"""Frames that the core rejects: what they change, and where they are counted."""

import struct
from dataclasses import replace

import pytest

from tests.support.can_ids import (
    ADHESION_A1,
    LAT_ACCEL_A1,
    SIM_TRUTH_A1,
    TORQUE_A1,
    VEHICLE_SPEED,
    YAW_RATE_A1,
)
from tests.support.sensor_simulator import SensorSimulator, validities
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason


def test_every_mapped_frame_is_accepted_or_counted(sim: SensorSimulator) -> None:
    sim.run(100)
    good = sim.core.counts.accepted
    for data in (bytes(5), bytes(4), b"\xff" * 5):
        sim.core.feed(Frame(sim.t, YAW_RATE_A1, data))
    sim.core.feed(Frame(sim.t, SIM_TRUTH_A1, bytes(8)))
    sim.core.feed(Frame(sim.t, ADHESION_A1, bytes(8)))
    assert sim.core.counts.accepted == good
    assert sum(sim.core.counts.rejected.values()) == 3


@pytest.mark.parametrize("can_id", [YAW_RATE_A1, LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED])
def test_rejected_frame_between_good_ones_leaves_the_axle_valid(can_id: int, sim: SensorSimulator) -> None:
    """A bad CRC behind every good frame, the last before each slot, too: good frames are what counts."""
    sim.run(1500)
    for _ in range(100):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
            if frame.can_id == can_id:
                sim.out += sim.core.feed(replace(frame, data=bytes((frame.data[0] ^ 1, *frame.data[1:]))))
        sim.out += sim.core.advance(sim.t)
    assert validities(sim.adhesion(sim.out)) == ["NotAvailable", "Valid"]
    assert sim.core.counts.rejected == {Reason.CRC: 100}


def test_rejected_frames_do_not_clear_a_degraded_status(sim: SensorSimulator) -> None:
    sim.run(1500)
    sim.yaw_status = 1
    first = len(sim.out)
    for _ in range(40):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
            if frame.can_id == YAW_RATE_A1:
                sim.out += sim.core.feed(replace(frame, data=bytes((frame.data[0] ^ 1, *frame.data[1:]))))
        sim.out += sim.core.advance(sim.t)
    assert {f["Validity"] for f in sim.adhesion(sim.out[first:])} == {"Degraded"}


def test_two_senders_of_one_id_are_rejected(sim: SensorSimulator) -> None:
    sim.run(2000)
    other = SensorSimulator(sim.config)
    begin = len(sim.out)
    for k in range(60):
        for frame in sim.frames():
            sim.out += sim.core.feed(frame)
        data = protect(b"\0\0" + struct.pack("<i", 5000 + k)[:3], YAW_RATE_A1, (sim.counter + 6) % 15)
        sim.out += sim.core.feed(Frame(other.t, YAW_RATE_A1, data))
        other.t = sim.t + 2500
        sim.out += sim.core.advance(sim.t)
    frames = sim.adhesion(sim.out[begin:])
    assert "Valid" not in {f["Validity"] for f in frames[2:]}
    assert sim.core.counts.rejected[Reason.TWO_SENDERS] > 80
    assert sim.decoded("InputHealth_A1")[-1]["RefusedYawRate"] == "TwoSenders"
    assert validities(sim.run(2000)) == ["NotAvailable", "Valid"]


def test_rejection_is_reported_by_axle_signal_and_reason(sim: SensorSimulator) -> None:
    sim.run(1000)
    for number, name in (
        (YAW_RATE_A1, "YawRate"),
        (LAT_ACCEL_A1, "LatAccel"),
        (TORQUE_A1, "Torque"),
        (VEHICLE_SPEED, "Speed"),
    ):
        length = 4 if number == VEHICLE_SPEED else 5
        sim.core.feed(Frame(sim.t, number, bytes(length)))
        sim.run(100)
        told = {k: str(v) for k, v in sim.decoded("InputHealth_A1")[-1].items() if k.startswith("Refused")}
        assert told.pop(f"Refused{name}") == "Crc"
        assert set(told.values()) == {"None"}
        others = sim.decoded("InputHealth_A2")[-1]
        # the speed is everybody's
        assert str(others[f"Refused{name}"]) == ("Crc" if name == "Speed" else "None")
        sim.run(1000)


def test_rejects_frame_counts_by_reason(sim: SensorSimulator) -> None:
    sim.run(995)
    for can_id, data in (
        (YAW_RATE_A1, bytes(5)),
        (YAW_RATE_A1, bytes(4)),
        (YAW_RATE_A1, protect(bytes(5), LAT_ACCEL_A1, 0)),
        (TORQUE_A1, bytes(5)),
    ):
        sim.core.feed(Frame(sim.t, can_id, data))
    sim.run(2005)
    rows = sim.decoded("WrcdRejects")
    assert [(r["RejectedCrc"], r["RejectedLength"], r["RejectedDataId"]) for r in rows] == [
        (2, 1, 1),
        (0,) * 3,
        (0,) * 3,
    ]
    status = sim.decoded("WrcdStatus")[-1]
    assert (status["RejectedFrames"], status["LastReason"]) == (4, "Crc")


def test_rejections_are_counted_by_message_and_reason(sim: SensorSimulator) -> None:
    sim.run(20)
    for _ in range(2):
        sim.core.feed(Frame(sim.t, TORQUE_A1, bytes(5)))
    assert sim.core.counts.rejected_by_message == {("Torque_A1", Reason.CRC): 2}
