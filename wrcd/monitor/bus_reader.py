"""The process that reads a bus for `wrcd monitor`, and writes what it read to a pipe.

A process of its own: neither the screen's drawing nor its garbage collector can keep it from the kernel's buffer, which
the kernel's default fills in 278 frames. Frames that the screen does not fetch wait here.
"""

import gc
import json
import os
import signal
import struct
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any

from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES, Link
from wrcd.bus.opening import open_link
from wrcd.errors import InputError

EVERY_S = 0.01  # a look: at 50 000 frames/s the kernel's default buffer bears it
HEALTH_S = 0.5
URGENT = -10  # nice value
MAX_WAITING = 64 << 20  # bytes that wait for the screen: 12 minutes of 4000 frames/s

HEAD = struct.Struct("<IBBq")  # length of the body, kind, data bytes of its frames, until when all has been read (µs)
FRAMES, HEALTH, OPENED, FAILED = 1, 2, 3, 4  # kinds
WIDTHS = (8, 64)  # data bytes that packed frames have
_STRUCTS = {width: struct.Struct(f"<qIBBB{width}s") for width in WIDTHS}


def pack(frames: Sequence[Frame]) -> tuple[int, bytes]:
    """Return the data bytes that each frame has, and all frames. Bits of flags: remote, error, FD."""
    width = WIDTHS[any(f.fd and len(f.data) > WIDTHS[0] for f in frames)]
    put = _STRUCTS[width].pack
    return width, b"".join(
        [put(f.stamp_us, f.key, f.remote | f.error << 1 | f.fd << 2, f.extra, len(f.data), f.data) for f in frames]
    )


def frames_message(frames: Sequence[Frame], until_us: int) -> bytes:
    """Return the message of frames, perhaps none, and until when everything that came has been read."""
    width, body = pack(frames)
    return HEAD.pack(len(body), FRAMES, width, until_us) + body


def message_of(kind: int, record: Mapping[str, Any]) -> bytes:
    """Return a message of another kind."""
    body = json.dumps(record).encode()
    return HEAD.pack(len(body), kind, 0, 0) + body


class Unpacker:
    """Cuts a stream into its messages."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self, data: bytes) -> Iterator[tuple[int, int, int, bytes]]:
        """Return kind, width, until_us and body of each message that is whole."""
        text, at = self._rest + data, 0
        while len(text) - at >= HEAD.size:
            length, kind, width, until_us = HEAD.unpack_from(text, at)
            end = at + HEAD.size + length
            if end > len(text):
                break
            yield kind, width, until_us, text[at + HEAD.size : end]
            at = end
        self._rest = text[at:]


class Pump:
    """Link to pipe. The link only receives: nothing here can send."""

    def __init__(self, receive: Callable[[int], list[Any]], health: Callable[[], Mapping[str, Any]], out: int) -> None:
        self._receive, self._health, self._out = receive, health, out
        os.set_blocking(out, False)
        self._waiting: deque[bytes] = deque()
        self._bytes = 0
        self._lost = 0
        self._health_s = 0.0

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
        if time.monotonic() - self._health_s >= HEALTH_S:
            self._health_s = time.monotonic()
            self._put(message_of(HEALTH, {**self._health(), "lost": self._lost}))
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
    bus = json.loads(sys.argv[1])
    try:
        link = open_link(bus["interface"], bus["channel"], None, fd=bus["fd"], user_settings=True)
    except InputError as e:
        record = {"reason": e.reason, "key": e.key, "hint": e.hint, "kind": type(e).__name__}
        os.write(out, message_of(FAILED, record))
        return e.status
    os.write(out, message_of(OPENED, {"name": link.name}))
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
