"""`wrcd replay --events`: every change of an axle's Validity as a row of CSV, and why."""

from pathlib import Path
from typing import IO

from wrcd.core.core import Core
from wrcd.core.events import COLUMNS, csv_line

SCREEN = Path("-")  # stands for standard output


class EventRows:
    """Writes the changes that a core has made since the look before."""

    def __init__(self, core: Core, file: IO[str]) -> None:
        self._events, self._file = core.events, file
        self._told = core.events.total
        file.write(csv_line(COLUMNS))

    def look(self) -> None:
        """Write what is new; to be called oftener than core.events forgets."""
        if self._events.total != self._told:
            for change in self._events.since(self._told):
                self._file.write(change.csv_line)
            self._told = self._events.total
