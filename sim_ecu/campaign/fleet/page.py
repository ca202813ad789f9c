"""A fleet's logs as one page without anything outside it: what is suspicious first, then trains and their logs."""

import html
from collections.abc import Iterator, Mapping, Sequence

from sim_ecu.campaign.fleet.drawing import legend, share_bar, spoken
from sim_ecu.campaign.fleet.page_rows import (
    LOG_HEAD,
    Cell,
    Line,
    causes,
    command,
    date,
    duration,
    hours,
    log_line,
    number,
    said,
    share,
    table,
    text,
)  # fmt: skip
from sim_ecu.campaign.fleet.page_style import STYLE
from sim_ecu.campaign.fleet.summary import Group, Played, Summary, Suspicion

MARK = "sim-ecu campaign --logs"  # in the page's generator
MAX_LINKS = 4  # to logs of one suspicious sensor
MAX_NAMES = 6  # of trains in a sentence


def page(found: Summary, folder: str, reports: Mapping[str, str]) -> str:
    """HTML, in English. folder: the fleet's, from which commands are given. reports: places of reports by log."""
    title = html.escape(found.title)
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        f'<title>{title}</title>\n<meta name="generator" content="{MARK}"><link rel="icon" href="data:,">'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLE}</style></head>\n<body>\n'
        + "\n".join(_body(found, folder, reports))
        + "\n</main></body></html>\n"
    )


def _body(found: Summary, folder: str, reports: Mapping[str, str]) -> Iterator[str]:
    yield f"<header><h1>{html.escape(found.title)}</h1>"
    yield from (f"<p>{line}</p>" for line in head(found))
    yield "</header><main>"
    yield '<h2 id="suspicious">Suspicious sensors</h2>'
    yield from _suspicious(found)
    if found.failed:
        yield '<h2 id="failed">Logs that could not be judged</h2>'
        lines = [Line([Cell(_link(p)), text(p.ending.value), text(said(p))]) for p in found.failed]
        yield from table(("log", "ending", "error"), lines, "logs")
    yield '<h2 id="adhesion">Adhesion by class</h2>'
    yield from _classes(found.every)
    yield '<h2 id="causes">Why not Valid</h2>'
    rows = [Line([text(c.label), share(part), text(c.words)]) for c, part in found.every.causes()]
    yield from table(("cause", "share of the axles' time", "in words"), rows)
    yield '<h2 id="trains">Trains</h2>'
    yield "<p>Bars: the axles' way by class. A log's bar goes along its way, a column for each step.</p>" + legend()
    yield from table(TRAIN_HEAD, [_train(g, k) for k, g in enumerate(found.trains, 1)], "trains")
    yield '<h2 id="logs">Logs</h2>'
    for k, g in enumerate(found.trains, 1):
        yield from _logs(g, k, len(found.trains) == 1, folder, reports)


def head(found: Summary) -> list[str]:
    """The whole in some sentences."""
    every, trains, failed = found.every, len(found.trains), len(found.failed)
    named = len({id(p) for s in found.suspicions for p in s.logs})
    out = [
        f"{_many(len(every.logs), 'log')} of {_many(trains, 'train')}: {every.sum('km'):.1f} km in "
        f"{duration(every.sum('hours'))}. Of the axles' time {100 * every.share('valid'):.1f} % is Valid."
        if every.done
        else f"{_many(len(every.logs), 'log')} of {_many(trains, 'train')}, of which none could be judged.",
        f"{_many(named, 'log')} with something suspicious, {failed} that could not be judged.",
    ]
    missing: dict[tuple[int, ...], list[str]] = {}
    for g in found.trains:
        if axles := tuple(g.without_frame):
            missing.setdefault(axles, []).append(g.name)
    for axles, names in missing.items():
        listed = ", ".join(names[:MAX_NAMES]) + f" and {len(names) - MAX_NAMES} more" * (len(names) > MAX_NAMES)
        out.append(
            f"No log of {html.escape(listed)} has a frame of axle {', '.join(map(str, axles))}, which the "
            "configuration has: left out."
        )
    return out


def _many(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"


def _link(p: Played) -> str:
    return f'<a href="#log{p.number}">{html.escape(p.name)}</a>'


def _suspicious(found: Summary) -> Iterator[str]:
    if not found.suspicions:
        yield "<p>None was named.</p>"
        return
    yield (
        "<p>What the daemon named, by train and axle, the longest first. A short time in one log may be chance: "
        "look into its report.</p>"
    )
    head = ("train", "axle", "what", "first seen, UTC", "in all", "logs", "as the daemon said it", "in")
    yield from table(head, [_suspicion(s) for s in found.suspicions], "suspicious sensors")


def _suspicion(s: Suspicion) -> Line:
    links = ", ".join(_link(p) for p in s.logs[:MAX_LINKS])
    more = f" and {len(s.logs) - MAX_LINKS} more" if len(s.logs) > MAX_LINKS else ""
    cells = [
        text(s.train), Cell(str(s.axle or "")), text(s.what), Cell(date(s.first_s)), Cell(duration(s.seconds / 3600)),
        Cell(str(len(s.logs))), text(s.text), Cell(links + more, "text"),
    ]  # fmt: skip
    return Line(cells)


def _classes(every: Group) -> Iterator[str]:
    for prefix, of in (("km", "way"), ("hours", "time")):
        sums = every.classes(prefix)
        if sums.sum() > 0:
            yield f"<p>Of the axles' {of}: {html.escape(spoken(sums))}.</p>{share_bar(sums)}"
    yield legend()


TRAIN_HEAD = ("train", "logs", "km", "time", "Valid", "not Valid because of", "classes", "suspicious")


def _train(g: Group, k: int) -> Line:
    failed = sum(not p.done for p in g.logs)
    suspects = sum(bool(p.suspects) for p in g.done)
    logs = f"{len(g.logs)}" + f" ({failed} failed)" * bool(failed)
    cells = [
        Cell(f'<a href="#train{k}">{html.escape(g.name)}</a>'), Cell(logs), number(g.sum("km")), hours(g.sum("hours")),
        share(g.share("valid")), text(causes(g)), Cell(share_bar(g.classes("km")), "picture"),
        text(f"{_many(suspects, 'log')}" if suspects else ""),
    ]  # fmt: skip
    return Line(cells)


def _logs(g: Group, k: int, is_open: bool, folder: str, reports: Mapping[str, str]) -> Iterator[str]:
    axles = ", ".join(f"axle {a}: {100 * valid:.1f} %" for a, valid in g.by_axle().items())
    yield f'<details class="train" id="train{k}"{" open" * is_open}><summary><strong>{html.escape(g.name)}</strong> '
    yield f"{_many(len(g.logs), 'log')}{f'; Valid: {axles}' * bool(axles)}</summary>"
    lines = [log_line(p, command(p, folder), reports.get(p.name)) for p in g.logs]
    yield from table(LOG_HEAD, lines, "logs")
    yield "</details>"


def _in_cell(name: str) -> str:
    """A name that neither ends a Markdown table's cell nor its row."""
    return " ".join(name.split()).replace("|", "\\|")


def tables(found: Summary) -> list[str]:
    """The same for a terminal: trains, then what is suspicious."""
    out = [html.unescape(line) for line in head(found)]
    out += ["", "| train | logs | km | time | Valid | not Valid because of |", "| --- | --- | --- | --- | --- | --- |"]
    out += [
        f"| {_in_cell(g.name)} | {len(g.logs)} | {g.sum('km'):.1f} | {duration(g.sum('hours'))} | "
        f"{share(g.share('valid')).html} | {causes(g)} |"
        for g in found.trains
    ]
    out += _listed("suspicious: ", [_spoken(s) for s in found.suspicions])
    out += _listed("failed: ", [f"{p.name}: {said(p)}" for p in found.failed])
    return out


MAX_LISTED = 20


def _listed(word: str, lines: Sequence[str]) -> list[str]:
    more = [f"and {len(lines) - MAX_LISTED} more"] if len(lines) > MAX_LISTED else []
    return [""] * bool(lines) + [word + line for line in lines[:MAX_LISTED]] + more


def _spoken(s: Suspicion) -> str:
    axle = f" axle {s.axle}" if s.axle else ""
    return f"{s.train}{axle}: {s.what}, {duration(s.seconds / 3600)} in {_many(len(s.logs), 'log')}: {s.text}"
