"""A table of values: as Markdown for a page of docs, as text for a terminal; `page` renders it as HTML."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from markupsafe import Markup

from sim_ecu.reporting.values import Value, text

MAX_PLAIN_COLUMNS = 5  # a table with more is "wide": its rows become cards sooner
FOLD = 100  # rows of a table on a page before the next are folded


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell with HTML of its own (a link, a drawing), and the words that stand for it elsewhere. css: its classes."""

    html: Markup
    words: str = ""
    css: str = "text"


@dataclass(frozen=True, slots=True)
class Row:
    """Values of a row. anchor: a name that a link goes to. css: classes, as "missed" for one that stands out."""

    cells: Sequence[Value | Cell]
    anchor: str = ""
    css: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values below a head. title: before it, note: behind it. what: the noun of folded rows."""

    head: Sequence[str]
    rows: Sequence[Sequence[Value | Cell] | Row]
    title: str = ""
    note: str = ""
    what: str = "rows"
    kind: ClassVar[str] = "table"

    @property
    def wide(self) -> bool:
        """Whether it needs cards on a page of medium width."""
        return len(self.head) > MAX_PLAIN_COLUMNS

    @property
    def records(self) -> list[Row]:
        """Rows with their marks."""
        return [row if isinstance(row, Row) else Row(row) for row in self.rows]

    def parts(self) -> Iterator[tuple[int, list[Row]]]:
        """Yield the rows in portions that a page shows at once, each with the number of rows before."""
        for first in range(0, max(len(self.rows), 1), FOLD):
            yield first, self.records[first : first + FOLD]

    def markdown(self) -> list[str]:
        """Return its lines for a Markdown page."""
        lines = [_line(self.head), "|" + "---|" * len(self.head), *(_line(map(words, r.cells)) for r in self.records)]
        title = [f"{self.title}:", ""] if self.title else []
        return [*title, *lines, *(["", self.note] if self.note else [])]

    def terminal(self) -> list[str]:
        """Return its lines in columns that are as wide as their cells."""
        rows = [list(self.head), *([words(c) for c in r.cells] for r in self.records)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
        return [*([self.title] if self.title else []), *lines, *([self.note] if self.note else [])]


def words(cell: Value | Cell) -> str:
    """Return a cell as words."""
    return cell.words if isinstance(cell, Cell) else text(cell)


def _line(cells: Sequence[str] | Iterator[str]) -> str:
    return "| " + " | ".join(" ".join(c.split()).replace("|", "\\|") for c in cells) + " |"
