"""`sim-ecu play`: onto a bus in real time, or into a log as fast as it computes."""

import contextlib
import errno
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import can

from sim_ecu.play.encoder import SAMPLE_US, Sent
from sim_ecu.play.faults import KINDS, Fault, Stage
from sim_ecu.play.interface import PythonCan, check
from sim_ecu.play.logs import check_format, open_logger
from sim_ecu.play.mapped import Train
from sim_ecu.play.pace import Clock
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import Scenario
from sim_ecu.play.train import PACKAGED
from wrcd.errors import BusError
from wrcd.progress import Progress

# A log made without a bus begins at this moment, so that the same scenario gives the same bytes.
LOG_START_US = 1_700_000_000_000_000
BUSY_US = 50_000  # so late, frames cost Validity: the time-out of a sensor and its cycle
MAX_SAMPLES = 20  # of a step: a computer that never catches up obeys Ctrl-C all the same


@dataclass(slots=True)
class PlayTally:
    """What playing came to."""

    frames: int = 0
    unsent: int = 0
    overruns: int = 0  # samples that began more than one sample too late
    latest_us: int = 0

    def text(self) -> str:
        """One line for a person."""
        return (
            f"{self.frames} frames, {self.unsent} not sent, {self.overruns} overruns, "
            f"latest {self.latest_us / 1000:.1f} ms behind its deadline"
        )

    @property
    def too_slow(self) -> str:
        """That the computer did not keep real time, and by how much; "" where it did."""
        if self.latest_us <= BUSY_US:
            return ""
        return (
            f"this computer was too slow, or busy: frames came up to {self.latest_us / 1e6:.2f} s late, which a daemon "
            "takes for sensors that fall silent"
        )


def message(sent: Sent, stamp_us: int, channel: str) -> can.Message:
    """A frame as python-can's message."""
    return can.Message(
        timestamp=stamp_us * 1e-6, arbitration_id=sent.can_id, data=sent.data, is_extended_id=sent.extended,
        channel=channel, is_error_frame=sent.error, is_fd=sent.fd,
    )  # fmt: skip


def fault_line(fault: Fault, begin_us: int, end_us: int) -> str:
    """Return what was wrong, and from when to when, in seconds since 1970."""
    place = f"of={fault.of} axle={fault.axle}" if KINDS[fault.kind].stage is not Stage.BUS else "of=bus"
    return f"fault {fault.kind} {place} begin={begin_us * 1e-6:.6f} end={end_us * 1e-6:.6f}"


def play_to_log(scenario: Scenario, log: Path, truth: bool = True, train: Train = PACKAGED) -> PlayTally:
    """Play as fast as it computes; the log's suffix gives its format. Faults of the interface are silence there."""
    check_format(log, scenario, train)
    tally, progress = PlayTally(), Progress()
    player = Player(scenario, truth, LARGE_CHUNK, train)
    with open_logger(log) as logger:
        for due_us, frames in player:
            for f in frames:
                logger.on_message_received(message(f, LOG_START_US + f.due_us, "can0"))
            tally.frames += len(frames)
            progress.at(scenario.name, due_us / (player.samples * SAMPLE_US))
    progress.end()
    for fault in sorted(scenario.faults, key=lambda f: f.at_s):
        print(fault_line(fault, LOG_START_US + fault.begin_us, LOG_START_US + fault.end_us))
    return tally


class Sender(Protocol):
    """What frames are played onto: a bus of python-can's, or what stands in for one."""

    channel_info: Any

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send at once, or not at all."""


class FaultyBus(Sender, Protocol):
    """One that can be taken away."""

    def begin(self, fault: Fault) -> None:
        """A fault begins: take it away, if the fault does."""

    def end(self, fault: Fault) -> None:
        """The fault ends: give it back."""


class RealTime:
    """Plays in real time. step() sends what is due, so that a loop may do other things between. on_fault is called
    when a fault begins (True) and when it ends. ahead makes all frames before the first is due: then playing costs
    little, so that a slow computer keeps time."""

    def __init__(
        self,
        scenario: Scenario,
        bus: Sender,
        logger: can.Listener | None,
        truth: bool = True,
        on_fault: Callable[[Fault, bool], None] | None = None,
        ahead: bool = False,
        train: Train = PACKAGED,
        clock: Clock = time,
    ) -> None:
        self.tally, self._clock = PlayTally(), clock
        self._on_fault = on_fault
        self._away_until_us = 0
        # an end before a beginning at the same time
        moments = [
            (t, begins, k)
            for k, f in enumerate(scenario.faults)
            for t, begins in ((f.begin_us, True), (f.end_us, False))
        ]
        self._moments = [(t, begins, scenario.faults[k]) for t, begins, k in sorted(moments)]
        player = Player(scenario, truth, train=train)
        self._samples = iter(list(player) if ahead else player)
        self._next = next(self._samples, None)
        self._bus, self._logger = bus, logger
        self._channel = str(bus.channel_info).split("'")[1] if "'" in str(bus.channel_info) else "can0"
        self._start_ns = clock.monotonic_ns()

    @property
    def time_s(self) -> float:
        """Since it began."""
        return self._now_us() * 1e-6

    def wait_s(self) -> float:
        """Return how long until the next sample is due (s); 0 at the end."""
        if self._next is None:
            return 0.0
        return max(self._start_ns + self._next[0] * 1000 - self._clock.monotonic_ns(), 0) * 1e-9

    def step(self) -> bool:
        """Send the samples that are due by now, MAX_SAMPLES of them at most. False when the scenario is over. Deadlines
        are absolute: a late sample does not move the next one."""
        for _ in range(MAX_SAMPLES):
            if self._next is None:
                break
            late_us = self._now_us() - self._next[0]
            if late_us < 0:
                return True
            self.tally.latest_us = max(self.tally.latest_us, late_us)
            self.tally.overruns += late_us > SAMPLE_US
            self._report_faults(self._next[0])
            if self._next[0] >= self._away_until_us:
                for f in self._next[1]:
                    self._send(f)
            self._next = next(self._samples, None)
        if self._next is not None:
            return True
        if self._moments:
            self._report_faults(self._moments[-1][0])
        return False

    def _now_us(self) -> int:
        return (self._clock.monotonic_ns() - self._start_ns) // 1000

    def _report_faults(self, due_us: int) -> None:
        while self._on_fault is not None and self._moments and self._moments[0][0] <= due_us:
            _, begins, fault = self._moments.pop(0)
            before_us = self._now_us()
            self._on_fault(fault, begins)
            if self._now_us() - before_us > SAMPLE_US:
                # the interface took its time; what was due meanwhile is lost, as it is to sensors, who do not wait
                self._away_until_us = self._now_us()

    def _send(self, f: Sent) -> None:
        m = message(f, self._clock.time_ns() // 1000, self._channel)
        try:
            self._bus.send(m, timeout=0)
            self.tally.frames += 1
        except can.CanOperationError as e:
            self.tally.unsent += 1
            if e.error_code in (errno.ENODEV, errno.ENXIO):
                raise BusError("the CAN interface has gone", key="channel") from None
        if self._logger is not None:
            self._logger.on_message_received(m)


def play_on_bus(
    scenario: Scenario, interface: str, channel: str, log: Path | None, truth: bool = True, ahead: bool = False,
    train: Train = PACKAGED,
) -> PlayTally:  # fmt: skip
    """Until the scenario ends or SIGTERM or Ctrl-C comes."""
    check(scenario.faults, interface, channel)
    if log is not None:
        check_format(log, scenario, train)
    with contextlib.ExitStack() as cleanup:
        bus = PythonCan(interface, channel, train.has_fd)
        cleanup.callback(bus.shutdown)
        logger = cleanup.enter_context(open_logger(log)) if log else None
        return _play_onto(bus, scenario, logger, truth, ahead, train)


def _play_onto(
    bus: FaultyBus, scenario: Scenario, logger: can.Listener | None, truth: bool, ahead: bool, train: Train
) -> PlayTally:
    stop, progress = False, Progress()

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal stop
        stop = True

    for s in (signal.SIGTERM, signal.SIGINT):
        signal.signal(s, on_signal)
    began: dict[Fault, int] = {}

    def on_fault(fault: Fault, begins: bool) -> None:
        if begins:
            began[fault] = time.time_ns() // 1000
            bus.begin(fault)
        else:
            bus.end(fault)
            progress.end()
            print(fault_line(fault, began[fault], time.time_ns() // 1000), flush=True)

    rig = RealTime(scenario, bus, logger, truth, on_fault, ahead, train)
    try:
        while not stop and rig.step():
            progress.at(scenario.name, min(rig.time_s / scenario.duration_s, 1.0))
            time.sleep(rig.wait_s())
    finally:
        progress.end()
    return rig.tally
