"""Lint: numbers of signals, and the words of their value tables."""

from collections.abc import Collection, Iterator

from wrcd.bus.words import unusable, usable
from wrcd.tools.dbc.candidates import MIN_BITS, Candidate
from wrcd.tools.dbc.records import DbcText, Message, Signal
from wrcd.tools.dbc.vocabulary import (
    is_adhesion,
    is_enumeration,
    is_percent,
    is_status,
    says_adhesion,
)
from wrcd.tools.lint.codes import Finding
from wrcd.tools.lint.layout import MAX_BITS

FLOAT_BITS = (16, 32, 64)


def check(dbc: DbcText) -> Iterator[Finding]:
    """Every finding."""
    for m in dbc.on_the_bus:
        for s in m.signals:
            if 0 < s.length <= MAX_BITS:
                yield from _range(m, s)
                yield from _start_value(dbc, m, s)
                yield from _words(m, s)
        if is_adhesion(m):
            yield from _room(m)


def limits(s: Signal) -> tuple[float, float]:
    """The lowest and the highest physical value of the bits."""
    ends = [raw * s.scale + s.offset for raw in (s.lowest_raw, s.highest_raw)]
    return min(ends), max(ends)


def _range(m: Message, s: Signal) -> Iterator[Finding]:
    name = f"{m.name}.{s.name}"
    if s.scale == 0:
        yield Finding(s.line, "factor-zero", name, f"({s.scale:g},{s.offset:g})")
    if s.is_float and s.length not in FLOAT_BITS:
        yield Finding(s.line, "float-width", name, f"{s.length} bits")
    if s.low is None or s.high is None:
        return
    stated = f"[{s.low:g}|{s.high:g}]"
    if s.low > s.high:
        yield Finding(s.line, "range-reversed", name, stated)
    elif s.scale and not s.is_float:
        low, high = limits(s)
        slack = 0.5 * abs(s.scale) + 1e-9 * max(abs(low), abs(high))
        if s.low < low - slack or s.high > high + slack:
            yield Finding(s.line, "range-beyond-field", name, f"{stated}, {s.length} bits hold {low:g} … {high:g}")


def in_range(s: Signal, raw: float) -> bool:
    """Whether a raw value is a measurement by [min|max]; without a range every one is."""
    if s.low is None or s.high is None:
        return True
    slack = 1e-6 * abs(s.scale)
    return s.low - slack <= raw * s.scale + s.offset <= s.high + slack


def _start_value(dbc: DbcText, m: Message, s: Signal) -> Iterator[Finding]:
    if "GenSigStartValue" not in s.attributes or s.is_float:
        return  # a default for the whole file is nobody's statement about this signal
    raw = dbc.number(s, "GenSigStartValue")
    if raw is None:
        return
    holds = s.lowest_raw <= raw <= s.highest_raw
    named = s.words is not None and raw in {r for r, _ in s.words.pairs}
    if not holds or not (named or in_range(s, raw)):
        what = f"raw {raw:g}" if not holds else f"raw {raw:g}, which is {raw * s.scale + s.offset:g}{_unit(s)}"
        line = dbc.attribute_line(s, "GenSigStartValue")
        yield Finding(line, "start-value-out-of-range", f"{m.name}.{s.name}", what)


def _unit(s: Signal) -> str:
    return f" {s.unit}" if s.unit else ""


def _words(m: Message, s: Signal) -> Iterator[Finding]:
    if s.words is None:
        return
    name = f"{m.name}.{s.name}"
    seen: dict[int, str] = {}
    for raw, word in s.words.pairs:
        if raw in seen:
            yield Finding(s.words.line, "value-named-twice", name, f"{raw} is {seen[raw]!r} and {word!r}")
        seen[raw] = word
        if not s.is_float and not s.lowest_raw <= raw <= s.highest_raw:
            what = f"{raw} {word!r}, {s.length} bits hold {s.lowest_raw} … {s.highest_raw}"
            yield Finding(s.words.line, "value-beyond-width", name, what)
        elif unusable(word) and _measures(s) and s.low is not None and in_range(s, raw):
            what = f"{raw} {word!r} is {raw * s.scale + s.offset:g}{_unit(s)}, within [{s.low:g}|{s.high:g}]"
            yield Finding(s.words.line, "sentinel-in-range", name, what)


def check_statuses(inputs: Collection[Candidate]) -> Iterator[Finding]:
    """Statuses beside inputs: each with the words that are in its table."""
    for m in {c.message.line: c.message for c in inputs}.values():
        for s in (s for s in m.signals if is_status(s) and s.words):
            told = [w for _, w in s.words.pairs] if s.words else []
            if not any(map(usable, told)) and any(map(unusable, told)):
                line = s.words.line if s.words else s.line
                yield Finding(line, "status-words-unknown", f"{m.name}.{s.name}", ", ".join(map(repr, told)))


def _measures(s: Signal) -> bool:
    """Whether its values are numbers. One whose words are states has "not available" among them, rightly in range."""
    return bool(s.unit.strip()) or s.scale != 1 or not (is_enumeration(s) or is_status(s) or s.length < MIN_BITS)


def _room(m: Message) -> Iterator[Finding]:
    for s in m.signals:
        if is_percent(s) and (says_adhesion(s) or s.high is not None) and not s.is_float and 0 < s.length <= 32:
            ends = in_range(s, s.lowest_raw) and in_range(s, s.highest_raw)
            if ends and s.scale:
                low, high = limits(s)
                what = f"{s.length} bits are {low:g} … {high:g} {s.unit}, all in its range"
                yield Finding(s.line, "no-room-for-not-available", f"{m.name}.{s.name}", what)
