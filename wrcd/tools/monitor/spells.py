"""How long an axle has been in which state of Validity, and why: one spell after the other."""

from bisect import bisect_right
from dataclasses import dataclass, replace

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
    """Of one axle, brought up to date with its columns. A row's cause is that of the first Detail frame at or after it,
    else of the last one before, while its Validity lasts (story/events.py); a row without one after it yet counts with
    what was known before, and again when the frame has come."""

    def __init__(self, axle: int, cycle_us: int) -> None:
        self._axle, self._silent_us, self._cycle_us = axle, SILENT_CYCLES * cycle_us, cycle_us
        self._begins: list[int] = []  # of spells that are settled
        self._states: list[tuple[str, Cause]] = []
        self._done: list[Spell] = []  # all of these but the newest, whose end is not known
        self._run = (0, -2)  # since when the newest settled row's Validity lasts, and its place
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
        settled_us = last_us if detail is None else _heard_before(detail, last_us)
        if detail is not None and last_us - settled_us > 1_000_000:  # no Detail frame comes: do not wait for it
            settled_us = last_us - 1_000_000
        changes = self._changes(adhesion, detail, first)
        done = bisect_right([c[0] for c in changes], settled_us)
        for change in changes[:done]:
            self._add(*change)
        self._open = changes[done:]
        if now_us - last_us > self._silent_us:
            self._open.append((last_us + self._cycle_us, SILENT, Cause.NONE))
        end = int(np.searchsorted(times, settled_us, side="right"))
        if end > first:
            self._run = int(self._runs(adhesion, first)[0][end - first - 1]), int(adhesion.validity[end - 1])
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

    def _runs(self, a: Adhesion, first: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Of each row from the first on, since when its Validity lasts and until before when, as far as is known."""
        times, validity = a.time_us[first:], a.validity[first:].astype(np.int16)
        starts = np.flatnonzero(np.diff(validity, prepend=validity[0] - 1) != 0)
        begins, ends = times[starts], np.append(times[starts[1:]], np.iinfo(np.int64).max)
        if self._run[1] == validity[0]:
            begins[0] = self._run[0]
        sizes = np.diff(starts, append=len(times))
        return np.repeat(begins, sizes), np.repeat(ends, sizes)

    def _causes(self, a: Adhesion, detail: Detail | None, first: int) -> NDArray[np.int32]:
        times = a.time_us[first:]
        if detail is None or not len(detail.time_us):
            return np.zeros(len(times), dtype=np.int32)
        begins, ends = self._runs(a, first)
        after = np.searchsorted(detail.time_us, times, side="left")
        at, before = np.minimum(after, len(detail.time_us) - 1), np.maximum(after - 1, 0)
        said = np.maximum(detail.cause, 0).astype(np.int32)
        told_after = (after < len(said)) & (detail.time_us[at] < ends)
        told_before = (after > 0) & (detail.time_us[before] >= begins)
        out = np.where(told_after, said[at], np.where(told_before, said[before], 0))
        return np.where(a.validity[first:] == _VALID, 0, out)

    def _add(self, begin_us: int, state: str, cause: Cause) -> None:
        if self._states and self._states[-1] == (state, cause):
            return
        if self._states:
            self._done.append(Spell(self._axle, self._begins[-1], begin_us, *self._states[-1]))
        self._begins.append(begin_us)
        self._states.append((state, cause))
        if len(self._begins) > MAX_SPELLS:
            del self._begins[: MAX_SPELLS // 10], self._states[: MAX_SPELLS // 10], self._done[: MAX_SPELLS // 10]

    def _tail(self, limit_us: int) -> list[Spell]:
        """What follows those that are done, up to a time."""
        every = [(self._begins[-1], *self._states[-1])] if self._begins else []
        for change in self._open:
            if not every or every[-1][1:] != change[1:]:
                every.append(change)
        if not every:
            return []
        ends = [*(c[0] for c in every[1:]), self._end_us]
        return [
            Spell(self._axle, begin, min(end, limit_us), state, cause)
            for (begin, state, cause), end in zip(every, ends, strict=True)
            if begin <= limit_us
        ]

    def all(self, until_us: int | None = None) -> list[Spell]:
        """Oldest first, without a gap between them; up to a time, as if nothing had come since."""
        return self.newest(len(self._begins) + len(self._open), until_us)

    def newest(self, count: int, until_us: int | None = None) -> list[Spell]:
        """So many of all(), or more."""
        limit_us = self._end_us if until_us is None else until_us
        tail = self._tail(limit_us)
        end = bisect_right(self._begins, limit_us, hi=len(self._done))
        return [*(_cut(s, limit_us) for s in self._done[max(end - max(count - len(tail), 0), 0) : end]), *tail]

    def between(self, begin_us: int, end_us: int, until_us: int | None = None) -> list[Spell]:
        """Those of all() that touch a time."""
        limit_us = self._end_us if until_us is None else until_us
        first = max(bisect_right(self._begins, begin_us, hi=len(self._done)) - 1, 0)
        end = bisect_right(self._begins, min(end_us, limit_us), hi=len(self._done))
        every = [*(_cut(s, limit_us) for s in self._done[first:end]), *self._tail(limit_us)]
        return [s for s in every if s.end_us >= begin_us and s.begin_us <= end_us]

    def at(self, at_us: int, until_us: int | None = None) -> Spell | None:
        """The one that a time is in, as far as it is known at another."""
        every = self.between(at_us, at_us, until_us) or self.newest(1, until_us)
        return next((s for s in reversed(every) if s.begin_us <= at_us), None)


def _heard_before(detail: Detail, last_us: int) -> int:
    """The newest Detail frame before a row: what rows it goes with is known."""
    k = int(np.searchsorted(detail.time_us, last_us, side="left"))
    return int(detail.time_us[k - 1]) if k else -1


def _cut(s: Spell, limit_us: int) -> Spell:
    return s if s.end_us <= limit_us else replace(s, end_us=limit_us)
