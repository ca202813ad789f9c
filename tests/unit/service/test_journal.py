"""The daemon's log lines: one per thing that happens, and of each kind at most one a second."""

import re
from itertools import pairwise

import pytest

from tests.support.can_ids import ADHESION, ADHESION_A1, LAT_ACCEL_A1, WRCD_STATUS, YAW_RATE_A1
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import MS, SensorSimulator
from wrcd.bus.reasons import Reason
from wrcd.config.config import load_config
from wrcd.service.journal import CounterLog


class Log:
    """A core, a link, and what is written about them."""

    def __init__(self) -> None:
        self.sim, self.link = SensorSimulator(load_config(None)), ScriptedLink()
        self.lines: list[str] = []
        self.watch = CounterLog(self.sim.core, self.link, self.lines.append)

    def look(self, ms: int = 0) -> list[str]:
        """What is written within so many milliseconds, looking every five."""
        self.lines.clear()
        for _ in range(max(1, ms // 5)):
            self.sim.t += 5 * MS
            self.watch.look(self.sim.t)
        return list(self.lines)

    def damage(self, can_id: int, n: int) -> None:
        for _ in range(n):
            for frame in self.sim.frames():
                if frame.can_id == can_id:
                    self.sim.core.feed(type(frame)(frame.stamp_us, can_id, bytes(len(frame.data))))


@pytest.fixture
def log() -> Log:
    return Log()


def test_undisturbed_core_logs_nothing(log: Log) -> None:
    log.sim.run(1500)
    log.look()
    log.sim.run(3000)
    assert log.look(5000) == []


def test_rejected_frames_are_logged_once_a_second(log: Log) -> None:
    log.look()
    log.damage(YAW_RATE_A1, 30)
    lines = [line for line in log.look(1000) if not line.startswith("axle ")]
    assert lines == ["rejected 30 frames in the last second: crc YawRate_A1 30"]
    assert log.look(3000) == []
    lines, begin = [], log.sim.t
    for _ in range(30):
        log.damage(LAT_ACCEL_A1, 10)
        lines += [line for line in log.look(100) if line.startswith("rejected ")]
    seconds = (log.sim.t - begin) * 1e-6
    assert seconds - 1 <= len(lines) <= seconds + 1


def test_change_of_validity_is_logged_with_its_input_and_figures(log: Log) -> None:
    sim = log.sim
    sim.run(1500)
    begin = log.look()
    assert [line for line in begin if "axle 1" in line] == [
        "axle 1: NotAvailable, WarmingUp: 0.02 s of the window's 1 s",
        "axle 1: NotAvailable -> Valid",
    ]
    assert [line for line in begin if "axle 4" in line] == [
        "axle 4: NotAvailable, InputSilent: yaw rate YawRate_A4.YawRate has not come; lateral acceleration "
        "LatAccel_A4.LatAccel has not come; and 1 more"
    ]
    assert len(begin) == 5
    sim.yaw_status = 1
    sim.run(1500)
    assert log.look() == [
        "axle 1: Valid -> Degraded, SensorDegraded: yaw rate YawRate_A1.YawRate: the status says Degraded"
    ]
    sim.yaw_status = 0
    sim.run(2000)
    assert log.look() == ["axle 1: Degraded -> Valid"]
    while sim.speed > 1.0:
        sim.speed -= 0.2
        sim.run(20)
    standstill = "axle 1: Valid -> NotAvailable, Standstill: speed VehicleSpeed.Speed 2.80 m/s, limit 3"
    assert log.look(2000)[-1] == standstill


def test_flapping_validity_is_logged_at_most_once_a_second_per_cause_with_a_count(log: Log) -> None:
    """Five late frames in a row, three times a second."""
    sim = log.sim
    sim.run(1500)
    log.look()
    degraded: list[tuple[int, str]] = []
    begin_us = sim.t
    for _ in range(12):
        for ms, silent in ((25, {YAW_RATE_A1}), (300, set())):
            sim.silent = silent
            for _ in range(ms // 5):
                sim.run(5)
                log.lines.clear()
                log.watch.look(sim.t)
                degraded += [(sim.t, line) for line in log.lines if "InputStale" in line]
    assert len(degraded) == 4
    assert all(later - earlier >= 1_000_000 for (earlier, _), (later, _) in pairwise(degraded))
    assert sim.t - begin_us < 4_000_000
    line = "axle 1: Valid -> Degraded, InputStale: yaw rate YawRate_A1.YawRate 20.0 ms old, limit 15"
    assert re.sub(r"\d+\.\d", "20.0", degraded[0][1]) == line
    assert all("more in the last second" in text for _, text in degraded[1:])
    rest = log.look(3000)
    told = [
        int(n) for text in [t for _, t in degraded] + rest for n in re.findall(r"(\d+) more", text) if "Stale" in text
    ]
    assert 1 + sum(told) == 12


def test_last_change_of_a_flapping_axle_is_what_it_is_now(log: Log) -> None:
    """However the lines are spaced, the newest of an axle says its Validity."""
    sim = log.sim
    sim.run(1500)
    log.look()
    lines: list[str] = []
    for _ in range(3):
        sim.silent = {YAW_RATE_A1}
        sim.run(30)
        sim.silent = set()
        sim.run(40)
        log.lines.clear()
        log.watch.look(sim.t)
        lines += log.lines
    lines += log.look(2000)
    whole = [line for line in lines if "in the last second:" not in line]
    assert whole[-1].startswith("axle 1: Degraded -> Valid (")
    assert log.look(5000) == []


def test_foreign_frames_under_own_ids_are_logged_once_a_second(log: Log) -> None:
    log.look(1000)
    health = log.link.health
    for _ in range(50):
        health.foreign(ADHESION_A1)
    assert log.look() == [
        "somebody else sends Adhesion_A1 (0x091): 50 frames in the last second; is another wrcd on this bus?"
    ]
    assert log.look(3000) == []
    for can_id in (*ADHESION.values(), WRCD_STATUS):
        health.foreign(can_id)
    health.foreign(WRCD_STATUS)
    assert log.look() == [
        "somebody else sends WrcdStatus (0x0B0), Adhesion_A1 (0x091), Adhesion_A2 (0x092) and 2 more: 6 frames in the "
        "last second; is another wrcd on this bus?"
    ]


def test_flapping_link_is_logged_at_most_once_a_second_per_state(log: Log) -> None:
    assert log.look() == []
    log.link.health.state = "Down"
    assert log.look() == ["the CAN link is down: nothing comes, nothing goes"]
    log.link.health.state = "Up"
    assert log.look() == ["the CAN link is up"]
    lines = []
    for _ in range(100):
        log.link.health.state = "Down" if log.link.health.up else "Up"
        lines += log.look(50)
    assert 8 <= len(lines) <= 12
    assert log.look(2000)[-1:] in ([], ["the CAN link is up"])
    assert log.link.health.up


def test_counter_gain_is_logged_once_a_second(log: Log) -> None:
    log.link.health.drops = 5
    assert log.look() == ["lost 5 received frames: the kernel's buffer was full, see 80-wrcd.conf"]
    log.link.health.drops = 6
    assert log.look(100) == []
    log.link.health.drops = 9
    assert log.look(1000) == ["lost 4 received frames: the kernel's buffer was full, see 80-wrcd.conf"]
    log.link.health.drops = 0  # set back at the end of the start
    assert log.look(2000) == []
    log.link.health.drops = 1
    assert log.look(2000) == ["lost 1 received frames: the kernel's buffer was full, see 80-wrcd.conf"]


def test_unsent_frames_of_a_dead_bus_are_not_logged(log: Log) -> None:
    log.link.health.state = "BusOff"
    log.look()
    log.link.health.unsent = 500
    assert log.look(3000) == []
    log.link.health.state = "Up"
    log.link.health.unsent = 503
    assert log.look(2000) == ["the CAN link is up", "could not send 3 frames"]


def test_reasons_beyond_the_sixth_are_summed_up(log: Log) -> None:
    log.look(1000)
    for n in range(8):
        log.sim.core.counts.rejected_by_message[f"M{n}", Reason.RANGE] += 9 - n
    (line,) = log.look(1000)
    assert line.startswith("rejected 44 frames in the last second: range M0 9, range M1 8, ")
    assert line.endswith("range M5 4, others 5")


def test_clipped_samples_are_logged_once_a_second(log: Log) -> None:
    log.look(1000)
    clipped = log.sim.core.counts.clipped
    clipped[1, "lateral acceleration"] += 12
    clipped[2, "yaw rate"] += 3
    line = "left out 15 clipped samples of the last second: axle 1 lateral acceleration 12, axle 2 yaw rate 3"
    assert log.look(1000) == [line]
    clipped[2, "yaw rate"] += 1
    assert log.look(1000) == ["left out 1 clipped samples of the last second: axle 2 yaw rate 1"]
    assert log.look(1000) == []


def test_clock_step_back_does_not_silence_the_log(log: Log) -> None:
    log.link.health.unsent = 1
    assert log.look() == ["could not send 1 frames"]
    log.sim.t -= 3_600_000 * MS
    log.link.health.unsent = 2
    assert log.look() == ["could not send 1 frames"]
