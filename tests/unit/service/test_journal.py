"""The daemon's log lines: one per thing that happens, and of each kind at most one a second."""

import pytest

from tests.support.can_ids import LAT_ACCEL_A1, YAW_RATE_A1
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import MS, SensorSimulator
from wrcd.bus.reasons import Reason
from wrcd.config import load_config
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
    log.sim.run(100)
    assert log.look(5000) == []


def test_rejected_frames_are_logged_once_a_second(log: Log) -> None:
    log.look()
    log.damage(YAW_RATE_A1, 30)
    assert log.look(1000) == ["rejected 30 frames in the last second: crc YawRate_A1 30"]
    assert log.look(3000) == []
    lines, begin = [], log.sim.t
    for _ in range(30):
        log.damage(LAT_ACCEL_A1, 10)
        lines += [line for line in log.look(100) if line.startswith("rejected ")]
    seconds = (log.sim.t - begin) * 1e-6
    assert seconds - 1 <= len(lines) <= seconds + 1


def test_loss_of_validity_is_logged_with_its_cause(log: Log) -> None:
    sim = log.sim
    sim.run(1500)
    assert log.look() == ["axle 1 is Valid"]
    sim.yaw_status = 1
    sim.run(1500)
    assert log.look() == ["axle 1 is not Valid any more: a sender said Degraded of itself"]
    sim.yaw_status = 0
    sim.run(2000)
    assert log.look() == ["axle 1 is Valid"]
    while sim.speed > 1.0:  # a train that stops loses nothing
        sim.speed -= 0.2
        sim.run(20)
    assert log.look(2000) == []


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


def test_clock_step_back_does_not_silence_the_log(log: Log) -> None:
    log.link.health.unsent = 1
    assert log.look() == ["could not send 1 frames"]
    log.sim.t -= 3_600_000 * MS
    log.link.health.unsent = 2
    assert log.look() == ["could not send 1 frames"]
