"""`wrcd why`: what an axle said at a moment, what changed around it, and what decided before and after."""

import math
import re
import textwrap
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from wrcd.core.causes import Validity
from wrcd.errors import InputError
from wrcd.logs.explanation import Explanation, explain, find_axle
from wrcd.logs.story import ESTIMATED
from wrcd.logs.story_events import INPUT_NAMES, REASONS
from wrcd.logs.story_records import Event, Fall, Story, name, percent, seconds
from wrcd.logs.verdict import not_valid_runs

NEAR_US = 10_000_000  # a change further away is not what was asked about
REJECTS_NEAR_US = 2_000_000
WITHOUT_CHANGE_US = 1_000_000  # before and after a moment that no change is near to
SETTLED_US = 300_000  # after a change: AdhesionDetail has told of it
WIDTH, LABEL = 110, 10
MIN_CHANGE = 0.5  # of torque in kN m and speed in m/s
MAX_EVENTS = 5
MAX_MOVES = 3  # of a rule's output: `--json` has all
_BETWEEN_MOVES = re.compile(r", (?=[+-]\d)")


def moment(story: Story, given_s: float, *, key: str = "SECONDS", relative: bool = False, behind: bool = False) -> int:
    """Seconds since the log's first frame, or, if not relative, since 1970 where that lies within the log, in
    microseconds. Raises InputError for a time outside of the log; behind: one behind its end is none.
    """
    absolute = round(given_s * 1e6)
    if not relative and story.begin_us <= absolute <= story.end_us:
        return absolute
    time_us = story.begin_us + absolute
    if story.begin_us <= time_us and (behind or time_us <= story.end_us):
        return time_us
    raise InputError(
        f"{given_s:g} s is not within the log", file=story.log, key=key,
        hint=f"it has 0 to {(story.end_us - story.begin_us) * 1e-6:.3f} s after its first frame, or "
        f"{story.begin_us * 1e-6:.3f} to {story.end_us * 1e-6:.3f} since 1970",
    )  # fmt: skip


def _nearest_fall(story: Story, axle: int, time_us: int) -> Fall | None:
    """The fall or rise of an axle that a moment lies in or is nearest to."""
    own = [f for f in story.falls if f.axle == axle and _apart(f, time_us) <= NEAR_US]
    return min(own, key=lambda f: _apart(f, time_us), default=None)


def _apart(f: Fall, time_us: int) -> int:
    return max(f.begin_us - time_us, time_us - f.end_us, 0)


def around(story: Story, axle: int, time_us: int) -> tuple[Explanation, Explanation, Fall | None]:
    """How it was before and after what changed around a moment, and the change: a fall near to it, else the time not
    Valid that it lies in, else a second to either side."""
    fall = _nearest_fall(story, axle, time_us)
    runs = not_valid_runs(find_axle(story, axle))
    outage = next((run for run in runs if run[0].begin_us <= time_us <= run[-1].end_us), None)
    if fall is not None:
        before_us, after_us = fall.begin_us, fall.end_us + SETTLED_US
    elif outage is not None:
        before_us, after_us = outage[0].begin_us - 1, outage[-1].end_us + SETTLED_US
    else:
        before_us, after_us = time_us - WITHOUT_CHANGE_US, time_us + WITHOUT_CHANGE_US
    before = explain(story, axle, max(before_us, story.begin_us))
    return before, explain(story, axle, min(after_us, story.end_us)), fall


def answer(story: Story, axle: int, time_us: int, width: int = WIDTH) -> list[str]:
    """Lines for a person, about twenty at most."""
    now = explain(story, axle, time_us)
    before, after, fall = around(story, axle, time_us)
    lines = [_head(story, now)]
    for label, text in _parts(story, now, before, after, fall):
        first, rest = f"  {label:<{LABEL}}", " " * (LABEL + 2)
        lines += textwrap.wrap(text, width, initial_indent=first, subsequent_indent=rest, break_on_hyphens=False)
    return lines


def _head(story: Story, now: Explanation) -> str:
    e = now.event
    state = f"{now.validity.value}{f', {name(e)}' if e is not None and e.validity is not Validity.VALID else ''}"
    lasted = "" if e is None else f" from {_s(story, e.begin_us)} to {_s(story, e.end_us)} s ({seconds(e.duration_s)})"
    return f"Axle {now.axle} at {_s(story, now.time_us)} s ({now.time_us * 1e-6:.3f}): {state}{lasted}"


def _parts(
    story: Story, now: Explanation, before: Explanation, after: Explanation, fall: Fall | None
) -> Iterator[tuple[str, str]]:
    if now.why:
        yield "why", now.why
    yield "said", _said(now)
    if math.isfinite(now.truth_available_pct):
        yield "truth", f"{percent(now.truth_available_pct)} % available, {percent(now.truth_used_pct)} % in use"
    if fall is None:
        yield "change", f"none that lasts within {NEAR_US * 1e-6:.0f} s of it"
    else:
        text = f"available adhesion {fall.verb} from {percent(fall.before_pct)} to {percent(fall.after_pct)} %"
        when = f"between {_s(story, fall.begin_us)} and {_s(story, fall.end_us)} s"
        yield "change", f"{text} {when}, within {seconds((fall.end_us - fall.begin_us) * 1e-6)}"
    if changed := _changed(before, after):
        yield "", changed
    yield from _moment(story, "before", before)
    told = find_axle(story, now.axle).detail is not None
    if told and after.rule == before.rule and after.winner == before.winner:
        yield "after", f"at {_s(story, after.time_us)} s: {_numbers(after)}; the same model and rule"
    else:
        yield from _moment(story, "after", after, before.rule)
    yield "Validity", _validity(story, now.axle, before.time_us, after.time_us)
    yield "refused", _refused(story, now.axle, now.time_us) or f"nothing within {REJECTS_NEAR_US * 1e-6:.0f} s"
    yield "source", story.source


def _said(x: Explanation) -> str:
    if not math.isfinite(x.available_pct):
        said = "no available adhesion"
    else:
        bounds = f" ({percent(x.low_pct)} to {percent(x.high_pct)})" if math.isfinite(x.low_pct) else " (no bound)"
        said = f"{percent(x.available_pct)} % available{bounds}"
    used = f", {percent(x.used_pct)} % in use" if math.isfinite(x.used_pct) else ""
    rest = [w for w in (x.contact, x.surface) if w and w != "Unknown"]
    if x.plausibility not in ("", "Unknown", "Consistent", x.contact):
        rest.append(x.plausibility)
    age = f"; oldest measurement {x.age_ms:.0f} ms{' or more' * (x.age_ms >= 255)}" if math.isfinite(x.age_ms) else ""
    return f"{said}{used}{''.join(f', {w}' for w in rest)}{age}"


def _moment(story: Story, label: str, x: Explanation, told: int = 0) -> Iterator[tuple[str, str]]:
    """told: the rule whose sentence stands there already."""
    yield label, f"at {_s(story, x.time_us)} s: {_said(x)}"
    if find_axle(story, x.axle).detail is None:
        yield "", f"model and rule are not known: {_without_detail(story, x.axle)}; {_motion(x)}"
        return
    model = f"model {x.winner} fits best: {x.model}; " if x.winner else "no model fits; "
    yield "", model + _numbers(x)
    if not x.rule:
        yield "", "no rule fires"
    else:
        yield "", f"rule {x.rule}, as before" if x.rule == told else f"rule {x.rule}: {shortened(x.rule_sentence)}"


def _without_detail(story: Story, axle: int) -> str:
    """Why frames of the log have no AdhesionDetail of an axle, and where its causes are to be had."""
    sends = any(a.number == axle and a.detail is not None for a in story.config.axles)
    reason = "the log has no AdhesionDetail" if sends else "the configuration sends no AdhesionDetail"
    return reason if story.source == ESTIMATED else f"{reason}; --replay estimates them"


def shortened(rule: str) -> str:
    """A rule's sentence with the MAX_MOVES largest of what moves its output."""
    head, _, tail = rule.removesuffix(".").partition("; ")
    moves = _BETWEEN_MOVES.split(tail) if tail else []
    largest = sorted(moves, key=lambda move: -abs(float(move.split()[0])))[:MAX_MOVES]
    kept = [move for move in moves if move in largest]
    more = f" and {len(moves) - len(kept)} more" if len(moves) > len(kept) else ""
    return head + (f"; {', '.join(kept)}{more}" if kept else "")


def _numbers(x: Explanation) -> str:
    residuals = ", ".join(f"{r:.1f}" if math.isfinite(r) else "-" for r in x.residual_db)
    return f"residuals {residuals} dB; {_motion(x)}"


def _motion(x: Explanation) -> str:
    torque = f"{x.torque_Nm / 1000:.1f} kN\u00a0m" if math.isfinite(x.torque_Nm) else "not known"
    speed = f"{x.speed_m_s:.1f} m/s" if math.isfinite(x.speed_m_s) else "not known"
    return f"torque {torque}; speed {speed}"


def _changed(before: Explanation, after: Explanation) -> str:
    """What differs most between two moments."""
    parts = []
    if before.winner != after.winner and before.winner and after.winner:
        parts.append(f"the model that fits best went from {before.winner} to {after.winner}")
    steps = [
        (b - a, m) for m, (a, b) in enumerate(zip(before.residual_db, after.residual_db, strict=True), 1)
        if math.isfinite(a) and math.isfinite(b)
    ]  # fmt: skip
    if steps:
        step, m = max(steps, key=lambda s: abs(s[0]))
        if abs(step) >= 1.0:
            parts.append(f"residual {m} moved most, by {step:+.1f} dB")
    for what, a, b, unit in (
        ("torque", before.torque_Nm / 1000, after.torque_Nm / 1000, "kN\u00a0m"),
        ("speed", before.speed_m_s, after.speed_m_s, "m/s"),
    ):
        if math.isfinite(a) and math.isfinite(b) and abs(b - a) >= MIN_CHANGE:
            parts.append(f"{what} went from {a:.1f} to {b:.1f} {unit}")
    return "; ".join(parts)


def _validity(story: Story, axle: int, begin_us: int, end_us: int) -> str:
    """The states from one moment to the other, with their causes."""
    events = _events(story, axle, begin_us, end_us)
    shown = events[:MAX_EVENTS]
    text = "; ".join(_state(story, e) for e in shown)
    return text + (f"; {len(events) - len(shown)} more" if len(events) > len(shown) else "")


def _events(story: Story, axle: int, begin_us: int, end_us: int) -> list[Event]:
    return [e for e in find_axle(story, axle).events if e.end_us > begin_us and e.begin_us <= end_us]


def _state(story: Story, e: Event) -> str:
    cause = "" if e.validity is Validity.VALID else f" ({name(e)})"
    return f"{e.validity.value}{cause} from {_s(story, e.begin_us)} s"


def _refused(story: Story, axle: int, time_us: int) -> str:
    """Why frames of the axle's inputs were refused near a moment."""
    h = find_axle(story, axle).health
    if h is None:
        return ""
    rows = slice(*np.searchsorted(h.time_us, (time_us - REJECTS_NEAR_US, time_us + REJECTS_NEAR_US)))
    parts = []
    for q, input_name in enumerate(INPUT_NAMES):
        words = [REASONS[k] for k in np.unique(h.refused[rows, q]).tolist() if k > 0]
        if words:
            parts.append(f"{input_name}: {', '.join(words)}")
    return "; ".join(parts)


def _s(story: Story, time_us: int) -> str:
    return f"{(time_us - story.begin_us) * 1e-6:.3f}"


def record(story: Story, axle: int, time_us: int) -> dict[str, Any]:
    """The same for a program. A number that there is none of is null."""
    before, after, fall = around(story, axle, time_us)
    change = None if fall is None else {
        "begin_s": _seconds(story, fall.begin_us), "end_s": _seconds(story, fall.end_us),
        "before_pct": _rounded(fall.before_pct), "after_pct": _rounded(fall.after_pct),
    }  # fmt: skip
    events = [_event(story, e) for e in _events(story, axle, before.time_us, after.time_us)]
    return {
        "axle": axle, "now": _plain(story, explain(story, axle, time_us)), "change": change,
        "before": _plain(story, before), "after": _plain(story, after), "events": events,
        "refused": _refused(story, axle, time_us),
    }  # fmt: skip


def _plain(story: Story, x: Explanation) -> dict[str, Any]:
    out: dict[str, Any] = {"time_s": _seconds(story, x.time_us)}
    for key, value in asdict(x).items():
        if key in ("axle", "time_us", "event"):
            continue
        if isinstance(value, float):
            out[key] = _rounded(value)
        elif key == "residual_db":
            out[key] = [_rounded(r) for r in value]
        else:
            out[key] = value.value if isinstance(value, Validity) else value
    out["event"] = None if x.event is None else _event(story, x.event)
    return out


def _event(story: Story, e: Event) -> dict[str, Any]:
    return {
        "begin_s": _seconds(story, e.begin_us), "end_s": _seconds(story, e.end_us), "validity": e.validity.value,
        "cause": e.cause.label if e.cause else "", "words": e.cause.words, "detail": e.detail,
    }  # fmt: skip


def _seconds(story: Story, time_us: int) -> float:
    return round((time_us - story.begin_us) * 1e-6, 6)


def _rounded(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
