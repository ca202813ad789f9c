"""Where frames come from: a reader's process, a link of this one, or a log."""

import fcntl
import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, Protocol

from wrcd.bus.link import MAX_FRAMES, Link
from wrcd.errors import BusError, InputError
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.packing import FAILED, FRAMES, HEALTH, OPENED, Unpacker
from wrcd.tools.monitor.panels import Link as LinkNow

READER = "wrcd.tools.monitor.reader"
OPEN_S = 10.0  # in so long the reader has opened its bus
PIPE_BYTES = 1 << 20  # that wait in the pipe, as far as the system allows
READ_BYTES = 1 << 20
MAX_TURN_BYTES = 8 << 20  # taken at once, so that a screen that was stopped catches up without standing still


class Source(Protocol):
    """Read-only: it has nothing to send by."""

    def take(self) -> Iterator[tuple[Batch, int]]:
        """What has come, and until when there is nothing else (µs since 1970)."""

    def link(self) -> LinkNow:
        """How the link is."""

    def close(self) -> None:
        """Let go of the bus."""


class ReaderProcess:
    """A bus that another process reads (reader.py)."""

    def __init__(self, interface: str, channel: str, fd: bool, module: str = READER, files: Sequence[int] = ()) -> None:
        """Begin. module and files: what reads in its place, with open files, in a test."""
        self.name = f"{interface}:{channel}"
        self._now = LinkNow(self.name, "live")
        self._unpacker = Unpacker()
        asked = json.dumps({"interface": interface, "channel": channel, "fd": fd})
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, asked], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, close_fds=True,
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
            self._now = LinkNow(self.name, "live", "Lost: its reader has ended", self._now.lost)
        yield from _joined(out)

    def _keep(self, kind: int, width: int, until_us: int, body: bytes, out: list[tuple[Batch, int]]) -> None:
        if kind == FRAMES:
            out.append((Batch.of_bytes(width, body), until_us))
        elif kind == HEALTH:
            self._now = _link_now(self.name, json.loads(body))

    def link(self) -> LinkNow:
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

    def link(self) -> LinkNow:
        """How the link is."""
        h = self._health
        return LinkNow(self.name, "live", h.state, h.drops)

    def close(self) -> None:
        """Let go of the bus."""
        self._close()


class NoMore:
    """A log that has been read."""

    def __init__(self, name: str) -> None:
        self._now = LinkNow(name, "log")

    def take(self) -> Iterator[tuple[Batch, int]]:
        """Nothing."""
        return iter(())

    def link(self) -> LinkNow:
        """Its name."""
        return self._now

    def close(self) -> None:
        """Nothing."""


def _link_now(name: str, health: dict[str, Any]) -> LinkNow:
    return LinkNow(name, "live", health["state"], health["drops"] + health["lost"])


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
