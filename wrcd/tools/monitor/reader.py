"""The process that reads a bus for `wrcd monitor`, and writes what it read to a pipe.

A process of its own: neither the screen's drawing nor its garbage collector can keep it from the kernel's buffer, which
the kernel's default fills in 278 frames. Frames that the screen does not fetch wait here.
"""

import gc
import json
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

from wrcd.bus.link import MAX_FRAMES, Link
from wrcd.bus.opening import open_link
from wrcd.errors import InputError
from wrcd.tools.monitor.packing import FAILED, HEALTH, OPENED, frames_message, told

EVERY_S = 0.01  # a look: at 50 000 frames/s the kernel's default buffer bears it
HEALTH_S = 0.5
URGENT = -10  # nice value
MAX_WAITING = 64 << 20  # bytes that wait for the screen: 12 minutes of 4000 frames/s


class Pump:
    """Link to pipe. The link only receives: nothing here can send."""

    def __init__(self, receive: Callable[[int], list[Any]], health: Callable[[], Mapping[str, Any]], out: int) -> None:
        self._receive, self._health, self._out = receive, health, out
        os.set_blocking(out, False)
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._lost = 0
        self._told_s = 0.0

    def turn(self) -> bool:
        """Take what is there and hand on what the pipe takes. Returns whether there may be more at once.

        Raises BrokenPipeError once nobody reads any more.
        """
        now_us = time.time_ns() // 1000
        frames = self._receive(now_us)
        if self._bytes < MAX_WAITING:
            # a frame that comes while they are read is stamped later than the look began
            self._put(frames_message(frames, 0 if len(frames) >= MAX_FRAMES else now_us))
        else:
            self._lost += len(frames)
        if time.monotonic() - self._told_s >= HEALTH_S:
            self._told_s = time.monotonic()
            self._put(told(HEALTH, {**self._health(), "lost": self._lost}))
        self._write()
        return len(frames) >= MAX_FRAMES

    def _put(self, message: bytes) -> None:
        self._waiting.append(message)
        self._bytes += len(message)

    def _write(self) -> None:
        while self._waiting:
            message = self._waiting[0]
            try:
                written = os.write(self._out, message)
            except BlockingIOError:
                return
            self._bytes -= written
            if written == len(message):
                self._waiting.popleft()
            else:
                self._waiting[0] = message[written:]


def health_of(link: Link) -> Mapping[str, Any]:
    """What the link has seen."""
    h = link.health
    return {"state": h.state, "drops": h.drops, "reopens": h.reopens, "error_frames": h.error_frames}


def main() -> int:
    """Read the bus that the first argument tells, as JSON, and write to standard output until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the screen's
    out = sys.stdout.fileno()
    asked = json.loads(sys.argv[1])
    try:
        link = open_link(asked["interface"], asked["channel"], None, fd=asked["fd"], user_settings=True)
    except InputError as e:
        record = {"reason": e.reason, "key": e.key, "hint": e.hint, "kind": type(e).__name__}
        os.write(out, told(FAILED, record))
        return e.status
    os.write(out, told(OPENED, {"name": link.name}))
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, URGENT)  # who may not do without: the kernel's buffer has to last
    gc.freeze()
    gc.disable()  # frames make no circles, and this process makes nothing else
    pump = Pump(link.receive, lambda: health_of(link), out)
    try:
        while True:
            if not pump.turn():
                time.sleep(EVERY_S)
    except BrokenPipeError:
        return 0
    finally:
        link.close()


if __name__ == "__main__":
    sys.exit(main())
