"""The page's parts: tables of cells that name their column, as a card has no head; a log with what it came to."""

import html
import math
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import PurePosixPath
from urllib.parse import quote

from sim_ecu.campaign.fleet.drawing import columns
from sim_ecu.campaign.fleet.summary import Group, Played

CAUSES = 3  # that a row names
ROWS = 100  # of a table before the next are folded
LOG_HEAD = ("log", "begin, UTC", "km", "time", "Valid", "not Valid because of", "classes", "suspicious")
WIDE = 5  # a table with more columns becomes cards sooner


@dataclass(frozen=True, slots=True)
class Cell:
    """HTML, and how it stands."""

    html: str
    css: str = ""


@dataclass(frozen=True, slots=True)
class Line:
    """A table's row. anchor: a name that a link goes to."""

    cells: Sequence[Cell]
    anchor: str = ""
    css: str = ""


def text(words: str) -> Cell:
    """Words, to the left."""
    return Cell(html.escape(words), "text")


def number(value: float, form: str = ".1f") -> Cell:
    """A number; nothing for none."""
    return Cell("" if math.isnan(value) else format(value, form))


def hours(value: float) -> Cell:
    """A duration."""
    return Cell("" if math.isnan(value) else duration(value))


def duration(value: float) -> str:
    """Hours for a person."""
    if value >= 1:
        return f"{value:.1f} h"
    return f"{60 * value:.1f} min" if value >= 1 / 30 else f"{3600 * value:.1f} s"


def date(stamp_s: float) -> str:
    """A time since 1970 for a person; nothing for none."""
    return "" if math.isnan(stamp_s) else datetime.fromtimestamp(stamp_s, UTC).strftime("%Y-%m-%d %H:%M")


def share(value: float) -> Cell:
    """A share in percent."""
    return Cell("" if math.isnan(value) else f"{100 * value:.1f} %")


def table(head: Sequence[str], lines: Sequence[Line], more: str = "more") -> Iterator[str]:
    """A table; of many rows, tables of so many each, the first open."""
    for first in range(0, len(lines), ROWS):
        part = lines[first : first + ROWS]
        if first:
            yield f'<details class="more"><summary>{first + 1} to {first + len(part)} of {len(lines)} {more}</summary>'
        yield from _table(head, part)
        if first:
            yield "</details>"


def _table(head: Sequence[str], lines: Sequence[Line]) -> Iterator[str]:
    names = [html.escape(name) for name in head]
    yield f"<table{' class=wide' if len(head) > WIDE else ''}><thead><tr>"
    css = [c.css for c in lines[0].cells] if lines else [""] * len(names)
    yield "".join(f'<th scope="col"{_class(c)}>{name}</th>' for c, name in zip(css, names, strict=True))
    yield "</tr></thead><tbody>"
    for line in lines:
        mark = f' id="{line.anchor}"' if line.anchor else ""
        first, *rest = line.cells
        cells = [f'<th scope="row">{first.html}</th>']
        for name, cell in zip(names[1:], rest, strict=True):
            inner = f"<span>{cell.html}</span>" if "<a " in cell.html else cell.html  # one part of a card's line
            cells.append(f'<td data-of="{name}"{_class(cell.css)}>{inner}</td>')
        yield f"<tr{mark}{_class(line.css)}>{''.join(cells)}</tr>"
    yield "</tbody></table>"


def _class(css: str) -> str:
    return f' class="{css}"' if css else ""


def causes(group: Group) -> str:
    """The largest causes of not being Valid, with their shares of the time."""
    named = [f"{cause.label} {100 * part:.1f} %" for cause, part in group.causes() if part >= 0.0005]
    return ", ".join(named[:CAUSES]) + ", …" * (len(named) > CAUSES)


def log_line(p: Played, command: str, report: str | None) -> Line:
    """A log. command: what makes its report; report: where that lies, if it does."""
    name = html.escape(p.name)
    link = name if report is None else f'<a href="{html.escape(quote(report))}">{name}</a>'
    if not p.done:
        error = html.escape(said(p))
        cells = [Cell(link), Cell(""), *[Cell("")] * 3, Cell(f"{p.ending.value}: {error}", "text"), *[Cell("")] * 2]
        return Line(cells, f"log{p.number}", "bad")
    suspects = ", ".join(dict.fromkeys(f"{s['what']} {_axle(s['axle'])}".strip() for s in p.suspects))
    more = f"<details><summary>more</summary>{_details(p, command, report)}</details>"
    cells = [
        Cell(link + more), Cell(date(p.begin_s)), number(p.number_of("km"), ".2f"), hours(p.number_of("hours")),
        share(p.number_of("valid")), text(causes(Group("", [p]))), Cell(columns(p.detail), "picture"), text(suspects),
    ]  # fmt: skip
    return Line(cells, f"log{p.number}")


def _axle(number: int) -> str:
    return f"axle {number}" if number else ""


def _details(p: Played, command: str, report: str | None) -> str:
    axles = ", ".join(f"axle {a['axle']}: {100 * a['valid']:.1f} %" for a in p.detail["axles"] if a["seconds"])
    refused = html.escape(", ".join(f"{r['frames']} {r['message']} ({r['reason']})" for r in p.detail["refused"]))
    lines = [
        f"Valid: {axles}",
        f"{p.figures['read']} frames read, {p.figures['accepted']} accepted, {p.figures['refused']} refused"
        + f": {refused}" * bool(refused),
        *(html.escape(w) for w in p.detail["warnings"]),
        *(
            f"{html.escape(s['what'])} {_axle(s['axle'])}: first at {s['first_s']:.1f} s, {s['seconds']:.1f} s in all: "
            f"{html.escape(s['text'])}"
            for s in p.suspects
        ),
    ]
    if report is None:
        lines.append(f"<code>{html.escape(command)}</code>")
    return f"<ul>{''.join(f'<li>{line}</li>' for line in lines)}</ul>"


def said(p: Played) -> str:
    """A log's error without the log's name."""
    return p.error.removeprefix(f"{p.name}: ")


def command(p: Played, folder: str) -> str:
    """What makes a log's report, from the fleet's folder."""
    parts = ["wrcd", "report", p.name, "--replay", "-o", f"{PurePosixPath(p.name).name}.html"]
    if p.inputs["configuration"]:
        parts += ["--config", p.inputs["configuration"]]
    if p.inputs["channel"]:
        parts += ["--channel", p.inputs["channel"]]
    return f"cd {shlex.quote(folder)} && {shlex.join(parts)}"
