"""How long an axle has been in which state of Validity, and why: one spell after the other."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Cause, Validity
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.tools.story.records import Adhesion, Detail

SILENT = "Silent"  # beside the words of Validity: no Adhesion frame came
SILENT_CYCLES = 3  # so many cycles without a frame are a silence
MAX_SPELLS = 20_000  # of an axle, kept
OTHER = "Error"  # a word of Validity that is none of ours
_VALIDITY = MESSAGES["adhesion"]["Validity"]
assert isinstance(_VALIDITY, Words)
_WORDS = _VALIDITY.words
_VALID = _WORDS.index(Validity.VALID.value)
_CAUSES = {c.value: c for c in Cause}


@dataclass(frozen=True, slots=True)
class Spell:
    """An axle in one state from begin until before end; an open one has the end of what is known."""

    axle: int
    begin_us: int
    end_us: int
    state: str  # Validity's word, SILENT or OTHER
    cause: Cause

    @property
    def duration_s(self) -> float:
        """How long."""
        return (self.end_us - self.begin_us) / 1e6

    @property
    def words(self) -> str:
        """Why, for a person; "" of a Valid one."""
        if self.state == SILENT:
            return f"no Adhesion frame for {self.duration_s:.1f} s"
        return self.cause.words


class Spells:
    """Of one axle, brought up to date with its columns. A row's cause is that of the first Detail frame after it; a row
    without one yet counts with what was known before, and again when the frame has come."""

    def __init__(self, axle: int, cycle_us: int) -> None:
        self._axle, self._silent_us, self._cycle_us = axle, SILENT_CYCLES * cycle_us, cycle_us
        self._begins: list[int] = []  # of spells that are settled
        self._states: list[tuple[str, Cause]] = []
        self._settled_us = -1  # rows up to here are settled
        self._open: list[tuple[int, str, Cause]] = []  # changes after that
        self._end_us = 0

    def update(self, adhesion: Adhesion, detail: Detail | None, now_us: int) -> None:
        """Take new rows. now_us: until when everything that came is among them."""
        times = adhesion.time_us
        self._end_us = now_us
        if not len(times):
            return
        first = int(np.searchsorted(times, self._settled_us, side="right"))
        last_us = int(times[-1])
        settled_us = last_us if detail is None else min(int(detail.time_us[-1]) if len(detail.time_us) else -1, last_us)
        if detail is not None and last_us - settled_us > 1_000_000:  # no Detail frame comes: do not wait for it
            settled_us = last_us - 1_000_000
        changes = self._changes(adhesion, detail, first)
        done = bisect_right([c[0] for c in changes], settled_us)
        for change in changes[:done]:
            self._add(*change)
        self._open = changes[done:]
        if now_us - last_us > self._silent_us:
            self._open.append((last_us + self._cycle_us, SILENT, Cause.NONE))
        self._settled_us = max(self._settled_us, settled_us)

    def _changes(self, a: Adhesion, detail: Detail | None, first: int) -> list[tuple[int, str, Cause]]:
        times = a.time_us[first:]
        if not len(times):
            return []
        cause = self._causes(a, detail, first)
        code = a.validity[first:].astype(np.int32) * 64 + cause
        gap = np.diff(times, prepend=a.time_us[first - 1] if first else times[0]) > self._silent_us
        starts = np.flatnonzero(np.diff(code, prepend=code[0] - 1) != 0)
        out = []
        for k in np.union1d(starts, np.flatnonzero(gap)).tolist():
            if gap[k]:
                out.append((int(a.time_us[first + k - 1]) + self._cycle_us, SILENT, Cause.NONE))
            validity = int(a.validity[first + k])
            word = _WORDS[validity] if validity >= 0 else OTHER
            out.append((int(times[k]), word, _CAUSES.get(int(cause[k]), Cause.NONE)))
        return out

    @staticmethod
    def _causes(a: Adhesion, detail: Detail | None, first: int) -> NDArray[np.int32]:
        times, validity = a.time_us[first:], a.validity[first:]
        if detail is None or not len(detail.time_us):
            return np.zeros(len(times), dtype=np.int32)
        after = np.searchsorted(detail.time_us, times, side="left")
        before = np.maximum(after - 1, 0)
        causes = np.maximum(detail.cause, 0).astype(np.int32)
        next_cause = causes[np.minimum(after, len(causes) - 1)]
        out = np.where(next_cause > 0, next_cause, causes[before])
        return np.where(validity == _VALID, 0, out)

    def _add(self, begin_us: int, state: str, cause: Cause) -> None:
        if self._states and self._states[-1] == (state, cause):
            return
        self._begins.append(begin_us)
        self._states.append((state, cause))
        if len(self._begins) > MAX_SPELLS:
            del self._begins[: MAX_SPELLS // 10], self._states[: MAX_SPELLS // 10]

    def all(self, until_us: int | None = None) -> list[Spell]:
        """Oldest first, without a gap between them; up to a time, as if nothing had come since."""
        every = [(b, *s) for b, s in zip(self._begins, self._states, strict=True)]
        for change in self._open:
            if not every or every[-1][1:] != change[1:]:
                every.append(change)
        if not every:
            return []
        ends = [*(c[0] for c in every[1:]), self._end_us]
        limit = self._end_us if until_us is None else until_us
        return [
            Spell(self._axle, begin, min(end, limit), state, cause)
            for (begin, state, cause), end in zip(every, ends, strict=True)
            if begin <= limit
        ]

    def at(self, at_us: int, until_us: int | None = None) -> Spell | None:
        """The one that a time is in, as far as it is known at another."""
        every = self.all(until_us)
        k = bisect_right([s.begin_us for s in every], at_us) - 1
        return every[k] if k >= 0 else None
