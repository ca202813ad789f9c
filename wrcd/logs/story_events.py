"""The states of an axle over a log, each with its cause: from its frames, or from the core's own changes; and where
MuAvailable fell or rose for good: between two levels that each last, and whose intervals do not overlap.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Cause, Validity
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.vocabulary import words_of
from wrcd.logs.story_records import (
    GAP,
    AdhesionRecord,
    Detail,
    Event,
    Fall,
    Gaps,
    HealthRecord,
    Places,
    Story,
    StoryAxle,
)
from wrcd.logs.time_order import MonotonicTime

VALIDITIES = tuple(map(Validity, words_of("adhesion", "Validity")))  # by place
VALID_PLACE = VALIDITIES.index(Validity.VALID)
REASONS = words_of("inputs", "RefusedSpeed")
STALE_AFTER = 3  # cycles without a frame: a receiver does not hold the value any longer
INPUT_NAMES = ("yaw rate", "lateral acceleration", "torque", "speed")
NO_FRAME = "no frame of wrcd"
KNOWN_AGAIN_US = 100_000  # after a gap of a log: until the first slot, and three cycles
CAUSES = {int(c): c for c in Cause}


class NewChanges:
    """Reads the changes of Validity that a core makes; to be asked oftener than its events are forgotten."""

    def __init__(self, core: Core, clock: MonotonicTime | None = None) -> None:
        """clock: of the log, for changes in the time that goes on."""
        self._events, self._taken, self._clock = core.events, core.events.total, clock

    def take(self) -> Sequence[Change]:
        """Those since the time before."""
        if self._events.total == self._taken:
            return ()
        new = self._events.since(self._taken)
        self._taken = self._events.total
        if self._clock is not None and self._clock.steps:
            return [replace(c, time_us=self._clock.made(c.time_us)) for c in new]
        return new


def of_frames(
    axle: int, adhesion: AdhesionRecord, detail: Detail | None, health: HealthRecord | None, cycle_us: int,
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


def _causes(adhesion: AdhesionRecord, detail: Detail | None) -> Places:
    """The cause of each Adhesion frame, 0 while it is Valid or where AdhesionDetail does not tell."""
    none = np.zeros(len(adhesion.time_us), dtype=np.int8)
    if detail is None or not len(detail.time_us):
        return none
    # a state is a run of one Validity: only what comes while it lasts counts for it
    run = np.concatenate(([0], np.cumsum(np.diff(adhesion.validity) != 0)))
    frame_of = np.searchsorted(adhesion.time_us, detail.time_us, side="right") - 1  # frame that each detail goes with
    usable = frame_of >= 0
    run_of_detail = np.where(usable, run[frame_of.clip(0)], -1)
    following = np.searchsorted(detail.time_us, adhesion.time_us, side="left")
    at = following.clip(0, len(detail.time_us) - 1)
    before = (following - 1).clip(0)
    same = (run_of_detail[at] == run) & (following < len(detail.time_us))
    same_before = (run_of_detail[before] == run) & (following > 0)
    causes = np.where(same, detail.cause[at], np.where(same_before, detail.cause[before], 0))
    return np.where((adhesion.validity == VALID_PLACE) | (causes < 0), none, causes).astype(np.int8)


def _described(cause: Cause, begin_us: int, end_us: int, detail: Detail | None, health: HealthRecord | None) -> str:
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


def with_gaps(events: Iterable[Event], gaps: Gaps) -> tuple[Event, ...]:
    """The same events; a gap of the log is an event of its own, until the first state that is known after it."""
    events = tuple(events)
    if not len(gaps.begin_us) or not events:
        return events
    begins = np.array([e.begin_us for e in events])
    known = begins[np.searchsorted(begins, gaps.end_us).clip(0, len(begins) - 1)]
    soon = (known >= gaps.end_us) & (known - gaps.end_us <= KNOWN_AGAIN_US)
    end_us = np.where(soon, known, gaps.end_us)
    out = [
        Event(events[0].axle, begin, end, Validity.NOT_AVAILABLE, Cause.NONE, GAP)
        for begin, end in zip(gaps.begin_us.tolist(), end_us.tolist(), strict=True)
    ]
    for e in events:
        inside = slice(np.searchsorted(end_us, e.begin_us, side="right"), np.searchsorted(gaps.begin_us, e.end_us))
        edges = [e.begin_us, *np.column_stack((gaps.begin_us, end_us))[inside].ravel().tolist(), e.end_us]
        out += [replace(e, begin_us=a, end_us=b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
    return tuple(sorted(out, key=lambda e: e.begin_us))


BLOCK_US = 200_000  # medians of so long: a single wrong frame is none
SETTLED_BLOCKS = 5  # a level that lasts: so many consecutive blocks (a second)
MAX_REFERENCE_BLOCKS = 50  # of the level before
MIN_PP, MIN_SHARE = 2.0, 0.2  # a change is at least this, and this share of the higher level
SETTLED_SHARE = 0.1  # of a change: what is nearer than this to a level belongs to it
UNBOUNDED_PP = 12.0  # half-width where Confidence states none: more than that

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Blocks:
    """Medians of the Valid frames by block; blocks without one are left out."""

    mu: FloatArray
    half: FloatArray
    first: NDArray[np.int64]  # row of the first Valid frame of each

    def differ(self, before: float, half_before: float, k: int) -> bool:
        """Whether the blocks from k on are all at another level."""
        after = self.mu[k : k + SETTLED_BLOCKS]
        if len(after) < SETTLED_BLOCKS:
            return False
        level, half = float(np.median(after)), float(np.median(self.half[k : k + SETTLED_BLOCKS]))
        least = max(MIN_PP, MIN_SHARE * max(before, level), half_before + half)
        return abs(level - before) > least and bool((np.abs(after - before) > 0.5 * least).all())


def with_falls(story: Story) -> Story:
    """The same story with its falls, oldest first."""
    every = [fall for axle in story.axles for fall in falls_of(axle)]
    return replace(story, falls=tuple(sorted(every, key=lambda f: (f.begin_us, f.axle))))


def falls_of(axle: StoryAxle) -> list[Fall]:
    """Falls and rises of one axle. Only Valid frames count; what lies between two levels may be anything."""
    a = axle.adhesion
    rows = np.flatnonzero((a.validity == VALID_PLACE) & np.isfinite(a.available_pct))
    if len(rows) < 2:
        return []
    time_us, mu = a.time_us[rows], a.available_pct[rows].astype(np.float64)
    blocks = _blocks(a, rows, time_us, mu)
    out: list[Fall] = []
    start = 0  # of the level
    k = SETTLED_BLOCKS
    while k + SETTLED_BLOCKS <= len(blocks.mu):
        low = max(start, k - MAX_REFERENCE_BLOCKS)
        before, half = float(np.median(blocks.mu[low:k])), float(np.median(blocks.half[low:k]))
        if not blocks.differ(before, half, k):
            k += 1
            continue
        settled = _settled(blocks.mu, k, before)
        near = max(start, k - 2 * SETTLED_BLOCKS)
        before = float(np.median(blocks.mu[near:k]))
        after = float(np.median(blocks.mu[settled : settled + 2 * SETTLED_BLOCKS]))
        begin, end = _edges(mu, int(blocks.first[near]), int(blocks.first[settled]), before, after)
        fall = Fall(axle.number, int(time_us[begin]), int(time_us[end]), before, after)
        if out and _goes_on(out[-1], fall):
            fall = replace(fall, begin_us=out[-1].begin_us, before_pct=out[-1].before_pct)
            out.pop()
        out.append(fall)
        start, k = settled, settled + SETTLED_BLOCKS
    return out


def _goes_on(earlier: Fall, later: Fall) -> bool:
    """Whether a change is the rest of the one before: the same way, and no level between them."""
    return earlier.is_down == later.is_down and later.begin_us - earlier.end_us < SETTLED_BLOCKS * BLOCK_US


def _blocks(a: AdhesionRecord, rows: NDArray[np.int64], time_us: NDArray[np.int64], mu: FloatArray) -> _Blocks:
    half = np.where(np.isfinite(a.high_pct[rows]), a.high_pct[rows] - a.available_pct[rows], UNBOUNDED_PP)
    number = (time_us - time_us[0]) // BLOCK_US
    first = np.concatenate(([0], np.flatnonzero(np.diff(number)) + 1))
    counts = np.diff(np.concatenate((first, [len(rows)])))
    middle = first + counts // 2
    by_mu, by_half = np.lexsort((mu, number)), np.lexsort((half, number))
    return _Blocks(mu[by_mu][middle], half[by_half][middle].astype(np.float64), first.astype(np.int64))


def _settled(mu: FloatArray, k: int, before: float) -> int:
    """From which block on the new level lasts; the last that may, where it never does."""
    last = len(mu) - SETTLED_BLOCKS
    for j in range(k, last):
        here, next_ = np.median(mu[j : j + SETTLED_BLOCKS]), np.median(mu[j + 1 : j + 1 + SETTLED_BLOCKS])
        later = np.median(mu[j + SETTLED_BLOCKS : j + 2 * SETTLED_BLOCKS])
        # near enough to be no fall of its own
        near = max(0.5, min(SETTLED_SHARE * abs(here - before), max(0.5 * MIN_PP, 0.5 * MIN_SHARE * here)))
        if abs(here - next_) <= near and abs(here - later) <= near and abs(mu[j] - here) <= 2 * near:
            return j
    return last


def _edges(mu: FloatArray, first: int, settled: int, before: float, after: float) -> tuple[int, int]:
    """The last frame at the old level, and the first at the new one."""
    near = max(SETTLED_SHARE * abs(after - before), 0.5)
    at_old = np.flatnonzero(np.abs(mu[first : settled + 1] - before) <= near)
    begin = first + int(at_old[-1]) if len(at_old) else first
    # of a low level a share: 10 % is not yet 3 %
    at_new = np.flatnonzero(np.abs(mu[begin + 1 :] - after) <= min(2 * near, max(0.5 * after, 1.0)))
    return begin, begin + 1 + int(at_new[0]) if len(at_new) else settled
