"""The loop on a link and a clock of the test's own; the core is the real one."""

import signal
import socket
import time
from pathlib import Path

import pytest

from tests.unit.test_core import Rig
from wrcd.bus.frame import Frame
from wrcd.daemon.config import Config, load_config
from wrcd.daemon.loop import Daemon
from wrcd.daemon.notify import Notifier


class Wire:
    """A link whose frames the test lays out."""

    name, drops, reopens, unsent, up = "test", 0, 0, 0, True

    def __init__(self) -> None:
        self.waiting: list[Frame] = []
        self.sent: list[Frame] = []

    def receive(self, now_us: int) -> list[Frame]:
        ready = [f for f in self.waiting if f.stamp_us <= now_us]
        self.waiting = [f for f in self.waiting if f.stamp_us > now_us]
        return ready

    def send(self, frame: Frame) -> bool:
        self.sent.append(frame)
        return True

    def close(self) -> None:
        pass


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(None)


class Setup:
    def __init__(self, config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
        self.rig = Rig(config)
        self.wire = Wire()
        self.now = self.rig.t
        self.daemon = Daemon(self.rig.core, self.wire, clock=lambda: self.now)
        monkeypatch.setattr(time, "sleep", self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e6)

    def adhesion(self) -> list[Frame]:
        return [f for f in self.wire.sent if f.can_id == 0x091]


@pytest.fixture
def setup(config: Config, monkeypatch: pytest.MonkeyPatch) -> Setup:
    return Setup(config, monkeypatch)


def test_a_silent_bus_still_gets_its_frames(setup: Setup) -> None:
    while setup.now < setup.rig.t + 2_000_000:
        setup.daemon.poll()
    frames = setup.adhesion()
    assert 98 <= len(frames) <= 101
    assert {f.data[1] >> 4 for f in frames} == {0}
    slots = [f.stamp_us // 20_000 for f in frames]
    assert slots == list(range(slots[0], slots[0] + len(slots)))
    assert setup.rig.core.health.overruns == 0


def test_a_late_loop_skips_and_counts_and_never_bursts(setup: Setup) -> None:
    for _ in range(40):
        setup.daemon.poll()
    setup.wire.sent.clear()
    setup.now += 500_000
    setup.daemon.poll()
    assert len(setup.adhesion()) <= 1
    # 25 slots of four axles, five of details
    assert 90 <= setup.rig.core.health.overruns <= 125


def test_what_arrived_during_the_start_fills_the_window(setup: Setup) -> None:
    frames = [f for _ in range(300) for f in setup.rig.frames()]
    setup.wire.waiting = list(frames)
    setup.now = setup.rig.t
    setup.daemon.catch_up()
    assert setup.wire.sent == []
    assert setup.rig.core.counts.accepted == 4 * 250  # older than 1.25 s cannot matter
    for _ in range(4):
        setup.daemon.poll()
    assert next(f.data[1] >> 4 for f in setup.adhesion()) == 1


def test_systemd_is_told(tmp_path: Path, config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
    path = str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listener:
        listener.bind(path)
        listener.settimeout(1.0)
        notifier = Notifier({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "200000"})
        setup = Setup(config, monkeypatch)
        daemon = Daemon(setup.rig.core, setup.wire, notifier, clock=lambda: setup.now)
        polls = 0
        poll = daemon.poll

        def counted() -> None:
            nonlocal polls
            polls += 1
            poll()
            if polls == 120:
                daemon._on_signal(15, None)

        monkeypatch.setattr(daemon, "poll", counted)
        monkeypatch.setattr(signal, "signal", lambda *_: None)
        daemon.run()
        said = [listener.recv(100).decode() for _ in range(8)]
        notifier.close()
    assert said[0] == "READY=1"
    assert said[-1] == "STOPPING=1"
    # every 100 ms in 0.6 s
    assert said[1:-1] == ["WATCHDOG=1"] * 6
    assert all(f.data[1] >> 4 == 0 for f in setup.wire.sent[-5:-1])


def test_without_systemd_nothing_is_said() -> None:
    Notifier({}).say("READY=1")


def test_a_turn_that_is_over_due_is_due_at_once(setup: Setup) -> None:
    setup.daemon.turn()
    assert 0.0 < setup.daemon.wait_s() <= 0.006
    setup.now += 7_000
    assert setup.daemon.wait_s() == 0.0
    setup.daemon.turn()
    setup.now -= 3_600_000_000
    assert setup.daemon.wait_s() <= 0.006
