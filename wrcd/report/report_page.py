"""Writes a story, or two side by side, as one HTML file that asks nothing of any network: plots, what the browser
explains with, and the tables of contents.py, put together by the template page.html, which escapes all of it."""

import base64
import gzip
import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined

from wrcd.core.causes import Cause
from wrcd.core.vocabulary import words_of
from wrcd.logs.log_comparison import sentences
from wrcd.logs.rule_sentences import sentence
from wrcd.logs.story_events import INPUT_NAMES, VALIDITIES
from wrcd.logs.story_records import Story
from wrcd.report import contents, report_plots
from wrcd.report.data import PageTable, pack, tables
from wrcd.report.report_plots import AGAINST

MARK = "wrcd report"  # in the page's generator: a report may overwrite a file that has it
SCRIPTS = ("data", "levels", "strips", "pane", "view", "words", "printing", "main")
MAX_WARNINGS, MAX_FALLS = 50, 40
_HERE = Path(__file__).parent
_TEMPLATES = Environment(loader=PackageLoader("wrcd.report", "."), autoescape=True, undefined=StrictUndefined)


def write(story: Story, against: Story | None, output: Path) -> None:
    """Write the report of a log, beside another's with against. Raises OSError."""
    output.write_text(page(story, against), encoding="utf-8")


def page(story: Story, against: Story | None) -> str:
    """Return the whole page."""
    both = [story] if against is None else [story, against]
    sides = names(story, against)
    found: dict[str, PageTable] = dict(tables(story))
    if against is not None:
        found |= {AGAINST + name: table for name, table in tables(against).items()}
    parts = report_plots.parts(found, [a.number for a in story.axles], sides)
    packed = {name: pack(table) for name, table in found.items()}
    told = {
        "sides": list(sides),
        "story": _side(story),
        "against": None if against is None else _side(against),
        "vocabulary": _vocabulary(),
        "plots": {p.key: {"spec": asdict(p), "item": report_plots.item(p)} for part in parts for p in part.plots},
        "tables": {name: p.head for name, p in packed.items()},
        "left": report_plots.LEFT,
        "right": report_plots.RIGHT,
        "hatches": report_plots.HATCHES,
    }
    scripts = [*Resources(mode="inline", components=["bokeh"], log_level="error").js_raw, own_script()]
    return _TEMPLATES.get_template("page.html").render(
        name=story.log.name, mark=MARK, policy=_policy(scripts), style=_read("page.css"), sides=sides, parts=parts,
        facts=contents.facts(story, against), verdicts=[contents.verdict(s) for s in both],
        differences=None if against is None else {
            "findings": contents.findings(sentences(story, against), story),
            "table": contents.differences_table(story, against, sides),
        },
        described={f"axle{a.number}": contents.described(a) for a in story.axles},
        tables={"overview": contents.causes(story), "delays": contents.ages(story), "bus": contents.bus(story)},
        bus_load=contents.bus_load(story), configurations=[contents.configuration(s) for s in both],
        packed={name: p.text for name, p in packed.items()}, told=_zipped(told), scripts=scripts,
        max_warnings=MAX_WARNINGS, max_falls=MAX_FALLS,
    )  # fmt: skip


def names(story: Story, against: Story | None) -> tuple[str, str]:
    """Return what the two sides are called: by log, and by design where the log is the same."""
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
    """Return our files as one script, in one scope that nothing outside sees."""
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


def _zipped(values: dict[str, Any]) -> str:
    data = json.dumps(values, ensure_ascii=False, separators=(",", ":"), allow_nan=False).encode()
    return base64.b64encode(gzip.compress(data, 6, mtime=0)).decode("ascii")


def _side(story: Story) -> dict[str, Any]:
    """What the browser words its explanations of one side with."""
    design = story.config.design
    return {
        "begin_us": story.begin_us,
        "end_s": (story.end_us - story.begin_us) / 1e6,
        "axles": [a.number for a in story.axles],
        "models": list(design.model_names),
        "rules": [sentence(design, r) for r in range(len(design.rules))],
        "details": {str(a.number): [e.detail for e in a.spells.events] for a in story.axles},
    }


def _vocabulary() -> dict[str, Any]:
    """The words that are the same for every log."""
    return {
        "validity": [v.value for v in VALIDITIES],
        "causes": {int(c): [c.label, c.words] for c in Cause},
        "inputs": list(INPUT_NAMES),
        "contact": words_of("adhesion", "ContactState"),
        "surface": words_of("adhesion", "Surface"),
        "confidence": words_of("adhesion", "Confidence"),
    }
