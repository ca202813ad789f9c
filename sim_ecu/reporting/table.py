"""Sections of sentences and tables as Markdown."""

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
class Section:
    """A heading ("": what comes before all) and what stands below it. about: in words, after the heading."""

    name: str
    about: str = ""
    parts: Sequence[str | Table] = ()


def markdown(sections: Iterable[Section]) -> list[str]:
    """Return the lines of all sections."""
    out: list[str] = []
    for section in sections:
        if section.name:
            out += ["", f"**{section.name}**" + f": {section.about}" * bool(section.about)]
        for k, part in enumerate(section.parts):
            out += [""] if section.name or (k and not isinstance(part, str)) else []
            out += part.markdown() if isinstance(part, Table) else [part]
    return out


def _line(cells: Sequence[str] | Iterator[str]) -> str:
    return "| " + " | ".join(" ".join(c.split()).replace("|", "\\|") for c in cells) + " |"
