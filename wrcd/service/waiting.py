"""Wait for a bus or a file that is not there yet: look again, less often each time.

A daemon that ended at once would be started again every few hundredths of a second for as long as its interface is
missing.
"""

import time
from collections.abc import Callable
from typing import TypeVar

from wrcd.errors import InputError, Status
from wrcd.service.journal import log_line

T = TypeVar("T")
FIRST_PAUSE_S, LAST_PAUSE_S = 0.02, 0.5  # twice as long each time


class Waiting:
    """Repeats attempts until they succeed, for so many seconds in all."""

    def __init__(
        self,
        seconds: float,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._clock, self._sleep = clock, sleep
        self._end_s = clock() + seconds

    def until(self, attempt: Callable[[], T]) -> T:
        """Return what the attempt returns. Raises its error when the time is over, one that waiting does
        not mend at once.

        What is waited for is one line in the log.
        """
        pause_s, reported = FIRST_PAUSE_S, ""
        while True:
            try:
                return attempt()
            except InputError as e:
                left_s = self._end_s - self._clock()
                if e.status != Status.NOT_THERE or left_s <= 0:
                    raise
                if str(e) != reported:
                    reported = str(e)
                    log_line(f"{reported}; waiting for it, {round(left_s)} s at most")
            self._sleep(min(pause_s, left_s))
            pause_s = min(2 * pause_s, LAST_PAUSE_S)
