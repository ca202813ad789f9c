"""The program that writes a dump, beside the daemon: python -m wrcd.recorder.writer RING REQUEST, two open files.

It imports little, and ends with an errno as its status.
"""

import json
import mmap
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.recorder.dump_folder import Bound, write_dump
from wrcd.recorder.ring import ADVANCED, RECEIVED, SENT, Overwritten, Ring, read_ring
from wrcd.recorder.state_file import StateEvent, document

MAX_S = 60.0  # a disk that takes longer hangs
# Exit statuses of a child: an errno, or one of
OVERWRITTEN, UNKNOWN = 254, 255
_WORDS = {OVERWRITTEN: "its frames were overwritten meanwhile", UNKNOWN: "failed"}
_BLOCKED_SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1)  # meant for the daemon


class Child:
    """A program of its own, not a copy of this one: a copy would share its pages, and the loop would pay for every one
    that it writes to afterwards (30 ms in the first turn, measured). It takes over no file but those given."""

    def __init__(
        self, command: list[str], files: Sequence[int] = (), most_s: float = MAX_S, urgent: bool = False
    ) -> None:
        """Where it is not urgent it runs when nobody else wants to. Raises OSError where no process can be made."""
        self._end = time.monotonic() + most_s
        self._killed = False
        try:
            for fd in files:
                os.set_inheritable(fd, True)
            self.pid = os.posix_spawn(command[0], command, _environment(), setsigmask=_BLOCKED_SIGNALS)
        finally:
            for fd in files:
                os.set_inheritable(fd, False)
        if not urgent:
            # from here, before it has so much as begun; where the unit forbids it, its own pauses must do
            with suppress(OSError):
                os.sched_setscheduler(self.pid, os.SCHED_OTHER, os.sched_param(0))
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self.pid, 19)

    def finished(self) -> str | None:
        """None while it works; then "" or what went wrong."""
        if time.monotonic() > self._end and not self._killed:
            self._killed = True
            os.kill(self.pid, signal.SIGKILL)
        try:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
        except ChildProcessError:
            return "its process is lost"
        if pid == 0:
            return None
        code = os.waitstatus_to_exitcode(status)
        if code < 0:
            return "it took too long" if self._killed else f"killed by {signal.Signals(-code).name}"
        return "" if code == 0 else _WORDS.get(code) or os.strerror(code)

    def wait(self, most_s: float, alive: Callable[[], None]) -> str:
        """Wait for it, but not for long: then it is killed. alive is called meanwhile."""
        self._end = min(self._end, time.monotonic() + most_s)
        while (ended := self.finished()) is None and time.monotonic() < self._end + 0.5:
            alive()
            time.sleep(0.02)
        return "it took too long" if ended is None else ended  # a process whose disk hangs cannot even be killed


def _environment() -> Mapping[str, str]:
    """Ours, without systemd's socket: who is not the daemon has nothing to say to it."""
    return {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}


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
    healths: list[tuple[int, dict[str, Any]]]  # by position: the state of loop and link from there on
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


def lines_and_events(memory: bytes | mmap.mmap, r: Request) -> tuple[list[str], list[StateEvent]]:
    """The log, and what happened between its lines. What was sent stands where its stamp belongs in its turn."""
    changed, channel = dict(r.healths), r.channel
    lines: list[str] = []
    events: list[StateEvent] = []
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
            events.append(StateEvent(len(lines), advance_us=frame.stamp_us))
        else:
            events.append(StateEvent(len(lines), health=changed[at]))
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
