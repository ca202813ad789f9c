"""An axle at a moment of a story, and the rules that decided, in words: for report, `wrcd why` and monitor."""

import math
from dataclasses import dataclass

import numpy as np

from wrcd.core.causes import Validity
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.errors import InputError
from wrcd.estimator.design import MODELS, Design
from wrcd.estimator.window import LAG
from wrcd.logs.story_events import INPUT_NAMES, NO_FRAME, REASONS, STALE_AFTER, VALIDITIES
from wrcd.logs.story_records import Event, Series, Story, StoryAxle, Times, because

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


def find_axle(story: Story, number: int) -> StoryAxle:
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


def event_at(axle: StoryAxle, time_us: int) -> Event | None:
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


@dataclass(frozen=True, slots=True)
class Column:
    """One of what the rules' outputs move with."""

    name: str
    correlation: bool = False


COLUMN_WORDS = (
    *(Column(f"residual {m + 1}") for m in range(MODELS)),
    Column("torque"),
    Column("speed"),
    *(
        Column(f"{what} persistence {m + 1}", True)
        for m in range(MODELS)
        for what in ("yaw rate", "lateral acceleration")
    ),
    *(Column(f"coupling {m + 1}", True) for m in range(MODELS)),
    Column("window length"),
    Column("yaw rate noise"),
    Column("lateral acceleration noise"),
    Column("the highest torque of half a second over that of the moment"),
    Column("the torque of the moment over the lowest of half a second"),
    Column("the step of residuals 1 and 2"),
    Column("the step of residual 3"),
    Column("the step of residual 4"),
    Column("the largest step, up or down"),
)
GLOSSARY = (
    f"persistence m: correlation of model m's innovation with itself {LAG} ticks before. Near 1 it is slow: "
    "the model misses a slow motion, such as hunting. Near 0 or below it is fast: the model misses the yaw spring.",
    "coupling m: correlation of model m's two innovations. Away from 0, yaw and lateral motion that the track drives "
    "together are missed together: the model's contact is not the present one.",
    "step: a residual of the newest part over that of the half second before, unfiltered. A drop of adhesion makes one "
    "and stays; a slip cycle comes back.",
)

MIN_SHARE = 0.15  # slopes smaller than this share of a rule's largest are left out of its sentence


def condition(design: Design, rule: int) -> str:
    """When a rule (from 0) speaks: "residual 1 Low, …, torque T_3, Fast"."""
    names = [s.names[k] for s, k in zip(design.sets, design.rules[rule], strict=True)]
    parts = [*(f"residual {m + 1} {names[m]}" for m in range(MODELS)), f"torque {names[MODELS]}"]
    return ", ".join(parts if len(design.speed_sets.names) == 1 else [*parts, names[MODELS + 1]])


def says(design: Design, rule: int) -> str:
    """What it says: the output in the middle of its sets with the adhesion it stands for, and what moves it."""
    base = float(design.bases[rule])
    mu = float(np.clip(np.polyval(design.polynomial, np.clip(base, 0.0, 100.0)), *design.adhesion_range_pct))
    if design.consequents:
        return f"{design.consequents[rule]} (output {base:.0f}, adhesion {mu:.1f} %)"
    slopes = design.slopes[rule]
    # per doubling, which a person can picture, not per decade; of a correlation per 0.1
    steps = np.array([0.1 if c.correlation else math.log10(2.0) for c in COLUMN_WORDS])
    moves = [
        f"{move:+.0f} per {'0.1' if c.correlation else 'doubling'} of {c.name}"
        for move, c in zip(slopes * steps, COLUMN_WORDS, strict=True)
        if abs(move) >= MIN_SHARE * np.abs(slopes * steps).max(initial=0.0) and abs(move) >= 0.5
    ]
    return f"output {base:.0f} (adhesion {mu:.1f} %)" + (f"; {', '.join(moves)}" if moves else "")


def sentence(design: Design, rule: int) -> str:
    """A rule as a sentence."""
    return f"If {condition(design, rule)}, then {says(design, rule)}."


def bounds(design: Design) -> list[str]:
    """What the names of the sets mean: the middle of each in the input's own unit."""
    if design.form == "paper":
        residuals = [(f"residual {m + 1}, in the sensors' noise", s) for m, s in enumerate(design.residual_sets)]
    else:
        residuals = [(f"residual {m + 1}, over residual {MODELS}", s) for m, s in enumerate(design.residual_sets[:-1])]
        residuals.append((f"residual {MODELS}, times what model {MODELS} expects", design.residual_sets[-1]))
    inputs = [*residuals, ("torque, as adhesion in use, %", design.torque_sets)]
    if len(design.speed_sets.names) > 1:
        inputs.append(("speed, m/s", design.speed_sets))
    lines = []
    for what, sets in inputs:
        unit = 100.0 if sets is design.torque_sets else 1.0
        parts = ", ".join(f"{n} about {unit * 10**c:.3g}" for n, c in zip(sets.names, sets.centres, strict=True))
        lines.append(f"{what}: {parts}")
    return lines
