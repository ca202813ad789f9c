"""An ASAM MDF 4 file of signals: a channel group for each of ours, with its own time stamps."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from wrcd.errors import create
from wrcd.tools.export.records import UNKNOWN_WORD, About, Channel, Column, Rows

if TYPE_CHECKING:
    from asammdf import MDF, Signal

VERSION: Literal["4.10"] = "4.10"  # read by every tool of the last ten years
TRANSPOSED_DEFLATE: Literal[2] = 2  # a fifth of the size; part of the format since 4.10
TIME_OFFSET_VALID = 2  # the header's flag: its time is UTC and an offset, which is 0


class Mf4File:
    """Writes through asammdf, whose blocks lie in a temporary file until the end."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._mdf: MDF | None = None
        self._begin_us = 0
        self._places: dict[str, int] = {}  # of groups, by name
        self._told: dict[str, list[Rows]] = {}  # groups with text: asammdf takes that all at once

    def begin(self, about: About) -> None:
        """Write the header: the time of the log's first frame, from which all stamps count, and whose values these
        are. Raises InputError if the file can't be made."""
        from asammdf import MDF

        create(self._path).close()
        self._mdf = MDF(version=VERSION)
        self._begin_us = about.begin_us
        header: Any = self._mdf.header
        header.abs_time, header.tz_offset, header.daylight_save_time = about.begin_us * 1000, 0, 0
        header.time_flags = TIME_OFFSET_VALID
        header.comment = about.text

    def write(self, rows: Sequence[Rows]) -> None:
        """Append to the groups; one that is new is made."""
        assert self._mdf is not None
        for r in rows:
            name = r.group.name
            if any(c.is_text for c in r.group.channels):
                self._told.setdefault(name, []).append(r)
            elif name in self._places:
                columns = [(c, None) for c in (self._seconds(r), *map(_array, r.columns))]
                self._mdf.extend(self._places[name], columns)
            else:
                self._append(r)

    def _append(self, r: Rows) -> None:
        assert self._mdf is not None
        seconds = self._seconds(r)
        signals = [
            _signal(c, r.group.of, column, seconds) for c, column in zip(r.group.channels, r.columns, strict=True)
        ]
        self._places[r.group.name] = len(self._mdf.groups)
        self._mdf.append(signals, acq_name=r.group.name, comment=r.group.comment, common_timebase=True)

    def _seconds(self, r: Rows) -> NDArray[np.float64]:
        return np.asarray((r.time_us - self._begin_us) * 1e-6, np.float64)

    def close(self) -> None:
        """Put the file in its place."""
        if self._mdf is None:
            return
        for parts in self._told.values():
            self._append(_joined(parts))
        with self._mdf as mdf:
            mdf.save(self._path, overwrite=True, compression=TRANSPOSED_DEFLATE)
        self._mdf = None


def _joined(parts: Sequence[Rows]) -> Rows:
    """One after the other."""
    columns: list[Column] = []
    for of_parts in zip(*(p.columns for p in parts), strict=True):
        if isinstance(of_parts[0], list):
            columns.append([text for part in of_parts for text in part])
        else:
            columns.append(np.concatenate(of_parts))
    return Rows(parts[0].group, np.concatenate([p.time_us for p in parts]), columns)


def _signal(c: Channel, of: str, column: Column, seconds: NDArray[np.float64]) -> "Signal":
    """A channel with its unit, or with its words as a conversion from value to text. of: ends its name, by which tools
    pick a signal whatever its group."""
    from asammdf import Signal

    conversion: dict[str, object] | None = None
    if c.words:
        conversion = {"val_0": -1, "text_0": UNKNOWN_WORD.encode()}
        for place, word in enumerate(c.words):
            conversion |= {f"val_{place + 1}": place, f"text_{place + 1}": word.encode()}
    encoding = "utf-8" if c.is_text else None
    return Signal(
        _array(column),
        seconds,
        unit=c.unit,
        name=c.name + of,
        conversion=conversion,
        comment=c.comment,
        encoding=encoding,
    )


def _array(column: Column) -> NDArray[Any]:
    """Text as bytes; else as it is."""
    return np.array([text.encode() for text in column], np.bytes_) if isinstance(column, list) else column
