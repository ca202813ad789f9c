"""The states of an axle over a log, each with its cause: from its frames, or from the core's own changes."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Cause, Validity
from wrcd.core.events import Change
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.tools.story.records import Adhesion, Detail, Event, Health, Places, Times

_WORDS = MESSAGES["adhesion"]["Validity"]
assert isinstance(_WORDS, Words)
VALIDITIES = tuple(Validity(word) for word in _WORDS.words)  # by place
VALID_PLACE = VALIDITIES.index(Validity.VALID)
_REASON_WORDS = MESSAGES["inputs"]["RefusedSpeed"]
assert isinstance(_REASON_WORDS, Words)
REASONS = _REASON_WORDS.words
STALE_AFTER = 3  # cycles without a frame: a receiver does not hold the value any longer
INPUT_NAMES = ("yaw rate", "lateral acceleration", "torque", "speed")
NO_FRAME = "no frame of wrcd"
CAUSES = {int(c): c for c in Cause}


def of_frames(
    axle: int, adhesion: Adhesion, detail: Detail | None, health: Health | None, cycle_us: int,
    begin_us: int, end_us: int,
) -> tuple[Event, ...]:  # fmt: skip
    """Events of an axle as its frames say, from begin_us to end_us without a gap.

    A Validity is that of the Adhesion frames. Its cause is the one that AdhesionDetail says at or first after it, while
    the state lasts; where the state is shorter than that, there is none. Where frames fail to come for longer than
    three cycles, the axle is NotAvailable to whoever listens: an event of its own.
    """
    time_us = adhesion.time_us
    causes = _causes(adhesion, detail)
    gaps = np.diff(time_us) > STALE_AFTER * cycle_us
    changed = (np.diff(adhesion.validity) != 0) | (np.diff(causes) != 0) | gaps
    first = np.concatenate(([0], np.flatnonzero(changed) + 1))
    last = np.concatenate((first[1:] - 1, [len(time_us) - 1]))
    out: list[Event] = []
    if time_us[0] - begin_us > STALE_AFTER * cycle_us:
        out.append(Event(axle, begin_us, int(time_us[0]), Validity.NOT_AVAILABLE, Cause.NONE, NO_FRAME))
    for i, (a, b) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        start = int(time_us[a]) if out or i else begin_us
        next_us = int(time_us[b + 1]) if b + 1 < len(time_us) else end_us
        silent = next_us - int(time_us[b]) > STALE_AFTER * cycle_us
        stop = int(time_us[b]) + STALE_AFTER * cycle_us if silent else next_us
        place = int(adhesion.validity[a])
        validity = VALIDITIES[place] if place >= 0 else Validity.NOT_AVAILABLE
        cause = CAUSES.get(int(causes[a]), Cause.NONE)
        out.append(Event(axle, start, stop, validity, cause, _described(cause, start, stop, detail, health)))
        if silent:
            out.append(Event(axle, stop, next_us, Validity.NOT_AVAILABLE, Cause.NONE, NO_FRAME))
    return tuple(e for e in out if e.end_us > e.begin_us)


def _causes(adhesion: Adhesion, detail: Detail | None) -> Places:
    """The cause of each Adhesion frame, 0 while it is Valid or where AdhesionDetail does not tell."""
    none = np.zeros(len(adhesion.time_us), dtype=np.int8)
    if detail is None or not len(detail.time_us):
        return none
    # a state is a run of one Validity: only what is said while it lasts is said of it
    run = np.concatenate(([0], np.cumsum(np.diff(adhesion.validity) != 0)))
    heard = np.searchsorted(adhesion.time_us, detail.time_us, side="right") - 1  # frame that each detail goes with
    usable = heard >= 0
    run_of_detail = np.where(usable, run[heard.clip(0)], -1)
    following = np.searchsorted(detail.time_us, adhesion.time_us, side="left")
    at = following.clip(0, len(detail.time_us) - 1)
    before = (following - 1).clip(0)
    same = (run_of_detail[at] == run) & (following < len(detail.time_us))
    same_before = (run_of_detail[before] == run) & (following > 0)
    causes = np.where(same, detail.cause[at], np.where(same_before, detail.cause[before], 0))
    return np.where((adhesion.validity == VALID_PLACE) | (causes < 0), none, causes).astype(np.int8)


def _described(cause: Cause, begin_us: int, end_us: int, detail: Detail | None, health: Health | None) -> str:
    """What the frames say of the inputs while an event lasts: those that are stale, and why frames were refused."""
    if cause not in (Cause.INPUT_STALE, Cause.INPUT_SILENT, Cause.TWO_SENDERS, Cause.UNCHANGED, Cause.WARMING_UP):
        return ""
    stale: NDArray[np.bool_] = np.zeros(4, dtype=bool)
    if detail is not None and cause in (Cause.INPUT_STALE, Cause.INPUT_SILENT):
        a, b = np.searchsorted(detail.time_us, (begin_us, end_us + 1))
        stale = np.logical_or.reduce(detail.stale[a:b], axis=0)
    refused: list[str] = [""] * 4
    if health is not None:
        a, b = np.searchsorted(health.time_us, (begin_us, end_us + 100_001))
        for q in range(4):
            words = [REASONS[k] for k in np.unique(health.refused[a:b, q]).tolist() if k > 0]
            refused[q] = ", ".join(words)
    parts = []
    for q, name in enumerate(INPUT_NAMES):
        if stale[q] or refused[q]:
            what = " past its time-out" if stale[q] else ""
            parts.append(f"{name}{what}{f' (refused: {refused[q]})' if refused[q] else ''}")
    return "; ".join(parts)


def of_changes(axle: int, changes: Iterable[Change], begin_us: int, end_us: int) -> tuple[Event, ...]:
    """Events of an axle as the core's own changes say, to the slot and with the figures of their causes."""
    own: Sequence[Change] = [c for c in changes if c.axle == axle]
    out: list[Event] = []
    starts = [begin_us, *(c.time_us for c in own)]
    states = [(Validity.NOT_AVAILABLE, Cause.NONE, ""), *((c.after, c.cause, c.detail) for c in own)]
    for start, stop, (validity, cause, detail) in zip(starts, [*starts[1:], end_us], states, strict=True):
        begin, end = max(start, begin_us), min(stop, end_us)
        if end > begin:
            text = "" if not cause or detail == cause.words else detail
            out.append(Event(axle, begin, end, validity, cause, text))
    if len(out) > 1 and not out[0].cause and out[0].validity is out[1].validity:
        out[1] = Event(axle, out[0].begin_us, out[1].end_us, out[1].validity, out[1].cause, out[1].detail)
        del out[0]  # before the first slot
    return tuple(out)


def with_silences(events: Iterable[Event], time_us: Times, cycle_us: int) -> tuple[Event, ...]:
    """The same events; where no frame comes for longer than three cycles, as over a step of time, no state holds."""
    out = list(events)
    for k in np.flatnonzero(np.diff(time_us) > STALE_AFTER * cycle_us).tolist():
        begin, end = int(time_us[k]) + STALE_AFTER * cycle_us, int(time_us[k + 1])
        parts: list[Event] = []
        for e in out:
            parts += [replace(e, end_us=min(e.end_us, begin)), replace(e, begin_us=max(e.begin_us, end))]
        axle = out[0].axle if out else 0
        parts.append(Event(axle, begin, end, Validity.NOT_AVAILABLE, Cause.NONE, NO_FRAME))
        out = sorted((e for e in parts if e.end_us > e.begin_us), key=lambda e: e.begin_us)
    return tuple(out)
