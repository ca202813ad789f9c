"""The program that writes a dump, beside the daemon: python -m wrcd.recorder.writer RING REQUEST, two open files.

It imports little.
"""

import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.recorder.dump_folder import ERRNO, write_dump
from wrcd.recorder.ring import RECEIVED, SENT, Overwritten, Ring, read_ring

MAX_S = 60.0  # a disk that takes longer hangs
OVERWRITTEN = 99  # the exit status of a program that failed; another than this or an errno: see what it wrote
_NOT_FOR_IT = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGUSR1)  # but for the daemon
# It stops so often for so long: where the lowest priority is not allowed or means little, the loop has the processor
# in between. When SIGTERM waits for it, the daemon ends: there is no loop to disturb.
PAUSE_LINES, PAUSE_S = 100, 0.001
MAX_CAME = 5000  # more do not come in a turn: where nothing is sent, no more are kept


class Child:
    """A program of its own, not a copy of this one: a copy would share its pages, and the loop would pay for every one
    that it writes to afterwards (30 ms in the first turn, measured). It takes over no file but those given."""

    def __init__(
        self, command: Sequence[str], files: Sequence[int] = (), most_s: float = MAX_S, urgent: bool = False
    ) -> None:
        """Where it is not urgent it runs when nobody else wants to. Raises OSError where no process can be made."""
        self._end = time.monotonic() + most_s
        # without systemd's socket: who is not the daemon has nothing to say to it
        environment = {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
        before = signal.pthread_sigmask(signal.SIG_BLOCK, _NOT_FOR_IT)
        try:
            self._process = subprocess.Popen(command, pass_fds=files, env=environment)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if not urgent:
            # from here, before it has so much as begun; where the unit forbids it, its own pauses must do
            with suppress(OSError):
                os.sched_setscheduler(self._process.pid, os.SCHED_OTHER, os.sched_param(0))
            with suppress(OSError):
                os.setpriority(os.PRIO_PROCESS, self._process.pid, 19)

    def finished(self) -> str | None:
        """None while it works; then "" or what went wrong."""
        late = time.monotonic() > self._end
        if late:
            self._process.kill()
        code = self._process.poll()
        if code is None or code == 0:
            return None if code is None else ""
        if code < 0:
            return "it took too long" if late else f"killed by {signal.Signals(-code).name}"
        if code == OVERWRITTEN:
            return "its frames were overwritten meanwhile"
        return os.strerror(code - ERRNO) if code > ERRNO else "failed"

    def wait(self, most_s: float) -> str:
        """Have it hurry and wait for it, but not for long: then it is killed."""
        self._process.send_signal(signal.SIGTERM)
        self._end = min(self._end, time.monotonic() + most_s)
        while (ended := self.finished()) is None and time.monotonic() < self._end + 0.5:
            time.sleep(0.02)
        return "it took too long" if ended is None else ended  # a process whose disk hangs cannot even be killed


@dataclass(frozen=True, slots=True)
class Request:
    """What to write: the ring's frames from position first to end, and the events and the state as they are to stand
    beside them."""

    folder: str
    name: str
    channel: str
    first: int
    end: int
    data_bytes: int  # of each frame, that the ring keeps
    events: str
    state: str
    max_dumps: int
    max_bytes: int


def start(ring: Ring, request: Request, urgent: bool = False) -> Child:
    """Have it written by a process. Raises OSError."""
    with os.fdopen(os.memfd_create("wrcd-request"), "wb") as asked:
        asked.write(json.dumps(asdict(request)).encode())
        asked.flush()
        files = ring.fd, asked.fileno()
        return Child([sys.executable, "-m", "wrcd.recorder.writer", *map(str, files)], files, urgent=urgent)


def lines(records: Iterable[tuple[int, Frame]], channel: str) -> Iterator[str]:
    """The log. What was sent stands where its stamp belongs in its turn; what came, in the order in which it was fed,
    whatever its stamps: a sort would not do."""
    came: list[Frame] = []
    went: list[Frame] = []

    def turn() -> Iterator[str]:
        for frame in came:
            while went and went[0].stamp_us <= frame.stamp_us:
                yield format_line(went.pop(0), channel) + " T\n"
            yield format_line(frame, channel) + " R\n"
        for frame in went:
            yield format_line(frame, channel) + " T\n"
        came.clear()
        went.clear()

    for kind, frame in records:
        if kind == RECEIVED and (went or len(came) >= MAX_CAME):
            yield from turn()
        (went if kind == SENT else came).append(frame)
    yield from turn()


def run(ring_fd: int, request_fd: int) -> None:
    """Write what is asked for. Raises OSError, Overwritten; SystemExit where a daemon of another version asks, which an
    upgrade has left running."""
    try:
        r = Request(**json.loads(os.pread(request_fd, os.fstat(request_fd).st_size, 0)))
    except TypeError:
        said = "a daemon of another version runs until it is restarted: its dump is not written"
        print(f"wrcd: recorder: {said}", file=sys.stderr)
        sys.exit(errno.EPROTO)  # which that one, too, says in words
    # before anything that a slow disk delays
    records = read_ring(ring_fd, r.data_bytes, r.first, r.end)
    log = chunks(lines(records, r.channel))
    write_dump(Path(r.folder), r.name, log, r.events.encode(), r.state.encode(), r.max_dumps, r.max_bytes)


def chunks(log: Iterator[str]) -> Iterator[bytes]:
    """The log in pieces, with pauses between them."""
    while some := list(islice(log, PAUSE_LINES)):
        yield "".join(some).encode()
        if signal.SIGTERM not in signal.sigpending():
            time.sleep(PAUSE_S)


if __name__ == "__main__":
    try:
        run(int(sys.argv[1]), int(sys.argv[2]))
    except Overwritten:
        sys.exit(OVERWRITTEN)
    except OSError as error:
        sys.exit(ERRNO + (error.errno or 0))
