"""The words and tables of a page as HTML. All that a file or a DBC says is escaped."""

import datetime
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape

import numpy as np

from wrcd.bus.frame import EXTENDED
from wrcd.core.causes import Validity
from wrcd.tools.check import order
from wrcd.tools.report.differences import Difference
from wrcd.tools.story.records import Axle, Event, Fall, Finding, Story

LEVELS = {"good": "Good", "note": "Note", "warning": "Warning", "bad": "Bad"}
MAX_WARNINGS, MAX_FALLS = 50, 40


def heading(story: Story, against: Story | None) -> str:
    """What the log is."""
    facts = [
        ("log", str(story.log)),
        *([("against", str(against.log))] if against is not None else []),
        ("channel", story.channel),
        ("begin", utc(story.begin_us)),
        ("duration", duration((story.end_us - story.begin_us) / 1e6)),
        ("axles", ", ".join(str(a.number) for a in story.axles)),
        ("values are from", story.source),
        ("design", f"{story.config.design.name} {story.config.design.checksum[:12]}"),
    ]
    items = "".join(f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in facts if v)
    return f'<h1>{escape(story.log.name)}</h1>\n<dl class="facts">{items}</dl>'


def utc(time_us: int) -> str:
    """Date and time of a stamp."""
    try:
        moment = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC) + datetime.timedelta(microseconds=time_us)
    except OverflowError:
        return f"{time_us / 1e6:.3f} s"
    return f"{moment:%Y-%m-%d %H:%M:%S}.{time_us % 1_000_000 // 1000:03d} UTC"


def duration(seconds: float) -> str:
    """1 h 2 min 3.4 s."""
    if seconds < 60.0:
        return f"{seconds:.2f} s" if seconds < 10.0 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min {rest} s" if hours else f"{minutes} min {rest} s"


def verdict(story: Story) -> str:
    """What happened: findings, then the falls and rises that none of them is about, then what the log suffers from."""
    falls = {(f.axle, f.begin_us): f for f in story.falls}
    out = ['<ul class="findings">', *(_finding(story, f, falls) for f in story.verdict), "</ul>"]
    told = {(f.axle, f.begin_us) for f in story.verdict}
    rest = [f for key, f in falls.items() if key not in told]
    if rest:
        out.append('<h3>Where adhesion fell or rose</h3>\n<ul class="falls">')
        out += [f"<li>{_fall(story, f)}</li>" for f in rest[:MAX_FALLS]]
        out.append("</ul>")
        if len(rest) > MAX_FALLS:
            out.append(f"<p>{len(rest) - MAX_FALLS} more are seen in the plots.</p>")
    if story.warnings:
        lines = [f"<li>{escape(w)}</li>" for w in story.warnings[:MAX_WARNINGS]]
        if len(story.warnings) > MAX_WARNINGS:
            lines.append(f"<li>and {len(story.warnings) - MAX_WARNINGS} more</li>")
        out.append(f'<h3>Of the log itself</h3>\n<ul class="warnings">{"".join(lines)}</ul>')
    return "\n".join(out)


def sentences(findings: Iterable[Finding], story: Story) -> str:
    """Findings alone, of two sides."""
    return "\n".join(['<ul class="findings">', *(_finding(story, f, {}) for f in findings), "</ul>"])


def _fall(story: Story, f: Fall) -> str:
    begin, end = (f.begin_us - story.begin_us) / 1e6, (f.end_us - story.begin_us) / 1e6
    verb, css, mark = ("fell", "fall", "↓") if f.after_pct < f.before_pct else ("rose", "rise", "↑")
    text = (
        f"axle {f.axle} {verb} from {f.before_pct:.1f} % to {f.after_pct:.1f} % at {begin:.1f} s, "
        f"within {duration(max(end - begin, 0.0))}"
    )
    return f'<button class="{css} go" {_go(f.axle, begin, end)}>{mark} {escape(text)}</button>'


def _go(axle: int, begin_s: float, end_s: float) -> str:
    return f'data-axle="{axle}" data-begin="{begin_s:.6f}" data-end="{end_s:.6f}"'


def _finding(story: Story, f: Finding, falls: Mapping[tuple[int, int], Fall]) -> str:
    """A sentence; where it has a time, a button that goes there: of a fall to the fall itself."""
    level = f.level if f.level in LEVELS else "note"
    where = f"axle {f.axle}: " if f.axle and f"axle {f.axle}" not in f.text.lower() else ""
    text = f"{escape(where)}{escape(f.text)}"
    if f.begin_us is not None:
        fall = falls.get((f.axle, f.begin_us))
        begin = (f.begin_us - story.begin_us) / 1e6
        last_us = f.end_us if fall is None else fall.end_us
        end = begin if last_us is None else (last_us - story.begin_us) / 1e6
        css = "" if fall is None else "fall " if fall.after_pct < fall.before_pct else "rise "
        text = f'<button class="{css}go" {_go(f.axle, begin, end)}>{text}</button>'
    return f'<li class="{level}"><span class="level">{LEVELS[level]}</span> <span>{text}</span></li>'


def causes(story: Story) -> str:
    """States and causes of every axle: how often, how long."""
    rows = []
    for axle in story.axles:
        by: dict[tuple[Validity, str, str], list[Event]] = defaultdict(list)
        for e in axle.events:
            by[e.validity, *_why(e)].append(e)
        total = sum(e.duration_s for e in axle.events) or 1.0
        for (validity, label, why), found in sorted(by.items(), key=lambda kv: -sum(e.duration_s for e in kv[1])):
            longest = max(found, key=lambda e: e.duration_s)
            begin = (longest.begin_us - story.begin_us) / 1e6
            seconds = sum(e.duration_s for e in found)
            button = f'<button class="go" {_go(axle.number, begin, begin + longest.duration_s)}>{begin:.2f} s</button>'
            rows.append((
                axle.number, f'<span class="state {validity.value}">{escape(validity.value)}</span>', escape(label),
                escape(why), len(found), f"{seconds:.2f}", f"{100.0 * seconds / total:.2f}",
                f"{longest.duration_s:.2f}", button,
            ))  # fmt: skip
    heads = (
        "axle",
        "Validity",
        "cause",
        "in words",
        "times",
        "s in all",
        "% of the time",
        "longest, s",
        "longest from",
    )
    return table(heads, rows, escaped=True, words=(1, 2, 3))


def _why(e: Event) -> tuple[str, str]:
    """The cause as the DBC spells it and in words; where there is none, what is known of the event."""
    if e.cause or e.validity is Validity.VALID:
        return e.cause.label if e.cause else "", e.cause.words
    return "", e.detail or "no cause was told"


def ages(story: Story) -> str:
    """SampleAge in figures."""
    rows = []
    for axle in story.axles:
        values = axle.adhesion.age_ms[np.isfinite(axle.adhesion.age_ms)]
        if len(values):
            parts = np.quantile(values, (0.5, 0.95, 0.99, 0.999, 1.0))
            rows.append((axle.number, len(values), *(f"{v:.0f}" for v in parts)))
    return table(("axle", "frames", "median, ms", "95 %, ms", "99 %, ms", "99.9 %, ms", "longest, ms"), rows)


def bus(story: Story) -> str:
    """Every id of the bus."""
    rows = []
    for m in sorted(story.bus.messages, key=lambda m: m.key):
        identifier = f"0x{m.key - EXTENDED:08X}" if m.key & EXTENDED else f"0x{m.key:03X}"
        at = (m.longest_gap_at_us - story.begin_us) / 1e6
        e2e = "not looked at" if m.wrong_e2e < 0 else "all right" if m.wrong_e2e == 0 else f"{m.wrong_e2e} wrong"
        cycle = "" if math.isnan(m.cycle_ms) else f"{m.cycle_ms:g}"
        gap = "" if math.isnan(m.longest_gap_ms) else f"{m.longest_gap_ms:.1f}"
        where = f'<button class="go" {_go(0, at, at + m.longest_gap_ms / 1e3)}>{at:.2f} s</button>' if gap else ""
        rows.append((
            f"<code>{identifier}</code>", escape(m.name) or "unknown", escape(m.role), m.frames, f"{m.mean_hz:.2f}",
            cycle, gap, where, escape(e2e),
        ))  # fmt: skip
    heads = ("id", "message", "role", "frames", "mean rate, 1/s", "cycle, ms", "longest gap, ms", "gap from", "E2E")
    errors = len(story.bus.error_frames)
    line = f"Load at an assumed {story.bus.bit_rate / 1000:g} kbit/s (--bit-rate). " + (
        f"{errors} error frames." if errors else "No error frame."
    )
    return f"<p>{escape(line)}</p>\n{table(heads, rows, escaped=True, words=(1, 2, 8))}"


def configuration(story: Story) -> str:
    """What the values came from."""
    c = story.config
    rows = [
        ("configuration", c.file), ("DBC", str(c.dbc_file)), ("design", f"{c.design.name}, {c.design_file}"),
        ("checksum of the design", c.design.checksum), ("form of the design", c.design.form),
        ("models", ", ".join(c.design.model_names)), ("rules", str(len(c.design.rules))),
        ("window", f"{c.design.window_s:g} s, up to {c.design.longest_s:g} s"),
        ("tick", f"{1e3 * c.design.tick_s:g} ms"),
        ("speeds of the design", f"{c.design.speeds_m_s[0]:g} to {c.design.speeds_m_s[-1]:g} m/s"),
        ("slower than this there is no estimate", f"{c.min_speed_m_s:g} m/s"),
        ("NotAvailable after", f"{c.not_available_after_us / 1e3:g} ms"),
        ("torque is total", "yes" if c.torque_is_total else "no"),
    ]  # fmt: skip
    if c.positions_m is not None:
        rows.append(("fusion", order(c)))
    for a in c.axles:
        messages = [o.message for o in (a.adhesion, a.detail, a.inputs, a.ahead) if o is not None]
        rows.append((f"axle {a.number}", ", ".join(messages)))
    for i in c.inputs:
        signal = f"{i.source.message}.{i.source.signal}, stale after {i.timeout_us / 1e3:g} ms"
        rows.append((f"input: {i.source.quantity.value[0]}", signal))
    rows += story.versions.items()
    warnings = "".join(f"<li>{escape(w)}</li>" for w in c.warnings)
    return table(("what", "value"), rows, words=(0, 1)) + (f"<ul>{warnings}</ul>" if warnings else "")


def compared(rows: Sequence[Difference], sides: tuple[str, str]) -> str:
    """Two sides, line by line."""

    cells = [
        (
            d.axle, d.what, d.unit, _figure(d.here, d.digits), _figure(d.there, d.digits),
            _figure(d.there - d.here, d.digits, "+"),
        )
        for d in rows
    ]  # fmt: skip
    return table(("axle", "what", "unit", *sides, "difference"), cells, words=(1, 2))


def _figure(value: float, digits: int, sign: str = "") -> str:
    return "" if math.isnan(value) else f"{value:{sign}.{digits}f}"


def table(
    heads: Sequence[str], rows: Iterable[Sequence[object]], *, escaped: bool = False, words: Sequence[int] = ()
) -> str:
    """Columns are numbers, to the right, but for those of words. It scrolls sideways by itself."""
    css = ["w" if i in words else "n" for i in range(len(heads))]
    head = "".join(f'<th scope="col" class="{c}">{escape(h)}</th>' for h, c in zip(heads, css, strict=True))
    body = "".join(
        "<tr>"
        + "".join(f'<td class="{c}{_long(v)}">{_cell(v, escaped)}</td>' for v, c in zip(r, css, strict=True))
        + "</tr>\n"
        for r in rows
    )
    return (
        '<div class="scroll" tabindex="0" role="group" aria-label="table"><table><thead><tr>'
        f"{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _cell(value: object, escaped: bool) -> str:
    return str(value) if escaped else escape(str(value))


def _long(value: object) -> str:
    return " long" if isinstance(value, str) and "<" not in value and len(value) > 24 and " " in value else ""


def described(axle: Axle) -> str:
    """An axle's curve in a sentence, for who cannot see it."""
    mu = axle.adhesion.available_pct[np.isfinite(axle.adhesion.available_pct)]
    return " ".join(_sentences(axle, mu))


def _sentences(axle: Axle, mu: np.ndarray[tuple[int], np.dtype[np.float32]]) -> Iterator[str]:
    if len(mu):
        yield f"Available adhesion is {mu.min():.1f} to {mu.max():.1f} %, median {np.median(mu):.1f} %."
    else:
        yield "There is no available adhesion."
    states = {v: sum(e.duration_s for e in axle.events if e.validity is v) for v in Validity}
    yield ", ".join(f"{v.value} {duration(s)}" for v, s in states.items() if s) + "."
