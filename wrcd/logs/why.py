"""Why an axle was as it was at a moment: its state, what changed around it, and what decided before and after. For
report, `wrcd why` and monitor."""

import math
import re
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from wrcd.core.causes import OF_SENDER, OF_SENSOR, Cause, Validity
from wrcd.core.vocabulary import MESSAGES, words_of
from wrcd.errors import InputError
from wrcd.logs.rule_sentences import CORRECTED, model_words, rule_words
from wrcd.logs.story import ESTIMATED
from wrcd.logs.story_events import INPUT_NAMES, NO_FRAME, REASONS, STALE_AFTER, VALIDITIES
from wrcd.logs.story_records import Event, Fall, Series, Story, newest, percent, seconds

NEAR_US = 10_000_000  # a change further away is not what was asked about
REJECTS_NEAR_US = 2_000_000
WITHOUT_CHANGE_US = 1_000_000  # before and after a moment that no change is near to
SETTLED_US = 300_000  # after a change: AdhesionDetail has come since
WIDTH, LABEL = 110, 10
MIN_CHANGE = 0.5  # of torque in kN m and speed in m/s
MAX_EVENTS = 5
MAX_MOVES = 3  # of a rule's output: `--json` has all
_BETWEEN_MOVES = re.compile(r", (?=[+-]\d)")
DETAIL_MAX_AGE_US = 300_000  # three cycles, as a receiver holds to
INPUT_MAX_AGE_US = 1_000_000


# causes that blame an input, or a value that it gives
OF_INPUT = (*OF_SENSOR, *OF_SENDER, Cause.CONTRADICTION, Cause.LOAD_BEYOND, Cause.RADIUS_BEYOND)
CONTACTS, SURFACES = words_of("adhesion", "ContactState"), words_of("adhesion", "Surface")
CONFIDENCES, PLAUSIBILITIES = words_of("adhesion", "Confidence"), words_of("inputs", "Plausibility")


@dataclass(frozen=True, slots=True)
class Explanation:
    """An axle at a time. A number that there is none of is NaN, a text ""."""

    axle: int
    time_us: int
    validity: Validity  # of the newest Adhesion frame; NotAvailable past its time-out
    available_pct: float
    low_pct: float
    high_pct: float
    used_pct: float
    age_ms: float
    confidence: str
    contact: str
    surface: str
    event: Event | None  # that the moment lies in: since when, for how long, its cause
    why: str  # the cause in words with its figures; "" of a Valid one
    winner: int  # model from 1, 0: none
    model: str  # the same in words
    rule: int  # from 1, 0: none
    rule_sentence: str
    residual_db: tuple[float, float, float, float]
    stale: tuple[str, ...]  # inputs past their time-out
    refused: tuple[str, ...]  # inputs and the reason of their newest refused frame
    plausibility: str
    torque_Nm: float
    speed_m_s: float
    distance_m: float
    truth_available_pct: float
    truth_used_pct: float
    own_pct: float  # what it says alone, and its interval
    own_half_width_pp: float
    axles_fused: float  # that stand behind its adhesion
    most_used_pct: float  # of them and it
    most_used_axle: float


def first_fall(story: Story) -> int:
    """Return when the estimate first fell, of any axle. Raises InputError where it never did."""
    found = next((fall.end_us for fall in story.falls if fall.is_down), None)
    if found is None:
        raise InputError("has no fall of the estimate", file=story.log, hint="give SECONDS")
    return found


def explain(story: Story, axle_number: int, time_us: int) -> Explanation:
    """Explain an axle at a time. Raises InputError for an axle that the story has not."""
    axle, design = story.axle(axle_number), story.config.design
    a = axle.adhesion
    cycle_us = next(x.adhesion.cycle_us for x in story.config.axles if x.number == axle_number)
    event = axle.event_at(time_us)
    silent = event is not None and not event.cause and (event.is_gap or event.detail == NO_FRAME)
    row = None if silent else newest(a.time_us, time_us, STALE_AFTER * cycle_us)
    d, h, t = axle.detail, axle.health, axle.truth
    shown = None if d is None else newest(d.time_us, time_us, DETAIL_MAX_AGE_US)
    checked = None if h is None else newest(h.time_us, time_us, DETAIL_MAX_AGE_US)
    true = None if t is None else newest(t.time_us, time_us, DETAIL_MAX_AGE_US)
    winner = int(d.winner[shown]) if d is not None and shown is not None else 0
    rule = int(d.rule[shown]) if d is not None and shown is not None else 0
    residual = d.residual_db[shown].tolist() if d is not None and shown is not None else [math.nan] * 4

    def number(column: "np.ndarray[tuple[int], np.dtype[np.float32]]", place: int | None = row) -> float:
        return math.nan if place is None else float(column[place])

    def word(words: tuple[str, ...], column: "np.ndarray[tuple[int], np.dtype[np.int8]]", place: int | None) -> str:
        return words[int(column[place])] if place is not None and column[place] >= 0 else ""

    stated = None if row is None or a.validity[row] < 0 else int(a.validity[row])
    return Explanation(
        axle_number, time_us,
        Validity.NOT_AVAILABLE if stated is None else VALIDITIES[stated],
        number(a.available_pct), number(a.low_pct), number(a.high_pct), number(a.used_pct), number(a.age_ms),
        word(CONFIDENCES, a.confidence, row), word(CONTACTS, a.contact, row), word(SURFACES, a.surface, row),
        event, "" if event is None or event.validity is Validity.VALID else event.because,
        winner, model_words(design, winner), rule, rule_words(design, rule),
        (residual[0], residual[1], residual[2], residual[3]),
        () if d is None or shown is None else tuple(
            name for name, is_stale in zip(INPUT_NAMES, d.stale[shown], strict=True) if is_stale
        ),
        () if h is None or checked is None else tuple(
            f"{name}: {REASONS[place]}"
            for name, place in zip(INPUT_NAMES, h.refused[checked].tolist(), strict=True) if place > 0
        ),
        "" if h is None else word(PLAUSIBILITIES, h.plausibility, checked),
        _value(story.torque.get(axle_number), "torque_Nm", time_us),
        _value(story.speed, "speed_m_s", time_us),
        _value(story.distance, "distance_m", time_us),
        math.nan if t is None else number(t.available_pct, true),
        math.nan if t is None else number(t.used_pct, true),
        *(_value(axle.own, name, time_us, DETAIL_MAX_AGE_US) for name in MESSAGES["own"]),
    )  # fmt: skip


def _value(series: Series | None, name: str, at_us: int, max_age_us: int = INPUT_MAX_AGE_US) -> float:
    return math.nan if series is None else series.at(name, at_us, max_age_us)


def moment(story: Story, given_s: float, *, key: str = "SECONDS", behind: bool = False) -> int:
    """Seconds since 1970 where that lies within the log, else since its first frame, in microseconds. Raises InputError
    for a time outside of the log; behind: one behind its end is none.
    """
    absolute = round(given_s * 1e6)
    if story.begin_us <= absolute <= story.end_us:
        return absolute
    time_us = story.begin_us + absolute
    if story.begin_us <= time_us and (behind or time_us <= story.end_us):
        return time_us
    raise InputError(
        f"{given_s:g} s is not within the log", file=story.log, key=key,
        hint=f"it has 0 to {(story.end_us - story.begin_us) * 1e-6:.3f} s after its first frame, or "
        f"{story.begin_us * 1e-6:.3f} to {story.end_us * 1e-6:.3f} since 1970",
    )  # fmt: skip


def _apart(f: Fall, time_us: int) -> int:
    return max(f.begin_us - time_us, time_us - f.end_us, 0)


def around(story: Story, axle: int, time_us: int) -> tuple[Explanation, Explanation, Fall | None]:
    """How it was before and after what changed around a moment, and the change: a fall near to it, else the time not
    Valid that it lies in, else a second to either side."""
    near = [f for f in story.falls if f.axle == axle and _apart(f, time_us) <= NEAR_US]
    fall = min(near, key=lambda f: _apart(f, time_us), default=None)
    runs = story.axle(axle).not_valid_runs()
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
    e, state = now.event, now.validity.value
    # frames come less often than states change: the newest may have been sent in the state before this one
    if e is not None and e.validity is now.validity:
        cause = "" if e.validity is Validity.VALID else f", {e.name}"
        state += f"{cause} from {_s(story, e.begin_us)} to {_s(story, e.end_us)} s ({seconds(e.duration_s)})"
    return f"Axle {now.axle} at {_s(story, now.time_us)} s ({now.time_us * 1e-6:.3f}): {state}"


def _parts(
    story: Story, now: Explanation, before: Explanation, after: Explanation, fall: Fall | None
) -> Iterator[tuple[str, str]]:
    if now.why:
        yield "why", now.why
    yield "estimate", _estimate(now)
    if math.isfinite(now.own_pct):
        yield "alone", _alone(now)
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
    if story.axle(now.axle).detail is not None and after.rule == before.rule and after.winner == before.winner:
        yield "after", f"at {_s(story, after.time_us)} s: {_numbers(after)}; the same model and rule"
    else:
        yield from _moment(story, "after", after, before.rule)
    yield "Validity", _validity(story, now.axle, before.time_us, after.time_us)
    yield "inputs", _inputs(story, now.axle, now.time_us)
    yield "source", story.source


def _estimate(x: Explanation) -> str:
    if not math.isfinite(x.available_pct):
        text = "no available adhesion"
    else:
        bounds = f" ({percent(x.low_pct)} to {percent(x.high_pct)})" if math.isfinite(x.low_pct) else " (no interval)"
        text = f"{percent(x.available_pct)} % available{bounds}"
    used = f", {percent(x.used_pct)} % in use" if math.isfinite(x.used_pct) else ""
    rest = [w for w in (x.contact, x.surface) if w and w != "Unknown"]
    if x.plausibility not in ("", "Unknown", "Consistent", x.contact):
        rest.append(x.plausibility)
    age = f"; oldest measurement {x.age_ms:.0f} ms{' or more' * (x.age_ms >= 255)}" if math.isfinite(x.age_ms) else ""
    return f"{text}{used}{''.join(f', {w}' for w in rest)}{age}"


def _alone(x: Explanation) -> str:
    width = f" (± {percent(x.own_half_width_pp)})" if math.isfinite(x.own_half_width_pp) else ""
    alone = f"{percent(x.own_pct)} %{width}"
    if x.axles_fused < 2.0:
        return f"{alone}: no other axle stands behind the estimate"
    fused = f"; {x.axles_fused:.0f} axles on this rail stand behind the estimate" if x.axles_fused >= 2.0 else ""
    most = f"; axle {x.most_used_axle:.0f} uses most, {percent(x.most_used_pct)} %" if x.most_used_axle >= 1.0 else ""
    return alone + fused + most


def _moment(story: Story, label: str, x: Explanation, shown: int = 0) -> Iterator[tuple[str, str]]:
    """shown: the rule whose sentence stands there already."""
    yield label, f"at {_s(story, x.time_us)} s: {_estimate(x)}"
    if story.axle(x.axle).detail is None:
        yield "", f"model and rule are not known: {_without_detail(story, x.axle)}; {_motion(x)}"
        return
    model = f"model {x.winner} fits best: {x.model}; " if x.winner else "no model fits; "
    yield "", model + _numbers(x)
    if not x.rule:
        yield "", "no rule fires"
    else:
        yield "", f"rule {x.rule}, as before" if x.rule == shown else f"rule {x.rule}: {shortened(x.rule_sentence)}"


def _without_detail(story: Story, axle: int) -> str:
    """Why frames of the log have no AdhesionDetail of an axle, and where its causes are to be had."""
    sends = any(a.number == axle and a.detail is not None for a in story.config.axles)
    reason = "the log has no AdhesionDetail" if sends else "the configuration sends no AdhesionDetail"
    return reason if story.source == ESTIMATED else f"{reason}; --replay estimates them"


def shortened(rule: str) -> str:
    """A rule's sentence with the MAX_MOVES largest of what moves its output."""
    head, _, tail = rule.removesuffix(".").partition(CORRECTED)
    moves = _BETWEEN_MOVES.split(tail) if tail else []
    largest = sorted(moves, key=lambda move: -abs(float(move.split()[0])))[:MAX_MOVES]
    kept = [move for move in moves if move in largest]
    more = f" and {len(moves) - len(kept)} more" if len(moves) > len(kept) else ""
    return head + (f"{CORRECTED}{', '.join(kept)}{more}" if kept else "")


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
    return [e for e in story.axle(axle).events if e.end_us > begin_us and e.begin_us <= end_us]


def _state(story: Story, e: Event) -> str:
    cause = "" if e.validity is Validity.VALID else f" ({e.name})"
    return f"{e.validity.value}{cause} from {_s(story, e.begin_us)} s"


def _inputs(story: Story, axle: int, time_us: int) -> str:
    """Whether an input may be why, or the rail: what was refused, stale or blamed near the moment."""
    begin_us, end_us = time_us - REJECTS_NEAR_US, time_us + REJECTS_NEAR_US
    health, detail = story.axle(axle).health, story.axle(axle).detail
    heard, shown = (
        slice(0, 0) if record is None else slice(*np.searchsorted(record.time_us, (begin_us, end_us)).tolist())
        for record in (health, detail)
    )
    blamed = [e.name for e in _events(story, axle, begin_us, end_us) if e.cause in OF_INPUT]
    stale = [] if detail is None else [q for q in range(len(INPUT_NAMES)) if detail.stale[shown, q].any()]
    found = {
        "refused": _refused(story, axle, time_us),
        "stale": ", ".join(INPUT_NAMES[q] for q in stale),
        "blamed": ", ".join(dict.fromkeys(blamed)),
    }
    parts = [f"{what} {which}" for what, which in found.items() if which]
    near = f"within {REJECTS_NEAR_US * 1e-6:.0f} s"
    parts += [
        f"no {name} {near}"
        for name, rows in (("InputHealth", heard), ("AdhesionDetail", shown))
        if rows.start == rows.stop
    ]
    return "; ".join(parts) or f"none refused, stale or blamed {near}: nothing points to an input"


def _refused(story: Story, axle: int, time_us: int) -> str:
    """Why frames of the axle's inputs were refused near a moment."""
    h = story.axle(axle).health
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
