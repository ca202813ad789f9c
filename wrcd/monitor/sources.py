"""Where frames come from: a reader's process, a link of this one, or a log."""

import fcntl
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from wrcd.bus.dbc import Database
from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES, Link
from wrcd.bus.opening import open_link
from wrcd.bus.positions import is_fd
from wrcd.core.configuration import Config
from wrcd.errors import BusError, InputError
from wrcd.logs.columns import Stretch
from wrcd.logs.reader import LogReader
from wrcd.logs.story import SENT, estimate
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.bus_reader import FAILED, FRAMES, HEALTH, OPENED, Unpacker
from wrcd.monitor.panels import SourceState

READER = "wrcd.monitor.bus_reader"
IN_ONE_PROCESS = ("virtual",)  # python-can's interfaces that another process does not hear
LONG_S = 30 * 86_400.0  # of a log all is kept; its columns grow as they are needed
OPEN_S = 10.0  # in so long the reader has opened its bus
PIPE_BYTES = 1 << 20  # that wait in the pipe, as far as the system allows
READ_BYTES = 1 << 20
MAX_TURN_BYTES = 8 << 20  # taken at once, so that a screen that was stopped catches up without standing still


class FrameSource(Protocol):
    """Read-only: it has nothing to send by."""

    def take(self) -> Iterator[tuple[Batch, int]]:
        """What has come, and until when there is nothing else (µs since 1970)."""

    def state(self) -> SourceState:
        """How the link is."""

    def close(self) -> None:
        """Let go of the bus."""


class ReaderProcess:
    """A bus that another process reads (reader.py)."""

    def __init__(self, interface: str, channel: str, fd: bool, module: str = READER, files: Sequence[int] = ()) -> None:
        """Begin. module and files: what reads in its place, with open files, in a test."""
        self.name = f"{interface}:{channel}"
        self._now = SourceState(self.name, "live")
        self._unpacker = Unpacker()
        bus = json.dumps({"interface": interface, "channel": channel, "fd": fd})
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, bus], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, close_fds=True,
            pass_fds=files, start_new_session=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        self._pipe = self._process.stdout.fileno()
        os.set_blocking(self._pipe, False)
        self._widen()
        self._early: list[tuple[Batch, int]] = []

    def _widen(self) -> None:
        """Let the pipe hold more, where the system allows it."""
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):
                fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)

    def wait_open(self) -> None:
        """Until the bus is open. Raises BusError, or the InputError that the reader met."""
        end = time.monotonic() + OPEN_S
        while time.monotonic() < end:
            select.select([self._pipe], [], [], max(end - time.monotonic(), 0.0))
            data = self._read()
            for kind, width, until_us, body in self._unpacker.take(data or b""):
                if kind == FAILED:
                    record = json.loads(body)
                    self.close()
                    made = BusError if record["kind"] == "BusError" else InputError
                    raise made(record["reason"], key=record["key"], hint=record["hint"])
                if kind == OPENED:
                    return
                self._keep(kind, width, until_us, body, self._early)
            if data == b"":
                break
        self.close()
        raise BusError(f"{self.name}: its reader did not start", key="channel")

    def _read(self) -> bytes | None:
        """None: nothing there; b"": it has ended."""
        try:
            return os.read(self._pipe, READ_BYTES)
        except BlockingIOError:
            return None

    def take(self) -> Iterator[tuple[Batch, int]]:
        """What has come."""
        out, self._early = self._early, []
        taken = 0
        while taken < MAX_TURN_BYTES and (data := self._read()):
            taken += len(data)
            for kind, width, until_us, body in self._unpacker.take(data):
                self._keep(kind, width, until_us, body, out)
        if self._process.poll() is not None:
            self._now = SourceState(self.name, "live", "Lost: its reader has ended", self._now.lost)
        yield from _joined(out)

    def _keep(self, kind: int, width: int, until_us: int, body: bytes, out: list[tuple[Batch, int]]) -> None:
        if kind == FRAMES:
            out.append((Batch.of_bytes(width, body), until_us))
        elif kind == HEALTH:
            health = json.loads(body)
            self._now = SourceState(self.name, "live", health["state"], health["drops"] + health["lost"])

    def state(self) -> SourceState:
        """How the link is."""
        return self._now

    def close(self) -> None:
        """End the reader."""
        if self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(2.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()


class OwnLink:
    """A bus that this process reads itself: python-can's virtual one lives in one process."""

    def __init__(self, link: Link) -> None:
        self._receive, self._close, self._health, self.name = link.receive, link.close, link.health, link.name

    def take(self) -> Iterator[tuple[Batch, int]]:
        """What has come."""
        more = True
        while more:
            now_us = time.time_ns() // 1000
            frames = self._receive(now_us)
            more = len(frames) >= MAX_FRAMES
            yield Batch.of_frames(frames), 0 if more else now_us

    def state(self) -> SourceState:
        """How the link is."""
        h = self._health
        return SourceState(self.name, "live", h.state, h.drops)

    def close(self) -> None:
        """Let go of the bus."""
        self._close()


class NoMore:
    """A log that has been read."""

    def __init__(self, name: str) -> None:
        self._now = SourceState(name, "log")

    def take(self) -> Iterator[tuple[Batch, int]]:
        """Return nothing."""
        return iter(())

    def state(self) -> SourceState:
        """Return its name."""
        return self._now

    def close(self) -> None:
        """Do nothing."""


def open_source(config: Config, interface: str, channel: str) -> FrameSource:
    """Return the bus, read by a process of its own where that can hear it. Raises BusError, a process later."""
    fd = interface == "socketcan" or any(is_fd(m) for m in config.database.messages)
    if interface in IN_ONE_PROCESS:
        return OwnLink(open_link(interface, channel, None, fd=fd, user_settings=True))
    return ReaderProcess(interface, channel, fd)


def model_of_log(
    log: Path, config: Config, databases: Sequence[Database], channel: str | None, bit_rate: int
) -> tuple[BusModel, list[str]]:
    """Return the model of a log, and what is odd about it: what its frames say, or, where no daemon's are among them,
    what the core makes of it. Raises InputError where it cannot be read."""
    model = BusModel(config, databases, bit_rate=bit_rate, hold_s=LONG_S)
    with LogReader(log, channel, shows=True) as reader:
        for batch in _batches(reader.monotonic()):
            model.take(batch, 0)
    model.source, model.is_whole, warnings = SENT, reader.whole, reader.warnings
    model.clock_steps += len(reader.clock.steps)
    if not any(len(a.held.adhesion) for a in model.axles):
        model.take_estimated(estimate(log, config, channel), reader.clock.gaps)
        warnings.insert(0, "the log has no frame of a daemon: estimated here")
    model.update()
    return model, warnings


def _batches(items: Iterable[Stretch | tuple[Frame, str]]) -> Iterator[Batch]:
    single: list[Frame] = []
    for item in items:
        if not isinstance(item, Stretch):
            single.append(item[0])
        if single and (isinstance(item, Stretch) or len(single) >= MAX_FRAMES):
            yield Batch.of_frames(single)
            single = []
        if isinstance(item, Stretch):
            yield Batch.of_stretch(item)
    if single:
        yield Batch.of_frames(single)


def _joined(parts: Sequence[tuple[Batch, int]]) -> Iterator[tuple[Batch, int]]:
    """Batches of one width as one: many small ones cost more than a large one."""
    group: list[Batch] = []
    until_us = 0
    for batch, until in parts:
        if group and batch.data.shape[1] != group[0].data.shape[1] and len(batch):
            yield Batch.joined(group), until_us
            group = []
        if len(batch) or not group:
            group = [b for b in group if len(b)] + [batch]
        until_us = until or until_us
    if group:
        yield Batch.joined(group), until_us
