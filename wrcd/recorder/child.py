"""A process beside the loop for one job."""

import os
import signal
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

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
        while (said := self.finished()) is None and time.monotonic() < self._end + 0.5:
            alive()
            time.sleep(0.02)
        return "it took too long" if said is None else said  # a process whose disk hangs cannot even be killed


def _environment() -> Mapping[str, str]:
    """Ours, without systemd's socket: who is not the daemon has nothing to say to it."""
    return {key: value for key, value in os.environ.items() if key != "NOTIFY_SOCKET"}
