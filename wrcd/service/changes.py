"""Lines about changes of Validity: of each axle and cause at most one a second, and how many were left out."""

from collections.abc import Callable

from wrcd.core.causes import Cause
from wrcd.core.events import Change, Events

EVERY_US = 1_000_000


def is_due(next_us: int, now_us: int) -> bool:
    """Whether a second has gone by; a clock that stepped back silences nobody."""
    return not 0 < next_us - now_us <= EVERY_US


class ChangeLines:
    """Told of every change once; what was left out is summed up a second after the line before it."""

    def __init__(self, events: Events, write: Callable[[str], None]) -> None:
        self._events, self._write = events, write
        self._told = 0  # changes so far
        self._next_us: dict[tuple[int, Cause], int] = {}  # by axle and cause, from when on there may be a line
        self._held: dict[tuple[int, Cause], tuple[Change, int]] = {}  # the newest that was left out, and how many were
        self._newest: dict[int, Change] = {}  # by axle

    def look(self, now_us: int) -> None:
        """Write what is new, and what may now be said of what was left out."""
        if self._events.total != self._told:
            new = self._events.since(self._told)
            self._told = self._events.total
            for change in new:
                self._add(change, now_us)
        if self._held:
            for key in [k for k in self._held if is_due(self._next_us[k], now_us)]:
                self._sum_up(key, now_us)

    def _add(self, change: Change, now_us: int) -> None:
        key = (change.axle, change.cause)
        self._newest[change.axle] = change
        left_out = self._held.pop(key, (change, 0))[1]
        if not is_due(self._next_us.get(key, 0), now_us):
            self._held[key] = change, left_out + 1
            return
        self._next_us[key] = now_us + EVERY_US
        self._write(f"axle {change.axle}: {change.text}{_more(left_out)}")

    def _sum_up(self, key: tuple[int, Cause], now_us: int) -> None:
        change, left_out = self._held.pop(key)
        self._next_us[key] = now_us + EVERY_US
        if change is self._newest[change.axle]:  # it still is so
            self._write(f"axle {change.axle}: {change.text}{_more(left_out - 1)}")
        else:
            self._write(f"axle {change.axle}: {left_out} more in the last second: {change.step}")


def _more(n: int) -> str:
    return f" ({n} more in the last second)" if n else ""
