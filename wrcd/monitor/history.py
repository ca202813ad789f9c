"""An axle's history while it grows: states of Validity, falls and rises of adhesion. What is
settled is kept; the rest is found again from the newest columns (wrcd/logs/story_events.py)."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wrcd.core.causes import Validity
from wrcd.core.details import NEVER
from wrcd.logs.story_events import NO_FRAME, falls_of, of_frames
from wrcd.logs.story_records import Event, Fall, StoryAxle

OPEN_US = 1_000_000  # an event may change for so long after it began: its Detail frame is still to come
MAX_EVENTS = 20_000  # of an axle, kept
SETTLED_US = 15_000_000  # a fall that ended so long ago is not looked at again
BACK_US = 30_000_000  # looked at each time: the level before, and what is not settled
EVERY_US = 1_000_000  # falls are looked for so often
NEAR_US = 300_000  # a change of Validity so near to a fall is shown with it
NO_VALUE = "–"


@dataclass(frozen=True, slots=True)
class Happening:
    """Something to jump to."""

    time_us: int
    text: str
    is_fall: bool


class History:
    """Of one axle, brought up to date with its columns."""

    def __init__(self, cycle_us: int) -> None:
        self._cycle_us = cycle_us
        self._events: list[Event] = []  # without a gap between them
        self._open = 0  # events from this one on may change
        self._open_us: int | None = None  # rows from here on may change them
        self._settled: list[Fall] = []
        self._falls: tuple[Fall, ...] = ()
        self._looked_us: int | None = None  # up to there all falls have been found
        self._is_known = False  # events are not found from rows

    def know(self, events: Sequence[Event]) -> None:
        """Take all events as who made the rows knows them."""
        self._events, self._is_known = list(events), True

    def update(self, axle: StoryAxle, now_us: int) -> None:
        """Take new rows. now_us: until when everything that came is among them."""
        if not len(axle.adhesion):
            return
        if not self._is_known:
            self._update_events(axle, now_us)
        newest_us = int(axle.adhesion.time_us[-1])
        if self._looked_us is None or newest_us // EVERY_US != self._looked_us // EVERY_US:
            self._update_falls(axle, newest_us)

    def _update_events(self, axle: StoryAxle, now_us: int) -> None:
        times, detail = axle.adhesion.time_us, axle.detail
        first = 0 if self._open_us is None else max(int(np.searchsorted(times, self._open_us, side="right")) - 1, 0)
        part, begin_us = axle.adhesion.part(slice(first, None)), int(times[first])
        if detail is not None:
            detail = detail.part(slice(np.searchsorted(detail.time_us, begin_us), None))
        found = list(of_frames(axle.number, part, detail, axle.health, self._cycle_us, begin_us, now_us))
        del self._events[self._open :]
        if self._events and found and (last := self._events[-1]).end_us >= found[0].begin_us > last.begin_us:
            same = found[0].validity is last.validity and (found[0].cause is last.cause or not found[0].cause)
            if same and last.detail != NO_FRAME:  # it goes on
                found[0] = replace(last, end_us=found[0].end_us, detail=last.detail or found[0].detail)
                self._events.pop()
            else:
                self._events[-1] = replace(last, end_us=found[0].begin_us)
        begun = len(self._events)
        self._events += found
        # rows up to a second before the newest, and to the newest Detail frame before that, are settled
        limit_us = int(times[-1]) - OPEN_US
        reported = detail.time_us[detail.time_us <= limit_us] if detail is not None else np.zeros(0, np.int64)
        open_us = int(reported[-1]) if len(reported) else limit_us - OPEN_US
        self._open_us = int(times[max(int(np.searchsorted(times, open_us, side="right")) - 1, first)])
        settled = [e for e in found if e.begin_us < self._open_us]
        self._open = begun + len(settled)
        if len(self._events) > MAX_EVENTS:
            gone = len(self._events) - MAX_EVENTS * 9 // 10
            del self._events[:gone]
            self._open -= gone

    def _update_falls(self, axle: StoryAxle, now_us: int) -> None:
        times = axle.adhesion.time_us
        after_us = self._settled[-1].end_us if self._settled else int(times[0])
        begin_us = after_us if self._looked_us is None else max(after_us, self._looked_us - BACK_US)
        found = falls_of(replace(axle, adhesion=axle.adhesion.part(slice(np.searchsorted(times, begin_us), None))))
        done = [f for f in found if f.end_us < now_us - SETTLED_US]
        self._settled += done
        self._looked_us = now_us
        self._falls = (*self._settled, *found[len(done) :])

    def falls(self, until_us: int | None = None) -> list[Fall]:
        """Return falls and rises that have ended at a time, oldest first."""
        return [f for f in self._falls if until_us is None or f.end_us <= until_us]

    def events(self, begin_us: int = NEVER, end_us: int | None = None, until_us: int | None = None) -> list[Event]:
        """Return those that touch a time, oldest first, as if nothing had come after until_us."""
        limits = [t for t in (end_us, until_us) if t is not None]
        first = max(bisect_right(self._events, begin_us, key=lambda e: e.begin_us) - 1, 0)
        end = bisect_right(self._events, min(limits), key=lambda e: e.begin_us) if limits else len(self._events)
        return [e for e in self._part(first, end, until_us) if e.end_us >= begin_us]

    def _part(self, first: int, end: int, until_us: int | None) -> list[Event]:
        found = self._events[first:end]
        if found and until_us is not None and found[-1].end_us > until_us:
            found[-1] = replace(found[-1], end_us=until_us)
        return found

    def at(self, at_us: int, until_us: int | None = None) -> Event | None:
        """Return the event that a time is in, or the last before it."""
        end = bisect_right(self._events, at_us, key=lambda e: e.begin_us)
        return self._part(end - 1, end, until_us)[0] if end else None

    def happenings(self, until_us: int | None = None, most: int | None = None) -> list[Happening]:
        """Return what happened up to a time, in order. most: of so many of the newest events alone."""
        end = len(self._events) if until_us is None else bisect_right(self._events, until_us, key=lambda e: e.begin_us)
        first = 0 if most is None else max(end - most, 0)
        part = self._part(first, end, until_us)
        return happenings([f for f in self.falls(until_us) if not first or f.begin_us >= part[0].begin_us], part)


def happenings(fell: Sequence[Fall], events: Sequence[Event]) -> list[Happening]:
    """Return falls and changes of Validity in order of time. The first event is no change."""
    with_it: list[list[str]] = [[] for _ in fell]
    ends = [f.end_us + NEAR_US for f in fell]  # in order, as falls do not overlap
    out = []
    for e in events[1:]:
        near = bisect_left(ends, e.begin_us)
        if near == len(fell) or fell[near].begin_us - NEAR_US > e.begin_us:
            out.append(Happening(e.begin_us, event_text(e), False))
        elif e.cause or e.detail == NO_FRAME:
            with_it[near].append(event_text(e))
    for f, texts in zip(fell, with_it, strict=True):
        text = f"available {f.verb} from {f.before_pct:.1f} to {f.after_pct:.1f} %"
        out.append(Happening((f.begin_us + f.end_us) // 2, "; ".join((text, *texts)), True))
    return sorted(out, key=lambda h: h.time_us)


def state_name(e: Event) -> str:
    """Return the word of a state: Validity's, or Silent where no frame came."""
    return "Silent" if e.detail == NO_FRAME or e.is_gap else e.validity.value


def event_text(e: Event) -> str:
    """Return an event for a person: "Degraded for 2.3 s, InputStale: an input was past its time-out"."""
    text = f"{state_name(e)} for {duration(e.duration_s)}"
    return f"{text}, {e.cause.label}: {e.cause.words}" if e.cause else text


def duration(seconds: float) -> str:
    """Return a time so that it can be read at a glance."""
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds >= 0.1 else f"{seconds * 1000:.0f} ms"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def first_of_interest(history: History) -> int | None:
    """Return when a reader of a log begins: at the first fall, else where the axle first was not Valid any more."""
    fall = next((h.time_us for h in history.happenings() if h.is_fall), None)
    if fall is not None:
        return fall
    events = history.events()
    valid = next((k for k, e in enumerate(events) if e.validity is Validity.VALID), len(events))
    return events[valid + 1].begin_us if valid + 1 < len(events) else None


def percent(value: float) -> str:
    """Return a value in percent, or that there is none."""
    return f"{value:.1f} %" if math.isfinite(value) else NO_VALUE
