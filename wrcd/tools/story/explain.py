"""An axle at a moment of a story: what was said, and why. Report, `wrcd why` and monitor use the same texts."""

import math
from dataclasses import dataclass

import numpy as np

from wrcd.core.causes import Validity
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.errors import InputError
from wrcd.estimator.design import Design
from wrcd.tools.explain import sentence
from wrcd.tools.story.events import INPUT_NAMES, NO_FRAME, REASONS, STALE_AFTER, VALIDITIES
from wrcd.tools.story.records import Axle, Event, Series, Story, Times
from wrcd.tools.story.words import because

DETAIL_MAX_AGE_US = 300_000  # three cycles, as a receiver holds to
INPUT_MAX_AGE_US = 1_000_000


def _words(message: str, name: str) -> tuple[str, ...]:
    found = MESSAGES[message][name]
    assert isinstance(found, Words)
    return found.words


CONTACTS, SURFACES = _words("adhesion", "ContactState"), _words("adhesion", "Surface")
CONFIDENCES, PLAUSIBILITIES = _words("adhesion", "Confidence"), _words("inputs", "Plausibility")


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


def find_axle(story: Story, number: int) -> Axle:
    """An axle by its number. Raises InputError for one that the story has not."""
    for axle in story.axles:
        if axle.number == number:
            return axle
    shown = ", ".join(str(a.number) for a in story.axles) or "none"
    raise InputError(f"the log tells nothing of axle {number}", key="--axle", hint=f"it has {shown}")


def newest(time_us: Times, at_us: int, max_age_us: int) -> int | None:
    """The place of the newest of some times at or before a time, None if it is older than that."""
    place = int(np.searchsorted(time_us, at_us, side="right")) - 1
    return place if place >= 0 and at_us - int(time_us[place]) <= max_age_us else None


def value_at(series: Series | None, name: str, at_us: int, max_age_us: int = INPUT_MAX_AGE_US) -> float:
    """A value of a series at a time, NaN if there is none. What comes of a constant holds, or grows, all along."""
    if series is None or name not in series.values:
        return math.nan
    if series.constant:
        return float(np.interp(at_us, series.time_us, series.values[name]))
    place = newest(series.time_us, at_us, max_age_us)
    return math.nan if place is None else float(series.values[name][place])


def model_words(design: Design, winner: int) -> str:
    """A winning model in words, "" for none."""
    return design.model_names[winner - 1] if 1 <= winner <= len(design.model_names) else ""


def rule_words(design: Design, rule: int) -> str:
    """A rule by its number as a sentence, "" for none."""
    return sentence(design, rule - 1) if 1 <= rule <= len(design.rules) else ""


def event_at(axle: Axle, time_us: int) -> Event | None:
    """The event that a moment lies in."""
    found = [e for e in axle.events if e.begin_us <= time_us < e.end_us]
    if found:
        return found[-1]
    return axle.events[-1] if axle.events and time_us == axle.events[-1].end_us else None


def explain(story: Story, axle_number: int, time_us: int) -> Explanation:
    """Explain an axle at a time. Raises InputError for an axle that the story has not."""
    axle, design = find_axle(story, axle_number), story.config.design
    a = axle.adhesion
    cycle_us = next(x.adhesion.cycle_us for x in story.config.axles if x.number == axle_number)
    event = event_at(axle, time_us)
    silent = event is not None and not event.cause and event.detail == NO_FRAME
    row = None if silent else newest(a.time_us, time_us, STALE_AFTER * cycle_us)
    d, h, t = axle.detail, axle.health, axle.truth
    told = None if d is None else newest(d.time_us, time_us, DETAIL_MAX_AGE_US)
    heard = None if h is None else newest(h.time_us, time_us, DETAIL_MAX_AGE_US)
    true = None if t is None else newest(t.time_us, time_us, DETAIL_MAX_AGE_US)
    winner = int(d.winner[told]) if d is not None and told is not None else 0
    rule = int(d.rule[told]) if d is not None and told is not None else 0
    residual = d.residual_db[told].tolist() if d is not None and told is not None else [math.nan] * 4

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
        event, "" if event is None or event.validity is Validity.VALID else because(event),
        winner, model_words(design, winner), rule, rule_words(design, rule),
        (residual[0], residual[1], residual[2], residual[3]),
        () if d is None or told is None else _named(d.stale[told].tolist()),
        () if h is None or heard is None else tuple(
            f"{name}: {REASONS[place]}"
            for name, place in zip(INPUT_NAMES, h.refused[heard].tolist(), strict=True) if place > 0
        ),
        "" if h is None else word(PLAUSIBILITIES, h.plausibility, heard),
        value_at(story.torque.get(axle_number), "torque_Nm", time_us),
        value_at(story.speed, "speed_m_s", time_us),
        value_at(story.distance, "distance_m", time_us),
        math.nan if t is None else number(t.available_pct, true),
        math.nan if t is None else number(t.used_pct, true),
    )  # fmt: skip


def _named(flags: list[bool]) -> tuple[str, ...]:
    return tuple(name for name, flag in zip(INPUT_NAMES, flags, strict=True) if flag)
