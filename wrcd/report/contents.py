"""What a page says in words and figures: facts, verdicts, tables. Nothing is HTML yet: page.html makes it so."""

import datetime
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wrcd.bus.frame import id_text
from wrcd.core.causes import Validity
from wrcd.logs.log_comparison import compare
from wrcd.logs.story_events import VALID_PLACE
from wrcd.logs.story_records import Event, Fall, Finding, Numbers, Story, StoryAxle, at, total_s
from wrcd.logs.truth import accuracy

LEVELS = ("good", "note", "warning", "bad")
QUANTILES = (0.5, 0.95, 0.99, 0.999, 1.0)


@dataclass(frozen=True, slots=True)
class GoThere:
    """A text that shows a time when it is clicked, of an axle (0: of none)."""

    text: str
    axle: int
    begin_s: float
    end_s: float
    css: str = ""


@dataclass(frozen=True, slots=True)
class StateCell:
    """A word of Validity."""

    states: str


@dataclass(frozen=True, slots=True)
class CodeCell:
    """A CAN id."""

    code: str


@dataclass(frozen=True, slots=True)
class PageFigures:
    """A table. Columns are numbers, to the right, but for those of words."""

    heads: Sequence[str]
    rows: Sequence[Sequence[object]]
    words: Sequence[int] = ()


@dataclass(frozen=True, slots=True)
class Difference:
    """A line of the comparison of two sides. NaN: there is none."""

    axle: int
    what: str
    unit: str
    here: float
    there: float
    digits: int = 1


def facts(story: Story, against: Story | None) -> list[tuple[str, str]]:
    """Return what the log is."""
    return [
        ("log", str(story.log)), ("against", "" if against is None else str(against.log)), ("channel", story.channel),
        ("begin", _utc(story.begin_us)), ("duration", _duration((story.end_us - story.begin_us) / 1e6)),
        ("axles", ", ".join(str(a.number) for a in story.axles)), ("source", story.source),
        ("design", f"{story.config.design.name} {story.config.design.checksum[:12]}"),
    ]  # fmt: skip


def _utc(time_us: int) -> str:
    try:
        moment = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC) + datetime.timedelta(microseconds=time_us)
    except OverflowError:
        return f"{time_us / 1e6:.3f} s"
    return f"{moment:%Y-%m-%d %H:%M:%S}.{time_us % 1_000_000 // 1000:03d} UTC"


def _duration(seconds: float) -> str:
    """1 h 2 min 3.4 s."""
    if seconds < 60.0:
        return f"{seconds:.2f} s" if seconds < 10.0 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min {rest} s" if hours else f"{minutes} min {rest} s"


def verdict(story: Story) -> Mapping[str, Any]:
    """Return what happened: findings, then falls and rises that none of them is about, then what the log suffers
    from."""
    falls = {(f.axle, f.begin_us): f for f in story.falls}
    known = {(f.axle, f.begin_us) for f in story.verdict}
    rest = [_fall(story, f) for key, f in falls.items() if key not in known]
    return {"findings": findings(story.verdict, story, falls), "falls": rest, "warnings": story.warnings}


def _direction(f: Fall) -> tuple[str, str, str]:
    return ("fell", "fall", "↓") if f.after_pct < f.before_pct else ("rose", "rise", "↑")


def _fall(story: Story, f: Fall) -> GoThere:
    begin, end = (f.begin_us - story.begin_us) / 1e6, (f.end_us - story.begin_us) / 1e6
    verb, css, mark = _direction(f)
    text = (
        f"{mark} axle {f.axle} {verb} from {f.before_pct:.1f} % to {f.after_pct:.1f} % at {begin:.1f} s, "
        f"within {_duration(max(end - begin, 0.0))}"
    )
    return GoThere(text, f.axle, begin, end, css)


def findings(
    found: Iterable[Finding], story: Story, falls: Mapping[tuple[int, int], Fall] | None = None
) -> list[dict[str, object]]:
    """Return sentences with their levels; those that have a time go there, of a fall to the fall itself."""
    out: list[dict[str, object]] = []
    for f in found:
        where = f"axle {f.axle}: " if f.axle and f"axle {f.axle}" not in f.text.lower() else ""
        text: str | GoThere = where + f.text
        if f.begin_us is not None:
            fall = (falls or {}).get((f.axle, f.begin_us))
            begin = (f.begin_us - story.begin_us) / 1e6
            last_us = f.end_us if fall is None else fall.end_us
            end = begin if last_us is None else (last_us - story.begin_us) / 1e6
            text = GoThere(where + f.text, f.axle, begin, end, "" if fall is None else _direction(fall)[1])
        out.append({"level": f.level if f.level in LEVELS else "note", "text": text})
    return out


def causes(story: Story) -> PageFigures:
    """Return states and causes of every axle: how often, how long."""
    rows: list[Sequence[object]] = []
    for axle in story.axles:
        by: dict[tuple[Validity, str, str], list[Event]] = defaultdict(list)
        for e in axle.events:
            by[e.validity, *_why(e)].append(e)
        known_s = axle.spells.known_s or 1.0
        for (validity, label, why), found in sorted(by.items(), key=lambda kv: -total_s(kv[1])):
            longest = max(found, key=lambda e: e.duration_s)
            begin = (longest.begin_us - story.begin_us) / 1e6
            seconds = total_s(found)
            rows.append((
                axle.number, StateCell(validity.value), label, why, len(found), f"{seconds:.2f}",
                "" if longest.is_gap else f"{100.0 * seconds / known_s:.2f}", f"{longest.duration_s:.2f}",
                GoThere(f"{begin:.2f} s", axle.number, begin, begin + longest.duration_s),
            ))  # fmt: skip
    heads = ("axle", "Validity", "cause", "in words", "times", "s in all", "% of the time", "longest, s",
             "longest from")  # fmt: skip
    return PageFigures(heads, rows, (1, 2, 3))


def _why(e: Event) -> tuple[str, str]:
    """Return the cause as the DBC spells it and in words; where there is none, what is known of the event."""
    if e.cause or e.validity is Validity.VALID:
        return e.cause.label if e.cause else "", e.cause.words
    return "", e.detail or "cause not known"


def ages(story: Story) -> PageFigures:
    """Return SampleAge in figures."""
    rows = []
    for axle in story.axles:
        values = axle.adhesion.age_ms[np.isfinite(axle.adhesion.age_ms)]
        if len(values):
            rows.append((axle.number, len(values), *(f"{v:.0f}" for v in np.quantile(values, QUANTILES))))
    return PageFigures(("axle", "frames", "median, ms", "95 %, ms", "99 %, ms", "99.9 %, ms", "longest, ms"), rows)


def bus(story: Story) -> PageFigures:
    """Return every id of the bus."""
    rows = []
    for m in sorted(story.bus.messages, key=lambda m: m.key):
        begin = (m.longest_gap_at_us - story.begin_us) / 1e6
        gap = not math.isnan(m.longest_gap_ms)
        rows.append((
            CodeCell(id_text(m.key)), m.name or "unknown", m.role, m.frames, f"{m.mean_hz:.2f}",
            "" if math.isnan(m.cycle_ms) else f"{m.cycle_ms:g}", f"{m.longest_gap_ms:.1f}" if gap else "",
            GoThere(f"{begin:.2f} s", 0, begin, begin + m.longest_gap_ms / 1e3) if gap else "",
            "not looked at" if m.wrong_e2e < 0 else f"{m.wrong_e2e} wrong" if m.wrong_e2e else "all right",
        ))  # fmt: skip
    heads = ("id", "message", "role", "frames", "mean rate, 1/s", "cycle, ms", "longest gap, ms", "gap from", "E2E")
    return PageFigures(heads, rows, (1, 2, 8))


def bus_load(story: Story) -> str:
    """Return what the load is of, and how many error frames there were."""
    errors = len(story.bus.error_frames)
    return f"Load at an assumed {story.bus.bit_rate / 1000:g} kbit/s (--bit-rate). " + (
        f"{errors} error frames." if errors else "No error frame."
    )


def configuration(story: Story) -> Mapping[str, Any]:
    """Return what the values came from, and what is odd about it."""
    c = story.config
    rows = [
        ("configuration", c.file), ("DBC", str(c.dbc_file)), ("design", f"{c.design.name}, {c.design_file}"),
        ("checksum of the design", c.design.checksum), ("form of the design", c.design.form),
        ("models", ", ".join(c.design.model_names)), ("rules", str(len(c.design.rules))),
        ("window", f"{c.design.window_s:g} s"),
        ("tick", f"{1e3 * c.design.tick_s:g} ms"),
        ("speeds of the design", f"{c.design.speeds_m_s[0]:g} to {c.design.speeds_m_s[-1]:g} m/s"),
        ("slower than this there is no estimate", f"{c.min_speed_m_s:g} m/s"),
        ("NotAvailable after", f"{c.not_available_after_us / 1e3:g} ms"),
        ("torque is total", "yes" if c.torque_is_total else "no"),
    ]  # fmt: skip
    for a in c.axles:
        messages = [o.message for o in a.sent if o is not None]
        rows.append((f"axle {a.number}", ", ".join(messages)))
    for i in c.inputs:
        signal = f"{i.source.message}.{i.source.signal}, stale after {i.timeout_us / 1e3:g} ms"
        rows.append((f"input: {i.source.quantity.value[0]}", signal))
    return {"table": PageFigures(("what", "value"), [*rows, *story.versions.items()], (0, 1)), "warnings": c.warnings}


def described(axle: StoryAxle) -> str:
    """Return an axle's curve in sentences, for who cannot see it."""
    mu = axle.adhesion.available_pct[np.isfinite(axle.adhesion.available_pct)]
    text = "There is no available adhesion."
    if len(mu):
        text = f"Available adhesion is {mu.min():.1f} to {mu.max():.1f} %, median {np.median(mu):.1f} %."
    states = {v: axle.spells.lasted_s(v) for v in Validity}
    return f"{text} {', '.join(f'{v.value} {_duration(s)}' for v, s in states.items() if s)}."


def differences_table(story: Story, against: Story, sides: tuple[str, str]) -> PageFigures:
    """Return two sides, line by line."""

    def figure(value: float, digits: int, sign: str = "") -> str:
        return "" if math.isnan(value) else f"{value:{sign}.{digits}f}"

    rows = [
        (d.axle, d.what, d.unit, *(figure(v, d.digits) for v in (d.here, d.there)),
         figure(d.there - d.here, d.digits, "+"))
        for d in differences(story, against)
    ]  # fmt: skip
    return PageFigures(("axle", "what", "unit", *sides, "difference"), rows, (1, 2))


def differences(story: Story, against: Story) -> Iterator[Difference]:
    """Return two sides in figures, of the axles that both have."""
    ours, theirs = ({a.number: a for a in s.axles} for s in (story, against))
    for c in compare(story, against):
        a, b = ours[c.number], theirs[c.number]
        for what, unit, digits, of in FIGURES:
            yield Difference(c.number, what, unit, of(a), of(b), digits)
        if a.truth is not None or b.truth is not None:
            yield Difference(c.number, "mean absolute error against the truth", "pp", _error(a), _error(b), 2)
        what = "available, mean distance of the two where both are Valid"
        yield Difference(c.number, what, "pp", math.nan, c.mean_absolute_pp, 2)
        where = f", at {at(story, c.worst_at_us)}" if c.both_valid else ""
        yield Difference(c.number, f"available, largest distance{where}", "pp", math.nan, abs(c.worst_pp), 2)


def _valid(axle: StoryAxle) -> Numbers:
    found: Numbers = axle.adhesion.available_pct[axle.adhesion.validity == VALID_PLACE]
    return found


def _quantile(values: Numbers, share: float) -> float:
    values = values[np.isfinite(values)]
    return float(np.quantile(values, share)) if len(values) else math.nan


def _error(axle: StoryAxle) -> float:
    found = accuracy(axle)
    return math.nan if found is None else found.mean_absolute_pp


# what is compared of an axle: its name, its unit, how many digits it has
FIGURES: tuple[tuple[str, str, int, Callable[[StoryAxle], float]], ...] = (
    ("frames", "", 0, lambda a: len(a.adhesion.time_us)),
    *((v.value, "% of the time", 1, lambda a, v=v: 100.0 * a.spells.share(v))
      for v in (Validity.VALID, Validity.DEGRADED, Validity.NOT_AVAILABLE)),
    ("changes of Validity or cause", "", 0, lambda a: max(len(a.events) - 1, 0)),
    ("longest not Valid", "s", 2, lambda a: max(map(total_s, a.not_valid_runs()), default=0.0)),
    ("available, median where Valid", "%", 2, lambda a: _quantile(_valid(a), 0.5)),
    ("available, lowest where Valid", "%", 2, lambda a: _quantile(_valid(a), 0.0)),
    ("half-width of the interval, median", "pp", 1,
     lambda a: _quantile(a.adhesion.high_pct - a.adhesion.available_pct, 0.5)),
    ("SampleAge, 99 % of frames below", "ms", 0, lambda a: _quantile(a.adhesion.age_ms, 0.99)),
)  # fmt: skip
