"""Chapters of sentences and tables as Markdown."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from sim_ecu.reporting.values import Value, text


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of values below a head."""

    head: Sequence[str]
    rows: Sequence[Sequence[Value]]

    def markdown(self) -> list[str]:
        """Return its lines."""
        return [_line(self.head), "|" + "---|" * len(self.head), *(_line(map(text, row)) for row in self.rows)]


@dataclass(frozen=True, slots=True)
class Chapter:
    """A heading ("": what comes before all) and what stands below it. about: in words, after the heading."""

    name: str
    about: str = ""
    parts: Sequence[str | Table] = ()


def markdown(chapters: Iterable[Chapter]) -> list[str]:
    """Return the lines of all chapters."""
    out: list[str] = []
    for chapter in chapters:
        if chapter.name:
            out += ["", f"**{chapter.name}**" + f": {chapter.about}" * bool(chapter.about)]
        for k, part in enumerate(chapter.parts):
            out += [""] if chapter.name or (k and not isinstance(part, str)) else []
            out += part.markdown() if isinstance(part, Table) else [part]
    return out


def _line(cells: Sequence[str] | Iterator[str]) -> str:
    return "| " + " | ".join(" ".join(c.split()).replace("|", "\\|") for c in cells) + " |"
