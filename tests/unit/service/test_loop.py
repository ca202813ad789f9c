"""The loop on a link and a clock of the test's own; the core is the real one."""

import gc
import os
import random
import signal
import socket
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import SensorSimulator
from wrcd.bus.frame import Frame
from wrcd.bus.link import LinkState
from wrcd.core.configuration import Config, RecorderConfig
from wrcd.recorder.recorder import Recorder
from wrcd.service.loop import Daemon
from wrcd.service.notify import Notifier


class Setup:
    def __init__(self, config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
        self.sim = SensorSimulator(config)
        self.link = ScriptedLink()
        self.now = self.sim.t
        self.late_us = 0  # from a turn's due time to the turn
        self.daemon = Daemon(self.sim.core, self.link, clock=lambda: self.now)
        monkeypatch.setattr(time, "sleep", self.sleep)

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e6) + self.late_us

    def run(self, us: int) -> int:
        """Turns of so much time. Returns how many it took."""
        end, turns = self.now + us, 0
        while self.now < end:
            self.daemon.poll()
            turns += 1
        return turns

    def adhesion(self) -> list[Frame]:
        return [f for f in self.link.sent if f.can_id == ADHESION_A1]


@pytest.fixture
def setup(config: Config, monkeypatch: pytest.MonkeyPatch) -> Setup:
    return Setup(config, monkeypatch)


def test_silent_bus_gets_every_adhesion_frame(setup: Setup) -> None:
    setup.run(2_000_000)
    frames = setup.adhesion()
    assert 98 <= len(frames) <= 101
    assert {f.data[1] >> 4 for f in frames} == {0}
    slots = [f.stamp_us // 20_000 for f in frames]
    assert slots == list(range(slots[0], slots[0] + len(slots)))
    assert setup.sim.core.health.overruns == 0


@pytest.mark.parametrize(("phase_us", "turns_per_slot"), [(300, 1), (3_000, 2), (4_900, 2)])
def test_loop_turns_once_a_slot_and_once_more_where_its_last_tick_is_open(
    setup: Setup, phase_us: int, turns_per_slot: int
) -> None:
    """On a bus whose sensors send so long after each tick's begin."""
    setup.link.waiting = sensor_frames(setup, phase_us, 1_200_000)
    setup.run(200_000)
    assert setup.run(800_000) == pytest.approx(40 * turns_per_slot, abs=1)
    assert setup.sim.core.health.overruns == 0


@pytest.mark.parametrize(("state", "stamps_arrivals"), [("Up", False), ("Gone", True)])
def test_loop_turns_at_every_tick_where_stamps_or_the_bus_depend_on_it(
    setup: Setup, state: LinkState, stamps_arrivals: bool
) -> None:
    setup.link.health.state, setup.link.stamps_arrivals = state, stamps_arrivals
    setup.link.waiting = sensor_frames(setup, 300, 1_200_000)
    assert setup.run(1_000_000) == pytest.approx(200, abs=1)


@pytest.mark.parametrize("phase_us", [300, 1_700, 3_000, 4_900])
def test_adhesion_frame_leaves_with_the_first_tick_that_could_close_its_slot(
    setup: Setup, phase_us: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if the loop turned at every tick: where a frame of a later tick has come, or none in two ticks."""
    rng = random.Random(phase_us)
    begins = [at_us + rng.randrange(20_000) for at_us in range(0, 6_000_000, 100_000)]
    gaps = [(at_us, at_us + rng.randrange(60_000)) for at_us in begins]
    begin = setup.sim.t
    every = sensor_frames(setup, phase_us, 6_000_000)
    kept = [f for f in every if not any(a <= f.stamp_us - begin < b for a, b in gaps)]
    stamps = sorted({f.stamp_us for f in kept})
    left: dict[int, int] = {}
    send = setup.link.send
    monkeypatch.setattr(setup.link, "send", lambda f: left.setdefault(f.stamp_us, setup.now) > 0 and send(f))
    setup.link.waiting = kept
    setup.run(5_900_000)
    assert len(left) > 280
    for slot, at in list(left.items())[3:]:
        looks = (slot + 1_000 + tick * 5_000 for tick in range(4))
        assert at == next(
            t for t in looks if any(slot <= s <= t for s in stamps) or not any(t - 10_000 < s <= t for s in stamps)
        )


def sensor_frames(setup: Setup, phase_us: int, us: int) -> list[Frame]:
    every = [f for _ in range(us // 5_000) for f in setup.sim.frames()]
    return [replace(f, stamp_us=f.stamp_us - 1_000 + phase_us) for f in every]  # they come 1 ms after each tick's begin


def test_late_loop_skips_its_slots_and_counts_overruns(setup: Setup) -> None:
    setup.run(200_000)
    setup.link.sent.clear()
    setup.now += 500_000
    setup.daemon.poll()
    assert len(setup.adhesion()) <= 1
    # 25 slots of four axles, five of details and of inputs
    assert 110 <= setup.sim.core.health.overruns <= 145


def test_slow_reading_of_a_backlog_is_no_step_of_time(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """A daemon that is starved reads for as long as the frames were on the bus, and then there are none."""
    setup.daemon = Daemon(setup.sim.core, setup.link, clock=lambda: setup.now, steady=lambda: setup.now)
    for _ in range(4):
        setup.daemon.poll()
    setup.sim.t = setup.now
    backlog = [f for _ in range(600) for f in setup.sim.frames()]

    def receive(now_us: int) -> list[Frame]:
        if not backlog:
            return []
        setup.now += 300_000
        taken = backlog[:200]
        del backlog[:200]
        return taken

    monkeypatch.setattr(setup.link, "receive", receive)
    setup.now += 3_000_000
    while backlog:
        setup.daemon.poll()
    for _ in range(10):
        setup.daemon.poll()
    counts = setup.sim.core.counts
    assert (counts.accepted, counts.time_steps) == (2400, 0)


def test_frames_received_during_the_start_fill_the_window(setup: Setup) -> None:
    frames = [f for _ in range(300) for f in setup.sim.frames()]
    setup.link.waiting = list(frames)
    setup.now = setup.sim.t
    setup.daemon.catch_up()
    assert setup.link.sent == []
    assert setup.sim.core.counts.accepted == 4 * 250  # older than 1.25 s cannot matter
    for _ in range(4):
        setup.daemon.poll()
    assert next(f.data[1] >> 4 for f in setup.adhesion()) == 1


class Systemd:
    """The far end of NOTIFY_SOCKET, and a daemon that talks to it; every 100 ms it wants a sign of life."""

    def __init__(self, path: str, config: Config, monkeypatch: pytest.MonkeyPatch) -> None:
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._listener.bind(path)
        self._listener.setblocking(False)
        self.setup = Setup(config, monkeypatch)
        self.notifier = Notifier({"NOTIFY_SOCKET": path, "WATCHDOG_USEC": "200000"})
        self.daemon = self.setup.daemon = self.new_daemon()

    def new_daemon(self, recorder: Recorder | None = None) -> Daemon:
        setup = self.setup
        return Daemon(setup.sim.core, setup.link, self.notifier, clock=lambda: setup.now, recorder=recorder)

    def heard(self) -> list[str]:
        out = []
        while True:
            try:
                out.append(self._listener.recv(100).decode())
            except BlockingIOError:
                return out

    def close(self) -> None:
        self._listener.close()
        self.notifier.close()


@pytest.fixture
def systemd(tmp_path: Path, config: Config, monkeypatch: pytest.MonkeyPatch) -> Iterator[Systemd]:
    kept = {s: signal.getsignal(s) for s in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)}
    listening = Systemd(str(tmp_path / "notify"), config, monkeypatch)
    yield listening
    listening.close()
    gc.unfreeze()
    for number, handler in kept.items():
        signal.signal(number, handler)


def kill_after(
    signals_by_ms: dict[int, int], systemd: Systemd, daemon: Daemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """This process gets these signals after so many milliseconds of the loop's clock."""
    begin, left, poll = systemd.setup.now, dict(signals_by_ms), daemon.poll

    def counted() -> None:
        poll()
        for ms in [ms for ms in left if systemd.setup.now >= begin + 1000 * ms]:
            os.kill(os.getpid(), left.pop(ms))

    monkeypatch.setattr(daemon, "poll", counted)


def test_systemd_gets_ready_watchdog_and_stopping(systemd: Systemd, monkeypatch: pytest.MonkeyPatch) -> None:
    kill_after({600: signal.SIGTERM}, systemd, systemd.daemon, monkeypatch)
    systemd.daemon.run()
    said = systemd.heard()
    assert said[0] == "READY=1"
    assert said[-1] == "STOPPING=1"
    # every 100 ms in 0.6 s
    assert said[1:-1] == ["WATCHDOG=1"] * 6
    assert all(f.data[1] >> 4 == 0 for f in systemd.setup.link.sent[-5:-1])
    assert gc.get_freeze_count() > 1000


def test_watchdog_gets_nothing_while_no_tick_closes(systemd: Systemd) -> None:
    """Frames come, but whoever stamps them has stopped: no tick is ever over."""
    setup = systemd.setup
    setup.run(50_000)
    assert systemd.heard() == ["WATCHDOG=1"]
    at = setup.now
    for _ in range(200):
        setup.link.waiting += [replace(frame, stamp_us=at) for frame in setup.sim.frames()]
        systemd.daemon.poll()
    assert setup.now - at >= 1_000_000
    assert len(systemd.heard()) <= 1
    setup.run(200_000)
    assert len(systemd.heard()) == 2


def test_watchdog_gets_nothing_from_a_loop_that_is_always_late(systemd: Systemd) -> None:
    for late_us, heard in ((15_000, 10), (40_000, 0), (15_000, 10)):
        systemd.heard()
        systemd.setup.late_us = late_us
        systemd.setup.run(1_000_000)
        assert heard - 2 <= len(systemd.heard()) <= heard


class Dump:
    """The dump at the end, which takes its time: what the bus has seen when it begins."""

    def __init__(self, link: ScriptedLink) -> None:
        self._wire = link
        self.begun: list[tuple[bool, list[int]]] = []

    def close(self, *_: object) -> None:
        self.begun.append((self._wire.closed, [f.data[1] >> 4 & 3 for f in self._wire.sent[-5:]]))


@pytest.mark.parametrize("where", ["poll", "catch_up"])
def test_exception_sends_shutdown_frames_and_closes_the_link_before_the_dump(
    systemd: Systemd, config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str
) -> None:
    setup = systemd.setup
    recorder = Recorder(RecorderConfig(tmp_path, 3.0, 20, 200.0), setup.sim.core, "vcan0", lambda _: None)
    dump = Dump(setup.link)
    monkeypatch.setattr(recorder, "close", dump.close)
    daemon = systemd.new_daemon(recorder=recorder)
    begin, original = setup.now, getattr(daemon, where)

    def breaks() -> None:
        original()
        if where == "catch_up" or setup.now > begin + 500_000:
            raise ZeroDivisionError

    monkeypatch.setattr(daemon, where, breaks)
    with pytest.raises(ZeroDivisionError):
        daemon.run()
    # closed, and the last that was heard is NotAvailable of every axle and Stopping
    assert dump.begun == [(True, [0, 0, 0, 0, 3])]
    assert systemd.heard()[-1] == "STOPPING=1"


def test_failing_shutdown_frames_keep_the_exception_and_close_the_link(
    systemd: Systemd, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*_: object) -> bool:
        raise ZeroDivisionError("no bus")

    monkeypatch.setattr(systemd.setup.link, "send", broken)
    with pytest.raises(ZeroDivisionError):
        systemd.daemon.run()
    assert systemd.setup.link.closed
    assert "the last frames were not sent: ZeroDivisionError('no bus')" in capsys.readouterr().err


def test_sighup_stops_the_daemon_as_sigterm_does(systemd: Systemd, monkeypatch: pytest.MonkeyPatch) -> None:
    """The terminal of whoever started it is gone; systemd starts it again."""
    kill_after({200: signal.SIGHUP}, systemd, systemd.daemon, monkeypatch)
    systemd.daemon.run()
    assert systemd.heard()[-1] == "STOPPING=1"
    assert [f.data[1] >> 4 & 3 for f in systemd.setup.link.sent[-5:]] == [0, 0, 0, 0, 3]


def test_sighup_that_was_ignored_at_the_start_stays_ignored(systemd: Systemd, monkeypatch: pytest.MonkeyPatch) -> None:
    """As nohup has it."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    kill_after({200: signal.SIGHUP, 400: signal.SIGTERM}, systemd, systemd.daemon, monkeypatch)
    begin = systemd.setup.now
    systemd.daemon.run()
    assert systemd.setup.now - begin >= 400_000


def test_notifier_without_a_socket_sends_nothing() -> None:
    Notifier({}).notify("READY=1")


def test_overdue_turn_is_due_at_once(setup: Setup) -> None:
    setup.daemon.turn()
    assert 0.0 < setup.daemon.wait_s() <= 0.006
    setup.now += 7_000
    assert setup.daemon.wait_s() == 0.0
    setup.daemon.turn()
    setup.now -= 3_600_000_000
    assert setup.daemon.wait_s() <= 0.021
