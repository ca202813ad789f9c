"""`sim-ecu play`: onto a bus in real time, or into a log as fast as it computes."""

import contextlib
import errno
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import can

from sim_ecu.play.encoder import Sent
from sim_ecu.play.player import SAMPLE_US, Player
from sim_ecu.play.scenario import Scenario
from wrcd.errors import BusError, InputError
from wrcd.tools.progress import Progress

# A log made without a bus begins at this moment, so that the same scenario gives the same bytes.
LOG_START_US = 1_700_000_000_000_000


@dataclass(slots=True)
class Tally:
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


def message(sent: Sent, stamp_us: int, channel: str) -> can.Message:
    """A frame as python-can's message."""
    return can.Message(
        timestamp=stamp_us * 1e-6, arbitration_id=sent.can_id, data=sent.data, is_extended_id=False, channel=channel
    )


def play_to_log(scenario: Scenario, log: Path, truth: bool = True) -> Tally:
    """As fast as it computes; the suffix of the log tells its format."""
    tally, progress = Tally(), Progress()
    player = Player(scenario, truth)
    with open_logger(log) as logger:
        for due_us, frames in player:
            for f in frames:
                logger.on_message_received(message(f, LOG_START_US + f.due_us, "can0"))
            tally.frames += len(frames)
            progress.at(scenario.name, due_us / (player.samples * SAMPLE_US))
    progress.end()
    return tally


@contextlib.contextmanager
def open_logger(log: Path) -> Iterator[can.Listener]:
    """python-can's writer for the suffix. Raises InputError if there is none or the file can't be made."""
    try:
        logger = can.Logger(log)
    except (ValueError, OSError, ImportError, NotImplementedError) as e:
        raise InputError(f"cannot be written: {e}", file=log, hint="use .log for a candump log") from None
    try:
        yield logger
    finally:
        logger.stop()


class RealTime:
    """Plays in real time. step() sends what is due, so that a loop may do other things between."""

    def __init__(self, scenario: Scenario, bus: can.BusABC, logger: can.Listener | None, truth: bool = True) -> None:
        self.tally = Tally()
        self._samples = iter(Player(scenario, truth))
        self._next = next(self._samples, None)
        self._bus, self._logger = bus, logger
        self._channel = str(bus.channel_info).split("'")[1] if "'" in str(bus.channel_info) else "can0"
        self._start_ns = time.monotonic_ns()

    def wait_s(self) -> float:
        """How long until the next sample is due; 0 at the end."""
        if self._next is None:
            return 0.0
        return max(self._start_ns + self._next[0] * 1000 - time.monotonic_ns(), 0) * 1e-9

    def step(self) -> bool:
        """Send the samples that are due by now. False when the scenario is over. Deadlines are absolute: a late
        sample does not move the next one."""
        while self._next is not None:
            late_us = (time.monotonic_ns() - self._start_ns) // 1000 - self._next[0]
            if late_us < 0:
                return True
            self.tally.latest_us = max(self.tally.latest_us, late_us)
            self.tally.overruns += late_us > SAMPLE_US
            for f in self._next[1]:
                self._send(f)
            self._next = next(self._samples, None)
        return False

    def _send(self, f: Sent) -> None:
        m = message(f, time.time_ns() // 1000, self._channel)
        try:
            self._bus.send(m, timeout=0)
            self.tally.frames += 1
        except can.CanOperationError as e:
            self.tally.unsent += 1
            if e.error_code in (errno.ENODEV, errno.ENXIO):
                raise BusError("the CAN interface has gone", key="channel") from None
        if self._logger is not None:
            self._logger.on_message_received(m)


def open_bus(interface: str, channel: str) -> can.BusABC:
    """A bus by python-can's names. Raises BusError."""
    try:
        return can.Bus(interface=interface, channel=channel, can_filters=[{"can_id": 0x7FF, "can_mask": 0x7FF}])
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError, AttributeError) as e:
        hint = f"ip link add {channel} type vcan && ip link set {channel} up" if channel.startswith("vcan") else ""
        raise BusError(f"{interface} {channel} cannot be opened: {e}", key="channel", hint=hint) from None


def play_on_bus(scenario: Scenario, interface: str, channel: str, log: Path | None, truth: bool = True) -> Tally:
    """Until the scenario ends or SIGTERM or Ctrl-C comes."""
    stop = False

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal stop
        stop = True

    with contextlib.ExitStack() as cleanup:
        bus = cleanup.enter_context(open_bus(interface, channel))
        logger = cleanup.enter_context(open_logger(log)) if log else None
        for s in (signal.SIGTERM, signal.SIGINT):
            signal.signal(s, on_signal)
        rig = RealTime(scenario, bus, logger, truth)
        while not stop and rig.step():
            time.sleep(rig.wait_s())
    return rig.tally
