"""`wrcd replay --events`: every change of an axle's Validity as a row of CSV, and why."""

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import IO

from wrcd.core.core import Core
from wrcd.core.events import COLUMNS, csv_line

SCREEN = Path("-")  # stands for standard output


class EventRows:
    """Writes the changes that a core has made since the look before: of some axles (numbers; None: all), from begin_us
    until before end_us, with times after origin_us."""

    def __init__(
        self,
        core: Core,
        file: IO[str],
        axles: Collection[int] | None = None,
        begin_us: int | None = None,
        end_us: int | None = None,
        origin_us: int = 0,
    ) -> None:
        self._events, self._file = core.events, file
        self._axles, self._begin_us, self._end_us, self._origin_us = axles, begin_us, end_us, origin_us
        self._told = core.events.total
        file.write(csv_line(COLUMNS))

    def look(self) -> None:
        """Write what is new; to be called oftener than core.events forgets."""
        if self._events.total == self._told:
            return
        for change in self._events.since(self._told):
            if (
                (self._axles is None or change.axle in self._axles)
                and (self._begin_us is None or change.time_us >= self._begin_us)
                and (self._end_us is None or change.time_us < self._end_us)
            ):
                self._file.write(replace(change, time_us=change.time_us - self._origin_us).csv_line)
        self._told = self._events.total
