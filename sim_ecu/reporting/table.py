"""A table of values: as Markdown for a page of docs, as text for a terminal; `page` renders it as HTML."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from sim_ecu.reporting.values import Value, text

MAX_PLAIN_COLUMNS = 5  # a table with more is "wide": its rows become cards sooner


@dataclass(frozen=True, slots=True)
class Row:
    """Values of a row. css: classes, as "missed" for one that stands out."""

    cells: Sequence[Value]
    css: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values below a head. title: before it, note: behind it."""

    head: Sequence[str]
    rows: Sequence[Sequence[Value] | Row]
    title: str = ""
    note: str = ""
    kind: ClassVar[str] = "table"

    @property
    def wide(self) -> bool:
        """Whether it needs cards on a page of medium width."""
        return len(self.head) > MAX_PLAIN_COLUMNS

    @property
    def records(self) -> list[Row]:
        """Rows with their marks."""
        return [row if isinstance(row, Row) else Row(row) for row in self.rows]

    def markdown(self) -> list[str]:
        """Return its lines for a Markdown page."""
        lines = [_line(self.head), "|" + "---|" * len(self.head), *(_line(map(text, r.cells)) for r in self.records)]
        title = [f"{self.title}:", ""] if self.title else []
        return [*title, *lines, *(["", self.note] if self.note else [])]

    def terminal(self) -> list[str]:
        """Return its lines in columns that are as wide as their cells."""
        rows = [list(self.head), *([text(c) for c in r.cells] for r in self.records)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
        return [*([self.title] if self.title else []), *lines, *([self.note] if self.note else [])]


def _line(cells: Sequence[str] | Iterator[str]) -> str:
    return "| " + " | ".join(" ".join(c.split()).replace("|", "\\|") for c in cells) + " |"
