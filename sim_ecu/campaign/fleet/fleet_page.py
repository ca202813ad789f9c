"""A fleet's logs as sections: what is suspicious first, then trains and their logs; for a page and for a terminal."""

import itertools
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup, escape

from sim_ecu.campaign.fleet.summary import LogGroup, Played, Summary, Suspicion
from sim_ecu.campaign.fleet.tally import CLASSES, FloatArray, N, merged
from sim_ecu.reporting.page import Folded, Page, PageSection, Part, html
from sim_ecu.reporting.table import Cell, Row, Table
from sim_ecu.reporting.values import UNKNOWN, Value, date, duration, many, share

MAX_COLUMNS = 48  # of a log's bar: more are narrower than can be seen
HEIGHT = 100
# from the bottom: the most slippery lies on the line where it is looked for; not Valid on top
ORDER = (*reversed(range(N - 1)), N - 1)
CSS = tuple(f"c{k}" for k in range(N - 1)) + ("nv",)  # by place in CLASSES


def steps_of(detail: Mapping[str, Any]) -> tuple[str, FloatArray]:
    """Return what a column stands for, and (n, N) all axles' metres by class; seconds where the train did not move."""
    axles: Sequence[Mapping[str, Any]] = detail["axles"]
    of, step, unit = ("way", "step_m", "m") if any(a["way"] for a in axles) else ("time", "step_s", "s")
    rows = [a for a in axles if a[of]]
    if not rows:
        return "", np.zeros((0, N))
    width = float(rows[0][step])  # that of all axles of a log
    n = max(len(a[of]) for a in rows)
    sums = np.zeros((n, N))
    for a in rows:
        sums[: len(a[of])] += np.array(a[of], dtype=np.float64)
    many = -(-n // MAX_COLUMNS)
    return _words(width * many, unit), merged(sums, many)


def _words(width: float, unit: str) -> str:
    if unit == "m":
        return f"{width / 1000:g} km" if width >= 1000 else f"{width:g} m"
    return f"{width / 60:g} min" if width >= 60 else f"{width:g} s"


def columns(detail: Mapping[str, Any]) -> Markup:
    """Return a column for each step of a log, each class its share of it."""
    width, sums = steps_of(detail)
    totals = sums.sum(axis=1, keepdims=True)
    if not len(sums) or not totals.any():
        return Markup()
    shares = np.divide(sums, totals, out=np.zeros_like(sums), where=totals > 0)[:, ORDER]
    tops = np.round(HEIGHT * np.cumsum(shares, axis=1)).astype(int)
    parts = []
    for k, of in enumerate(ORDER):
        low = tops[:, k - 1] if k else np.zeros(len(tops), int)
        path = "".join(_runs(low.tolist(), tops[:, k].tolist()))
        if path:
            parts.append(f'<path class="{CSS[of]}" d="{path}"/>')
    label = f"a column for each {width}, {spoken(sums.sum(axis=0))}"
    return _svg(len(sums), HEIGHT, "".join(parts), label, "columns")


def _runs(lows: Sequence[int], tops: Sequence[int]) -> list[str]:
    """Rectangles of neighbouring columns that are alike, as a path."""
    out, x = [], 0
    for (low, top), group in itertools.groupby(zip(lows, tops, strict=True)):
        width = len(list(group))
        if top > low:
            out.append(f"M{x} {HEIGHT - top}h{width}v{top - low}h-{width}z")
        x += width
    return out


def share_bar(sums: FloatArray) -> Markup:
    """Return one bar, each class (N,) its share of it."""
    total = float(sums.sum())
    if not total > 0:
        return Markup()
    x, parts = 0.0, []
    for of in ORDER:
        width = 1000 * float(sums[of]) / total
        if width:
            parts.append(f'<rect class="{CSS[of]}" x="{x:.1f}" width="{width:.1f}" height="10"/>')
        x += width
    return _svg(1000, 10, "".join(parts), spoken(sums), "bar")


def spoken(sums: FloatArray) -> str:
    """Shares of the classes in words, those that there are."""
    total = float(sums.sum())
    return ", ".join(f"{CLASSES[of]} {_share(sums[of] / total)}" for of in ORDER if total and sums[of] > 0)


def _share(share: float) -> str:
    return "< 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def legend() -> Markup:
    """Return the colours by name, from the most slippery on."""
    keys = "".join(f'<li><span class="key {CSS[of]}"></span>{escape(CLASSES[of])}</li>' for of in ORDER)
    return Markup(f'<ul class="legend" aria-label="Colours">{keys}</ul>')


def _svg(width: int, height: int, inner: str, label: str, css: str) -> Markup:
    return Markup(
        f'<svg class="{css}" viewBox="0 0 {width} {height}" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(label)}">{inner}</svg>'
    )


MARK = "sim-ecu campaign --logs"  # in the page's generator
MAX_LINKS = 4  # to logs of one suspicious sensor
MAX_NAMES = 6  # of trains in a sentence
MAX_LISTED = 20  # for a terminal
CAUSES = 3  # that a row names
LOG_HEAD = ("log", "begin, UTC", "km", "time", "Valid", "not Valid because of", "classes", "suspicious")
TRAIN_HEAD = ("train", "logs", "km", "time", "Valid", "not Valid because of", "classes", "suspicious")
# the colours of surfaces are the report's
STYLE = """
:root { --c0: #e3eef6; --c1: #b3d2e8; --c2: #77aed6; --c3: #3f82b8; --c4: #1d4f7c; --nv: #f0dfc2 }
@media screen and (prefers-color-scheme: dark) {
  :root { --c0: #20303d; --c1: #284c66; --c2: #2f6b95; --c3: #4a93c6; --c4: #a8d3f2; --nv: #5a4a30 }
}
.c0 { fill: var(--c0); background: var(--c0) } .c1 { fill: var(--c1); background: var(--c1) }
.c2 { fill: var(--c2); background: var(--c2) } .c3 { fill: var(--c3); background: var(--c3) }
.c4 { fill: var(--c4); background: var(--c4) } .nv { fill: var(--nv); background: var(--nv) }
svg { display: block; width: 100%; min-width: 7rem; border: 1px solid var(--line); shape-rendering: crispEdges }
svg.columns { height: 2.2rem } svg.bar { height: .9rem }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .2rem 1rem; padding: 0; margin: .4rem 0 1rem }
.key { display: inline-block; width: 1rem; height: 1rem; margin-right: .35rem; border: 1px solid var(--line);
  vertical-align: -.15rem }
table { width: 100% } td.text, th.text, th.picture { text-align: left }
td:not([class]) { white-space: nowrap } td.picture { width: 14rem } .train th[scope=row] { min-width: 11rem }
summary { cursor: pointer; padding: .25rem 0 } .train > summary { border-top: 1px solid var(--line); padding: .5rem 0 }
.train > summary strong { font-size: 1.05rem } .more > summary { color: var(--loud) }
code { font: .85em/1.4 ui-monospace, monospace; background: var(--soft); padding: .1rem .3rem; user-select: all }
tr details { max-width: 26rem; text-align: left; font-weight: 400 } tr ul { margin: .2rem 0; padding-left: 1.1rem }
:target { outline: 2px solid var(--loud) }
.bad { background: var(--missed) }
@media screen and (max-width: 68rem) { td.picture { width: auto } .wide td.picture svg { max-width: 22rem } }
@media screen and (max-width: 40rem) { td > svg { max-width: 60vw } }
"""


def page(found: Summary, folder: str, reports: Mapping[str, str]) -> str:
    """Return HTML, in English. folder: the fleet's, from which commands are given. reports: places of reports by
    log."""
    sections = list(_sections(found, folder, reports))
    return html(Page(found.title, found.title, sections, _head(found), links="", style=STYLE, generator=MARK))


def _sections(found: Summary, folder: str, reports: Mapping[str, str]) -> Iterator[PageSection]:
    yield PageSection("Suspicious sensors", parts=[_suspicious(found)] if found.suspicions else ["None was named."])
    if found.failed:
        rows: list[list[Value | Cell]] = [[_link(p), p.ending.value, _error(p)] for p in found.failed]
        yield PageSection("Logs that could not be judged", parts=[Table(("log", "ending", "error"), rows, what="logs")])
    yield PageSection("Adhesion by class", parts=list(_classes(found.every)))
    causes: list[list[Value | Cell]] = [[c.label, _right(share(part)), c.words] for c, part in found.every.causes()]
    yield PageSection("Why not Valid", parts=[Table(("cause", "share of the axles' time", "in words"), causes)])
    bars = "Bars: the axles' way by class. A log's bar goes along its way, a column for each step."
    trains = [_train(g, k) for k, g in enumerate(found.trains, 1)]
    yield PageSection("Trains", parts=[bars, legend(), Table(TRAIN_HEAD, trains, what="trains")])
    logs = [_logs(g, k, len(found.trains) == 1, folder, reports) for k, g in enumerate(found.trains, 1)]
    yield PageSection("Logs", parts=logs)


def _head(found: Summary) -> list[str]:
    """The whole in some sentences."""
    every, failed = found.every, len(found.failed)
    logs = f"{many(len(every.logs), 'log')} of {many(len(found.trains), 'train')}"
    named = len({id(p) for s in found.suspicions for p in s.logs})
    out = [
        f"{logs}: {every.sum('km'):.1f} km in {_hours(every.sum('hours'))}. Of the axles' time "
        f"{100 * every.share('valid'):.1f} % is Valid."
        if every.done
        else f"{logs}, of which none could be judged.",
        f"{many(named, 'log')} with something suspicious, {failed} that could not be judged.",
    ]
    missing: dict[tuple[int, ...], list[str]] = {}
    for g in found.trains:
        if axles := tuple(g.without_frame):
            missing.setdefault(axles, []).append(g.name)
    for axles, names in missing.items():
        listed = ", ".join(names[:MAX_NAMES]) + f" and {len(names) - MAX_NAMES} more" * (len(names) > MAX_NAMES)
        out.append(
            f"No log of {listed} has a frame of axle {', '.join(map(str, axles))}, which the configuration has: "
            "left out."
        )
    return out


def _right(words: str, html: Markup | None = None) -> Cell:
    """A cell whose words stand at the right, as numbers do; empty for what is not known."""
    shown = "" if words == UNKNOWN else words
    return Cell(escape(shown) if html is None else html, shown, "")


def _hours(value: float) -> str:
    return duration(3600 * value)


def _link(p: Played) -> Cell:
    return Cell(Markup('<a href="#log{}">{}</a>').format(p.number, p.name), p.name)


def _suspicious(found: Summary) -> Table:
    head = ("train", "axle", "what", "first seen, UTC", "in all", "logs", "as the daemon said it", "in")
    title = (
        "What the daemon named, by train and axle, the longest first. A short time in one log may be chance: look into "
        "its report."
    )
    return Table(head, [_suspicion(s) for s in found.suspicions], title, what="suspicious sensors")


def _suspicion(s: Suspicion) -> list[str | Cell]:
    links = Markup(", ").join(_link(p).html for p in s.logs[:MAX_LINKS])
    more = f" and {len(s.logs) - MAX_LINKS} more" if len(s.logs) > MAX_LINKS else ""
    return [
        s.train, _right(str(s.axle or "")), s.what, _right(date(s.first_s)), _right(duration(s.seconds)),
        _right(str(len(s.logs))), s.text, Cell(links + more),
    ]  # fmt: skip


def _classes(every: LogGroup) -> Iterator[Part]:
    for prefix, of in (("km", "way"), ("hours", "time")):
        sums = every.classes(prefix)
        if sums.sum() > 0:
            yield f"Of the axles' {of}: {spoken(sums)}."
            yield share_bar(sums)
    yield legend()


def _train(g: LogGroup, k: int) -> list[str | Cell]:
    failed = sum(not p.done for p in g.logs)
    suspects = sum(bool(p.suspects) for p in g.done)
    return [
        Cell(Markup('<a href="#train{}">{}</a>').format(k, g.name)),
        _right(f"{len(g.logs)}" + f" ({failed} failed)" * bool(failed)), *_numbers(g, 1), _causes(g),
        Cell(share_bar(g.classes("km")), css="picture"), many(suspects, "log") if suspects else "",
    ]  # fmt: skip


def _numbers(g: LogGroup, digits: int) -> list[Cell]:
    """Way, time, share Valid."""
    return [_right(f"{g.sum('km'):.{digits}f}"), _right(_hours(g.sum("hours"))), _right(share(g.share("valid")))]


def _causes(group: LogGroup) -> str:
    """The largest causes of not being Valid, with their shares of the time."""
    named = [f"{cause.label} {100 * part:.1f} %" for cause, part in group.causes() if part >= 0.0005]
    return ", ".join(named[:CAUSES]) + ", …" * (len(named) > CAUSES)


def _logs(g: LogGroup, k: int, is_open: bool, folder: str, reports: Mapping[str, str]) -> Folded:
    axles = ", ".join(f"axle {a}: {100 * valid:.1f} %" for a, valid in g.by_axle().items())
    summary = Markup("<strong>{}</strong> {}{}").format(
        g.name, many(len(g.logs), "log"), f"; Valid: {axles}" * bool(axles)
    )
    rows = [_log(p, command(p, folder), reports.get(p.name)) for p in g.logs]
    return Folded(summary, [Table(LOG_HEAD, rows, what="logs")], f"train{k}", is_open, "train")


def _log(p: Played, command: str, report: str | None) -> Row:
    """A log. command: what makes its report; report: where that lies, if it does."""
    link = escape(p.name) if report is None else Markup('<a href="{}">{}</a>').format(quote(report), p.name)
    if not p.done:
        cells: list[Value | Cell] = [Cell(link), "", "", "", "", f"{p.ending.value}: {_error(p)}", "", ""]
        return Row(cells, f"log{p.number}", "bad")
    suspects = ", ".join(dict.fromkeys(f"{s['what']} {_axle(s['axle'])}".strip() for s in p.suspects))
    one = LogGroup("", [p])
    cells = [
        Cell(link + _details(p, command, report)), _right(date(p.begin_s)), *_numbers(one, 2), _causes(one),
        Cell(columns(p.detail), css="picture"), suspects,
    ]  # fmt: skip
    return Row(cells, f"log{p.number}")


def _axle(number: int) -> str:
    return f"axle {number}" if number else ""


def _details(p: Played, command: str, report: str | None) -> Markup:
    axles = ", ".join(f"axle {a['axle']}: {100 * a['valid']:.1f} %" for a in p.detail["axles"] if a["seconds"])
    refused = ", ".join(f"{r['frames']} {r['message']} ({r['reason']})" for r in p.detail["refused"])
    lines = [
        f"Valid: {axles}",
        f"{p.figures['read']} frames read, {p.figures['accepted']} accepted, {p.figures['refused']} refused"
        + f": {refused}" * bool(refused),
        *p.detail["warnings"],
        *(
            f"{s['what']} {_axle(s['axle'])}: first at {s['first_s']:.1f} s, {s['seconds']:.1f} s in all: {s['text']}"
            for s in p.suspects
        ),
    ]
    if report is None:
        lines.append(Markup("<code>{}</code>").format(command))
    items = Markup().join(Markup("<li>{}</li>").format(line) for line in lines)
    return Markup("<details><summary>more</summary><ul>{}</ul></details>").format(items)


def _error(p: Played) -> str:
    """A log's error without the log's name."""
    return p.error.removeprefix(f"{p.name}: ")


def command(p: Played, folder: str) -> str:
    """Return what makes a log's report, from the fleet's folder."""
    parts = ["wrcd", "report", p.name, "--replay", "-o", f"{PurePosixPath(p.name).name}.html"]
    if p.inputs["configuration"]:
        parts += ["--config", p.inputs["configuration"]]
    if p.inputs["channel"]:
        parts += ["--channel", p.inputs["channel"]]
    return f"cd {shlex.quote(folder)} && {shlex.join(parts)}"


def tables(found: Summary) -> list[str]:
    """Return the same for a terminal: trains, then what is suspicious."""
    rows: list[list[Value | Cell]] = [[g.name, str(len(g.logs)), *_numbers(g, 1), _causes(g)] for g in found.trains]
    return [
        *_head(found), "", *Table(TRAIN_HEAD[:6], rows).markdown(),
        *_listed("suspicious: ", [_spoken(s) for s in found.suspicions]),
        *_listed("failed: ", [f"{p.name}: {_error(p)}" for p in found.failed]),
    ]  # fmt: skip


def _listed(word: str, lines: Sequence[str]) -> list[str]:
    more = [f"and {len(lines) - MAX_LISTED} more"] if len(lines) > MAX_LISTED else []
    return [""] * bool(lines) + [word + line for line in lines[:MAX_LISTED]] + more


def _spoken(s: Suspicion) -> str:
    axle = f" axle {s.axle}" if s.axle else ""
    return f"{s.train}{axle}: {s.what}, {duration(s.seconds)} in {many(len(s.logs), 'log')}: {s.text}"
