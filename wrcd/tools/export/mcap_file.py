"""An MCAP file: a topic for each group, its rows as JSON, which PlotJuggler and Foxglove read without a plugin."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from wrcd.errors import create
from wrcd.tools.export.records import UNKNOWN_WORD, About, Channel, Column, Group, Rows

if TYPE_CHECKING:
    from mcap.writer import Writer

METADATA = "wrcd"


class McapFile:
    """Writes through the library mcap. The messages of a block are in the order of their time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None
        self._writer: Writer | None = None
        self._topics: dict[str, int] = {}  # ids, by name

    def begin(self, about: About) -> None:
        """Write the header, and whose values these are. Raises InputError if the file can't be made."""
        from mcap.writer import Writer

        create(self._path).close()
        self._file = self._path.open("wb")
        self._writer = Writer(self._file)
        self._writer.start(profile="", library=about.facts["program"])
        self._writer.add_metadata(METADATA, {**about.facts, "begin_us": str(about.begin_us)})

    def write(self, rows: Sequence[Rows]) -> None:
        """A message for each row, stamped with its time: logged and published then. A value that there is not is left
        out."""
        assert self._writer is not None
        messages: list[tuple[int, int, bytes]] = []
        for r in rows:
            topic = self._topic(r.group)
            messages += ((us * 1000, topic, text) for us, text in zip(r.time_us.tolist(), _texts(r), strict=True))
        messages.sort(key=lambda m: m[0])
        for time_ns, topic, text in messages:
            self._writer.add_message(topic, time_ns, text, time_ns)

    def _topic(self, group: Group) -> int:
        assert self._writer is not None
        if group.name not in self._topics:
            schema = json.dumps(schema_of(group)).encode()
            number = self._writer.register_schema(group.name, "jsonschema", schema)
            units = {c.name: c.unit for c in group.channels if c.unit}
            self._topics[group.name] = self._writer.register_channel(f"/{group.name}", "json", number, units)
        return self._topics[group.name]

    def close(self) -> None:
        """Write the index and close the file."""
        if self._writer is not None:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._writer = None
        if self._file is not None:
            self._file.close()
            self._file = None


def schema_of(group: Group) -> dict[str, object]:
    """The JSON schema of a group's rows; units and comments are in the descriptions."""
    return {
        "title": group.name,
        "description": group.comment,
        "type": "object",
        "properties": {c.name: _property(c) for c in group.channels},
    }


def _property(c: Channel) -> dict[str, object]:
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


def _values(c: Channel, column: Column) -> list[Any]:
    if isinstance(column, list):
        return column
    if c.words:
        words = (*c.words, UNKNOWN_WORD)  # of a word that is none of ours the place is -1
        return [words[place] for place in column.tolist()]
    return list(column.tolist())
