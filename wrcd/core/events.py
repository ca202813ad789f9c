"""Every change of an axle's Validity, and of its cause while it is not Valid: when, from what to what, and why.

The core gives what happened as records; a text is made where somebody looks. What speaks against a tick is reported
when it begins: a slot later it may be over.
"""

import csv
import io
from collections import deque
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrcd.bus.mapping import Mapped
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.details import Details

COLUMNS = ("time_s", "axle", "from", "to", "cause", "detail")
MAX_KEPT = 4096  # changes, for those who look after every turn
MAX_DETAIL = 200  # characters
CAUSES = tuple(Cause)  # by their number
VALIDITIES = (Validity.NOT_AVAILABLE, Validity.VALID, Validity.DEGRADED)  # by their number in C
_DETAIL, _CHANGE = 1, 2  # kinds of events


@dataclass(frozen=True, slots=True)
class Change:
    """One axle (its number) at one slot. The cause and the detail, an input with its figures, are of not being Valid.

    before and after are alike where the cause alone has changed.
    """

    time_us: int
    axle: int
    before: Validity
    after: Validity
    cause: Cause
    detail: str

    @property
    def step(self) -> str:
        """From what to what, and the cause: "Valid -> Degraded, InputStale"."""
        step = self.after.value if self.before is self.after else f"{self.before} -> {self.after}"
        return f"{step}, {self.cause.label}" if self.cause else step

    @property
    def text(self) -> str:
        """For a person: "Valid -> Degraded, InputStale: yaw rate A.B 20.9 ms old, limit 15"."""
        return f"{self.step}: {self.detail}" if self.cause else self.step

    @property
    def csv_line(self) -> str:
        """A row of COLUMNS."""
        cause = self.cause.label if self.cause else ""
        return csv_line((csv_time(self.time_us), self.axle, self.before.value, self.after.value, cause, self.detail))


def csv_time(time_us: int) -> str:
    """A time as the rows have it, in seconds."""
    return f"{'-' * (time_us < 0)}{abs(time_us) // 1_000_000}.{abs(time_us) % 1_000_000:06d}"


def csv_line(cells: Sequence[object]) -> str:
    """Cells as a line of CSV, its end included."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow(cells)
    return line.getvalue()


class Events:
    """Keeps the newest changes."""

    def __init__(self, config: Config, mapped: Mapped) -> None:
        self._numbers = [a.number for a in config.axles]
        self._details = Details(config, mapped)
        self._begun: dict[tuple[int, int], Any] = {}  # by axle (its place) and cause: how that was when it began
        self._kept: deque[tuple[Any, Any]] = deque(maxlen=MAX_KEPT)
        self.total = 0  # changes so far

    def __deepcopy__(self, memo: dict[int, Any]) -> "Events":
        twin = memo[id(self)] = copy(self)
        twin._begun, twin._kept = dict(self._begun), self._kept.copy()
        return twin

    def take(self, events: np.ndarray[Any, Any]) -> None:
        """Take what happened."""
        heads = zip(*(events[name].tolist() for name in ("kind", "axle", "cause", "is_over")), strict=True)
        for of_many, (kind, axle, cause, is_over) in zip(events, heads, strict=True):
            event = of_many.copy()  # it is kept alone
            if kind == _DETAIL:
                self._begun[axle, cause] = event
                continue
            self.total += 1
            self._kept.append((event, self._begun.get((axle, cause))))
            if is_over:  # a window of sound ticks: all of that is over
                self._begun = {key: of for key, of in self._begun.items() if key[0] != axle}

    def since(self, total: int) -> list[Change]:
        """The changes after the first so many, as far as they are kept."""
        new = min(self.total - total, len(self._kept))
        return [self._change(*self._kept[k]) for k in range(-new, 0)]

    def _change(self, event: Any, begun: Any) -> Change:
        before, after = VALIDITIES[event["before"]], VALIDITIES[event["after"]]
        detail = _cut(self._details.of(event, begun))
        number = self._numbers[event["axle"]]
        return Change(int(event["time_us"]), number, before, after, CAUSES[event["cause"]], detail)


def _cut(text: str) -> str:
    return text if len(text) <= MAX_DETAIL else text[: MAX_DETAIL - 4] + " ..."
