"""Exported files: ASAM MDF 4 with a channel group for each of ours, and MCAP with a topic of JSON for each."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from wrcd.errors import create

if TYPE_CHECKING:
    from asammdf import Signal

VERSION: Literal["4.10"] = "4.10"  # read by every tool of the last ten years
TRANSPOSED_DEFLATE: Literal[2] = 2  # a fifth of the size; part of the format since 4.10
TIME_OFFSET_VALID = 2  # the header's flag: its time is UTC and an offset, which is 0
UNKNOWN_WORD = "unknown"  # for a word that is none of ours
METADATA = "wrcd"
MAX_NS = 1 << 64
Column = NDArray[np.float64] | NDArray[np.int8] | list[str]


@dataclass(frozen=True, slots=True)
class ExportChannel:
    """A signal by our name. With words its values are places in them, -1 for another word; text is text."""

    name: str
    unit: str = ""
    words: tuple[str, ...] = ()
    is_text: bool = False
    comment: str = ""


@dataclass(frozen=True, slots=True)
class ExportGroup:
    """Channels that have their time stamps in common: of one message, of one quantity, or of an axle's changes."""

    name: str
    channels: tuple[ExportChannel, ...]
    comment: str = ""
    of: str = ""  # whose: "_A1"; it ends the name, and each signal's where names must differ over a whole file


@dataclass(frozen=True, slots=True)
class Rows:
    """Of one group, in the order of their time: columns as its channels, each (n,). NaN: there is no value."""

    group: ExportGroup
    time_us: NDArray[np.int64]
    columns: Sequence[Column]


@dataclass(frozen=True, slots=True)
class About:
    """Whose values a file holds."""

    begin_us: int  # the log's first frame
    facts: Mapping[str, str]  # program, design, log, …


class Mf4File:
    """Writes through asammdf, whose blocks lie in a temporary file until the end."""

    def __init__(self, path: Path, about: About) -> None:
        """Write the header: the time of the log's first frame, from which all stamps count, and whose values these
        are. Raises InputError if the file can't be made."""
        from asammdf import MDF

        create(path).close()
        self._path, self._mdf, self._begin_us = path, MDF(version=VERSION), about.begin_us
        self._places: dict[str, int] = {}  # of groups, by name
        self._with_text: dict[str, list[Rows]] = {}  # asammdf takes that all at once
        header: Any = self._mdf.header
        # before 1970 it has no time: those of its rows count from the first frame, whatever that one is
        header.abs_time, header.tz_offset, header.daylight_save_time = max(about.begin_us, 0) * 1000, 0, 0
        header.time_flags = TIME_OFFSET_VALID
        header.comment = "\n".join(f"{name}: {fact}" for name, fact in about.facts.items())

    def write(self, rows: Sequence[Rows]) -> None:
        """Append to the groups; one that is new is made."""
        for r in rows:
            name = r.group.name
            if any(c.is_text for c in r.group.channels):
                self._with_text.setdefault(name, []).append(r)
            elif name in self._places:
                columns = [(c, None) for c in (self._seconds(r), *map(_array, r.columns))]
                self._mdf.extend(self._places[name], columns)
            else:
                self._append(r)

    def _append(self, r: Rows) -> None:
        seconds = self._seconds(r)
        signals = [_signal(c, r.group.of, x, seconds) for c, x in zip(r.group.channels, r.columns, strict=True)]
        self._places[r.group.name] = len(self._mdf.groups)
        self._mdf.append(signals, acq_name=r.group.name, comment=r.group.comment, common_timebase=True)

    def _seconds(self, r: Rows) -> NDArray[np.float64]:
        return np.asarray((r.time_us - self._begin_us) * 1e-6, np.float64)

    def close(self) -> None:
        """Put the file in its place."""
        for parts in self._with_text.values():
            columns = [np.concatenate(list(map(_array, of))) for of in zip(*(p.columns for p in parts), strict=True)]
            self._append(Rows(parts[0].group, np.concatenate([p.time_us for p in parts]), columns))
        with self._mdf as mdf:
            mdf.save(self._path, overwrite=True, compression=TRANSPOSED_DEFLATE)

    def abandon(self) -> None:
        """Let go of what was begun."""
        self._mdf.close()


def _signal(c: ExportChannel, of: str, column: Column, seconds: NDArray[np.float64]) -> "Signal":
    """A channel with its unit, or with its words as a conversion from value to text. of: ends its name, by which tools
    pick a signal whatever its group."""
    from asammdf import Signal

    conversion: dict[str, object] | None = None
    if c.words:
        conversion = {"val_0": -1, "text_0": UNKNOWN_WORD.encode()}
        for place, word in enumerate(c.words):
            conversion |= {f"val_{place + 1}": place, f"text_{place + 1}": word.encode()}
    encoding = "utf-8" if c.is_text else None
    signal = Signal(_array(column), seconds, unit=c.unit, name=c.name + of, conversion=conversion, encoding=encoding)
    signal.comment = c.comment
    return signal


def _array(column: Column) -> NDArray[Any]:
    """Text as bytes; else as it is."""
    return np.array([text.encode() for text in column], np.bytes_) if isinstance(column, list) else column


class McapFile:
    """Writes through the library mcap. The messages of a block are in the order of their time."""

    def __init__(self, path: Path, about: About) -> None:
        """Write the header, and whose values these are. Raises InputError if the file can't be made."""
        from mcap.writer import Writer

        create(path).close()
        self._file = path.open("wb")
        self._writer = Writer(self._file)
        self._topics: dict[str, int] = {}  # ids, by name
        self._writer.start(profile="", library=about.facts["program"])
        self._writer.add_metadata(METADATA, {**about.facts, "begin_us": str(about.begin_us)})

    def write(self, rows: Sequence[Rows]) -> None:
        """A message for each row, stamped with its time: logged and published then. A value that there is not is left
        out."""
        messages: list[tuple[int, int, bytes]] = []
        for r in rows:
            topic = self._topic(r.group)
            messages += ((us * 1000, topic, text) for us, text in zip(r.time_us.tolist(), _texts(r), strict=True))
        messages.sort(key=lambda m: m[0])
        if messages and not 0 <= messages[0][0] <= messages[-1][0] < MAX_NS:
            raise ValueError("MCAP has no times before 1970 or after 2554")
        for time_ns, topic, text in messages:
            self._writer.add_message(topic, time_ns, text, time_ns)

    def _topic(self, group: ExportGroup) -> int:
        if group.name not in self._topics:
            number = self._writer.register_schema(group.name, "jsonschema", json.dumps(_schema(group)).encode())
            units = {c.name: c.unit for c in group.channels if c.unit}
            self._topics[group.name] = self._writer.register_channel(f"/{group.name}", "json", number, units)
        return self._topics[group.name]

    def close(self) -> None:
        """Write the index and close the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # mcap declares no type for it
        self._file.close()

    def abandon(self) -> None:
        """Let go of what was begun."""
        self._file.close()


def _schema(group: ExportGroup) -> dict[str, object]:
    """The JSON schema of a group's rows; units and comments are in the descriptions."""
    return {
        "title": group.name,
        "description": group.comment,
        "type": "object",
        "properties": {c.name: _property(c) for c in group.channels},
    }


def _property(c: ExportChannel) -> dict[str, object]:
    described = {"description": text} if (text := ", ".join(t for t in (c.unit, c.comment) if t)) else {}
    if c.words:
        return {"type": "string", "enum": [*c.words, UNKNOWN_WORD], **described}
    return {"type": "string" if c.is_text else "number", **described}


def _texts(r: Rows) -> Iterator[bytes]:
    names = [c.name for c in r.group.channels]
    columns = [_values(c, column) for c, column in zip(r.group.channels, r.columns, strict=True)]
    for values in zip(*columns, strict=True):
        known = {name: value for name, value in zip(names, values, strict=True) if value == value}
        yield json.dumps(known, ensure_ascii=False, allow_nan=False).encode()


def _values(c: ExportChannel, column: Column) -> list[Any]:
    if isinstance(column, list):
        return column
    if c.words:
        words = (*c.words, UNKNOWN_WORD)  # of a word that is none of ours the place is -1
        return [words[place] for place in column.tolist()]
    return list(column.tolist())
