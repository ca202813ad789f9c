"""A controller as a process: its cycles, and what it tells of its inputs and of adhesion."""

from itertools import pairwise

import pytest

from sim_ecu.loop.control.adhesion_watch import AdhesionWatch
from sim_ecu.loop.control.controller import Unprotected
from tests.support.daemon_frames import DEGRADED, GOOD, DaemonFrames
from tests.support.loop_wire import EPOCH_US, Wire, scenario
from wrcd.bus.codec import Value
from wrcd.bus.frame import Frame
from wrcd.config import load_packaged

DAEMON = DaemonFrames(load_packaged(1))


@pytest.fixture
def wire() -> Wire:
    rides = scenario()
    return Wire(rides, Unprotected(rides.axles, rides.actuators), [AdhesionWatch(DAEMON.config, rides.axles)])


def counters(frames: list[Frame]) -> list[int]:
    return [f.data[1] & 0x0F for f in frames]


def say(wire: Wire, values: dict[str, Value], seconds: float) -> None:
    """Turn for so long while the daemon says something every 20 ms."""
    for _ in range(round(seconds / 0.02)):
        wire.link.waiting.append(DAEMON.adhesion(wire.clock.us, values))
        wire.turns(0.02)


def test_demand_is_sent_once_a_cycle(wire: Wire) -> None:
    wire.turns(1.0)
    stamps = [f.stamp_us - EPOCH_US for f in wire.link.sent]
    assert stamps == list(range(20_000, 1_000_001, 10_000))  # the driver is heard at 20 ms
    assert all((b - a) % 15 == 1 for a, b in pairwise(counters(wire.link.sent)))


def test_late_cycles_are_left_out_and_counted(wire: Wire) -> None:
    wire.turns(0.5)
    wire.turns(0.037 // 0.005 * 0.005, controller=False)
    before = len(wire.link.sent)
    wire.turn()
    assert len(wire.link.sent) == before + 1
    assert (wire.controls.skipped, wire.controls.cycles) == (3, 51)
    *_, last, newest = counters(wire.link.sent)
    assert (newest - last) % 15 == 4
    wire.controls.turn()  # the same cycle again
    assert len(wire.link.sent) == before + 1


def test_silent_and_heard_inputs_are_told(wire: Wire) -> None:
    wire.turns(0.5, rig=False)
    wire.turns(1.0)
    wire.turns(0.5, rig=False)
    wire.turns(0.5)
    assert wire.lines.at_s("DriverDemand, WheelSpeed_A1, BrakePressure_A1: not heard yet") == [pytest.approx(0.01)]
    assert wire.lines.at_s("WheelSpeed_A1: heard after 0.5") == [pytest.approx(0.52, abs=0.02)]
    assert len(wire.lines.at_s("WheelSpeed_A1: silent")) == 1
    assert wire.lines.at_s("WheelSpeed_A1: again after 0.4")
    assert any("WheelSpeed_A1" in line and "silent once" in line for line in wire.controls.summary())


def test_adhesion_is_told_when_it_may_be_used_and_why_not(wire: Wire) -> None:
    say(wire, GOOD, 1.5)
    say(wire, DEGRADED, 1.5)
    wire.turns(1.5)
    told = [line for _, line in wire.lines.events if "adhesion" in line]
    assert told == [
        "axle 1: adhesion used", "axle 1: adhesion not used: Degraded", "axle 1: adhesion not used: silent for 60 ms",
    ]  # fmt: skip
    assert any("adhesion, axle 1: usable in 33%" in line for line in wire.controls.summary())


def test_damaged_adhesion_is_not_used_and_counted(wire: Wire) -> None:
    say(wire, GOOD, 1.5)
    for _ in range(10):
        good = DAEMON.adhesion(wire.clock.us, GOOD)
        wire.link.waiting.append(Frame(good.stamp_us, good.can_id, good.data[:-1] + bytes([good.data[-1] ^ 1])))
        wire.turns(0.02)
    assert any("adhesion not used" in line for _, line in wire.lines.events)
    assert any("10 CRC" in line for line in wire.controls.summary())


def test_adhesion_that_flickers_is_told_once_a_second(wire: Wire) -> None:
    for _ in range(10):
        say(wire, GOOD, 0.1)
        say(wire, DEGRADED, 0.1)
    assert len([line for _, line in wire.lines.events if "adhesion" in line]) <= 3
