"""`wrcd replay --events`: every change of an axle's Validity as a row of CSV, and why."""

from dataclasses import replace
from pathlib import Path
from typing import IO

from wrcd.core.core import Core
from wrcd.core.events import COLUMNS, csv_line
from wrcd.tools.selection import Part

SCREEN = Path("-")  # stands for standard output


class EventRows:
    """Writes the changes that a core has made since the look before."""

    def __init__(self, core: Core, file: IO[str], part: Part) -> None:
        self._events, self._file, self._part = core.events, file, part
        self._told = core.events.total
        file.write(csv_line(COLUMNS))

    def look(self) -> None:
        """Write what is new; to be called oftener than core.events forgets."""
        if self._events.total != self._told:
            for change in self._events.since(self._told):
                if self._part.wants_at(change.time_us) and change.axle in self._part.axles:
                    self._file.write(replace(change, time_us=change.time_us - self._part.origin_us).csv_line)
            self._told = self._events.total
