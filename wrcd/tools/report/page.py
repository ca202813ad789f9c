"""Writes a Story, or two side by side, as one HTML file that asks nothing of any network."""

import base64
import gzip
import hashlib
import json
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

from bokeh.resources import Resources

from wrcd.tools.report import layout, plots, text, words
from wrcd.tools.report.columns import pack
from wrcd.tools.report.differences import differences
from wrcd.tools.report.layout import AGAINST, Part, Plot
from wrcd.tools.report.tables import Table, tables
from wrcd.tools.story.compare import sentences
from wrcd.tools.story.records import Story

MARK = "wrcd report"  # in the page's generator: a report may overwrite a file that has it
_HERE = Path(__file__).parent
SCRIPTS = ("data", "levels", "strips", "pane", "view", "words", "printing", "main")


def write(story: Story, against: Story | None, output: Path) -> None:
    """Write the report of a log, beside another's with against. Raises OSError."""
    output.write_text(page(story, against), encoding="utf-8")


def page(story: Story, against: Story | None) -> str:
    """The whole page."""
    sides = names(story, against)
    found: dict[str, Table] = dict(tables(story))
    if against is not None:
        found |= {AGAINST + name: table for name, table in tables(against).items()}
    parts = layout.parts(found, [a.number for a in story.axles], sides)
    packed = {name: pack(table) for name, table in found.items()}
    items = {p.key: {"spec": _spec(p), "item": plots.item(p)} for part in parts for p in part.plots}
    told = {
        "sides": list(sides),
        "story": words.words(story),
        "against": None if against is None else words.words(against),
        "vocabulary": words.vocabulary(),
        "plots": items,
        "tables": {name: p.head for name, p in packed.items()},
        "left": plots.LEFT,
        "right": plots.RIGHT,
        "hatches": plots.HATCHES,
    }
    data = [f'<script type="text/plain" data-table="{escape(name)}">{p.text}</script>' for name, p in packed.items()]
    data.append(f'<script type="text/plain" id="told">{_zipped(told)}</script>')
    scripts = [*Resources(mode="inline", components=["bokeh"], log_level="error").js_raw, own_script()]
    body = "\n".join([*_body(story, against, parts, sides), *data, *(f"<script>{s}</script>" for s in scripts)])
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(scripts)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta name="generator" content="{MARK}">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        f"<title>{escape(story.log.name)}: wrcd report</title>\n<style>{_read('page.css')}</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def names(story: Story, against: Story | None) -> tuple[str, str]:
    """What the two sides are called: by log, and by design where the log is the same."""
    if against is None:
        return story.log.name, ""
    if story.log.name != against.log.name:
        return story.log.name, against.log.name
    one, other = story.config.design, against.config.design
    if one.checksum == other.checksum:
        return story.source, against.source if against.source != story.source else "against"
    if one.name == other.name:
        return f"{one.name} {one.checksum[:6]}", f"{other.name} {other.checksum[:6]}"
    return one.name, other.name


def own_script() -> str:
    """Our files as one script, in one scope that nothing outside sees."""
    return '(() => {\n"use strict";\n' + "\n".join(_read(f"{name}.js") for name in SCRIPTS) + "\n})();"


def _read(name: str) -> str:
    return (_HERE / name).read_text(encoding="utf-8")


def _policy(scripts: list[str]) -> str:
    """Only our scripts run, and nothing is loaded. Bokeh styles its elements itself."""
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _zipped(value: Mapping[str, Any]) -> str:
    data = json.dumps(value, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")


def _spec(plot: Plot) -> dict[str, Any]:
    """What the browser must know of a plot beside Bokeh's figure."""
    return {
        "key": plot.key, "title": plot.title, "unit": plot.unit, "axis": plot.axis, "axle": plot.axle,
        "low": plot.low, "high": plot.high,
        "curves": [
            {"label": c.label, "table": c.table, "column": c.column, "colour": c.colour, "shape": c.shape,
             "upper": c.upper, "dash": c.dash}
            for c in plot.curves
        ],
        "rows": [
            {"label": r.label, "table": r.table, "column": r.column, "ends": r.ends,
             "words": {str(k): list(v) for k, v in r.words.items()}}
            for r in plot.rows
        ],
    }  # fmt: skip


def _body(story: Story, against: Story | None, parts: list[Part], sides: tuple[str, str]) -> Iterator[str]:
    yield f"<header>{text.heading(story, against)}</header>"
    yield '<p id="trouble" role="alert" hidden></p>'
    yield "<noscript><p>The plots need JavaScript. Verdict and tables do not.</p></noscript>"
    yield '<div class="columns">\n<main>'
    yield f'<section id="verdict" aria-label="Verdict"><h2>Verdict</h2>{text.verdict(story)}</section>'
    if against is not None:
        yield _folded(
            "against-verdict", f"Verdict of {sides[1]}", text.verdict(against).replace('class="go"', 'class="go other"')
        )
        told = text.sentences(sentences(story, against), story) + text.compared(differences(story, against), sides)
        yield _folded("differences", "Differences", told)
    axles = {a.number: a for a in story.axles}
    for part in parts:
        inner = "".join(_figure(p) for p in part.plots)
        if part.key == "overview":
            inner += text.causes(story)
        if part.key.startswith("axle"):
            inner = f"<p>{escape(text.described(axles[int(part.key[4:])]))}</p>" + inner
        if part.key == "health" and "counts" not in {p.key for p in part.plots}:
            inner += "<p>No count of the daemon's moved, or its messages are not in the log.</p>"
        if part.key == "delays":
            inner += text.ages(story)
        if part.key == "bus":
            inner += text.bus(story)
        yield _folded(part.key, part.title, inner)
    yield _folded("configuration", "Configuration, design, versions", text.configuration(story))
    if against is not None:
        yield _folded("configuration-against", f"Configuration of {sides[1]}", text.configuration(against))
    yield "</main>"
    yield _read("aside.html")
    yield "</div>"


def _folded(key: str, title: str, inner: str) -> str:
    return f'<details open id="{escape(key)}"><summary><h2>{escape(title)}</h2></summary>\n{inner}\n</details>'


def _figure(plot: Plot) -> str:
    """A plot's place: its height is kept before it is drawn."""
    unit = f" <small>{escape(plot.unit)}</small>" if plot.unit else ""
    return (
        f'<figure data-plot="{escape(plot.key)}"><figcaption><b>{escape(plot.title)}</b>{unit}'
        '<span class="legend"></span></figcaption>'
        f'<div class="plot" role="img" tabindex="0" aria-label="{escape(plot.title)}. '
        f'Arrow keys move the cursor, its values are read in the panel." style="height:{plot.height}px"></div>'
        "</figure>\n"
    )
