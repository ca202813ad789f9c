"""How far a long piece of work has come, on standard error."""

import errno
import os
import sys
import time

from wrcd.colour import moves

EVERY_S = 0.5


class Progress:
    """On a terminal one line, written anew twice a second at most. Elsewhere nothing, or each step on its own line."""

    def __init__(self, steps: bool = False) -> None:
        self._terminal = moves(sys.stderr)
        self._steps = steps
        self._began = self._shown = self._before = time.monotonic()
        self._share = 0.0  # of what is going on

    def at(self, what: str, share: float | None = None, before: float = 0.0) -> None:
        """What is going on, and the share of it that is done, from which the time left follows; a smaller share than
        before is of something new. before: the share that was done when this began."""
        now = time.monotonic()
        if share is not None and share < self._share:
            self._began = self._before
        self._share, self._before = self._share if share is None else share, now
        is_due = now - self._shown >= EVERY_S and _in_front() if self._terminal else self._steps
        if not is_due:
            return
        self._shown = now
        text = what if share is None else f"{what}: {100 * share:.0f} %"
        if share is not None and before < share < 1:
            text += f", about {(now - self._began) * (1 - share) / (share - before):.0f} s left"
        start, end = ("\r\033[K", "") if self._terminal else ("", "\n")
        print(f"{start}{text}", end=end, file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the line."""
        if self._terminal and _in_front():
            print("\r\033[K", end="", file=sys.stderr, flush=True)


def _in_front() -> bool:
    """Whether the terminal is this job's: a line of one in the background would run into what another writes."""
    try:
        return os.tcgetpgrp(sys.stderr.fileno()) == os.getpgrp()
    except OSError as e:  # not the terminal that this session is controlled from; one that is gone gives another error
        return e.errno in (errno.ENOTTY, None)
    except ValueError:  # closed
        return False
