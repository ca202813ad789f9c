"""A controller as a process: its cycles, and what it reports of its inputs and of adhesion."""

from itertools import pairwise

import numpy as np
import pytest

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, Unprotected
from sim_ecu.loop.control.control_on_bus import SETTLE_US, STEP_US, WINDOW, AdhesionWatch, Pacer
from tests.support.daemon_frames import DEGRADED, GOOD, DaemonFrames
from tests.support.loop_wire import EPOCH_US, Wire, scenario
from wrcd.bus.frame import Frame
from wrcd.bus.writers import Value
from wrcd.config.config import load_packaged

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
    assert wire.lines.at_s("DriverDemand, WheelSpeed_A1, BrakePressure_A1: has not come yet") == [pytest.approx(0.01)]
    assert wire.lines.at_s("WheelSpeed_A1: heard after 0.5") == [pytest.approx(0.52, abs=0.02)]
    assert len(wire.lines.at_s("WheelSpeed_A1: silent")) == 1
    assert wire.lines.at_s("WheelSpeed_A1: again after 0.4")
    assert any("WheelSpeed_A1" in line and "silent once" in line for line in wire.controls.summary())


def test_adhesion_is_told_when_it_may_be_used_and_why_not(wire: Wire) -> None:
    say(wire, GOOD, 1.5)
    say(wire, DEGRADED, 1.5)
    wire.turns(1.5)
    told = [line for _, line in wire.lines.events if "adhesion" in line]
    reasons = ["", "not used: Degraded", "not used: silent for 60 ms"]
    assert [line.removeprefix("axle 1: adhesion ").removeprefix("used") for line in told] == reasons
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


def follow(offset_us: int, frames: int, late_us: list[int] | None = None, drift_us: float = 0.0) -> list[int]:
    """How long after each frame's proper time the next cycle comes; frames come every cycle, some of them late."""
    pacer, moved, out = Pacer(), 0, []
    for k in range(frames):
        proper_us = k * CYCLE_US + offset_us + round(k * drift_us)
        stamp_us = proper_us + (late_us[k % len(late_us)] if late_us else 0)
        moved += pacer.take(stamp_us - moved)
        out.append((moved - proper_us) % CYCLE_US)
    return out


@pytest.mark.parametrize("offset_us", [0, 1_000, 4_999, 8_500, 9_999])
def test_cycle_comes_right_after_the_first_frame(offset_us: int) -> None:
    assert set(follow(offset_us, 3 * WINDOW)) == {SETTLE_US}


def test_late_frames_do_not_move_the_cycles() -> None:
    late = np.random.default_rng(5).integers(0, 7_000, 97).tolist()
    late[::5] = [0] * len(late[::5])
    assert set(follow(3_000, 10 * WINDOW, late)) == {SETTLE_US}


def test_cycles_follow_a_clock_that_drifts() -> None:
    after = follow(3_000, 100 * WINDOW, drift_us=2.0)  # 200 ppm
    assert max(abs(a - SETTLE_US) for a in after) <= STEP_US


def test_cycles_follow_a_sender_that_begins_anew() -> None:
    pacer, moved = Pacer(), 0
    for k in range(4 * WINDOW):
        phase = 2_000 if k < WINDOW else 7_000
        moved += pacer.take(k * CYCLE_US + phase - moved)
    assert (moved - 7_000) % CYCLE_US == SETTLE_US
