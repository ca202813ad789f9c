"""The program that writes a dump, beside the daemon: python -m wrcd.recorder.writer RING REQUEST, two open files.

It imports little, and ends with an errno as its status.
"""

import json
import mmap
import os
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wrcd.bus.frame import Frame
from wrcd.bus.log import format_line
from wrcd.recorder.child import OVERWRITTEN, UNKNOWN, Child
from wrcd.recorder.folder import Bound, write_dump
from wrcd.recorder.ring import ADVANCED, RECEIVED, SENT, Overwritten, Ring, read_ring
from wrcd.recorder.state_file import Event, document

# It stops so often for so long: where the lowest priority is not allowed or means little, the loop has the processor
# in between.
PAUSE_LINES, PAUSE_S = 100, 0.001


@dataclass(frozen=True, slots=True)
class Request:
    """What to write: the ring's records from position to end, with the core (encoded) as it was at position."""

    folder: str
    name: str
    channel: str
    position: int
    end: int
    data_bytes: int  # of each frame, that the ring keeps
    fits: dict[str, Any]
    core: Any
    healths: list[tuple[int, dict[str, Any]]]  # by position: what the core was told of loop and link from there on
    max_dumps: int
    max_bytes: int
    changes: str = ""  # rows of what `wrcd replay --events` gives
    urgent: bool = False  # the daemon ends: nobody is disturbed


def start(ring: Ring, request: Request) -> Child:
    """Have it written by a process. Raises OSError."""
    asked = os.memfd_create("wrcd-request")
    try:
        with os.fdopen(os.dup(asked), "wb") as f:
            f.write(json.dumps({name: getattr(request, name) for name in Request.__slots__}).encode())
        command = [sys.executable, "-m", "wrcd.recorder.writer", str(ring.fd), str(asked)]
        return Child(command, (ring.fd, asked), urgent=request.urgent)
    finally:
        os.close(asked)


def lines_and_events(memory: bytes | mmap.mmap, r: Request) -> tuple[list[str], list[Event]]:
    """The log, and what happened between its lines. What was sent stands where its stamp belongs in its turn."""
    changed, channel = dict(r.healths), r.channel
    lines: list[str] = []
    events: list[Event] = []
    came: list[Frame] = []
    went: list[Frame] = []

    def flush() -> None:
        # a sort would not do: what came stays in the order in which it was fed, whatever its stamps
        for frame in came:
            while went and went[0].stamp_us <= frame.stamp_us:
                lines.append(format_line(went.pop(0), channel))
            lines.append(format_line(frame, channel))
        lines.extend(format_line(frame, channel) for frame in went)
        came.clear()
        went.clear()

    for at, (kind, frame) in enumerate(read_ring(memory, r.position, r.end, r.data_bytes), r.position):
        if at % PAUSE_LINES == 0 and not r.urgent:
            time.sleep(PAUSE_S)
        if kind == SENT:
            went.append(frame)
            continue
        if went or kind != RECEIVED:
            flush()
        if kind == RECEIVED:
            came.append(frame)
        elif kind == ADVANCED:
            events.append(Event(len(lines), advance_us=frame.stamp_us))
        else:
            events.append(Event(len(lines), health=changed[at]))
    flush()
    return lines, events


def run(ring_fd: int, request_fd: int) -> None:
    """Write what is asked for. Raises OSError, Overwritten."""
    memory = os.pread(ring_fd, os.fstat(ring_fd).st_size, 0)  # before the daemon comes round to it
    asked = json.loads(os.pread(request_fd, os.fstat(request_fd).st_size, 0))
    r = Request(**asked)
    lines, events = lines_and_events(memory, r)
    log = ("\n".join(lines) + "\n" * bool(lines)).encode()
    state = document(r.fits, r.core, events, len(lines))
    write_dump(Path(r.folder), r.name, log, state, r.changes.encode(), Bound(r.max_dumps, r.max_bytes))


def main() -> int:
    """0, or why not."""
    try:
        run(int(sys.argv[1]), int(sys.argv[2]))
    except OSError as e:
        return e.errno or UNKNOWN
    except Overwritten:
        return OVERWRITTEN
    except Exception:
        traceback.print_exc()
        return UNKNOWN
    return 0


if __name__ == "__main__":
    sys.exit(main())
