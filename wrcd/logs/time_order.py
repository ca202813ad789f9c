"""Frames of a log in the order of their stamps, those of one channel, and a time that goes on over a step of the
clock."""

import heapq
import itertools
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from wrcd.bus.frame import Frame
from wrcd.errors import InputError
from wrcd.logs.columns import Item, Stretch, stretches
from wrcd.logs.story_records import ClockStep, Gaps

SomeItem = TypeVar("SomeItem", Stretch | tuple[Frame, str], tuple[Frame, str])

# A stamp further than this behind the newest is no jitter between queues: the core takes it for a step of the clock.
BEHIND_US = 10_000
# A clock steps once and goes on. So many stamps behind among so many frames are frames out of order.
MIN_BEHIND, AMONG_FRAMES = 3, 1_000
SORTED_WITHIN_US = 1_000_000
# A log has no clock by which a silence differs from a step of time. Up to so long between any of its lines is a
# silence, and its slots are made; longer is a gap, as where the recorder was off. What comes after it is the same.
MAX_SILENCE_US = 60_000_000
LAST_TICK_US = 20_000  # before a step of the clock: what was not made of it yet


def channel_of(item: Item) -> str:
    """The channel of a frame or of a stretch of them."""
    return item.channel if isinstance(item, Stretch) else item[1]


def frames_of(item: Item) -> Iterable[tuple[Frame, str]]:
    """One by one."""
    return ((f, item.channel) for f in item.frames()) if isinstance(item, Stretch) else (item,)


def on_channel(items: Iterable[SomeItem], wanted: str | None, log: Path) -> Iterator[SomeItem]:
    """The frames of one channel.

    Raises InputError, with the channels and how many frames each has, where none is wanted and there are several, or
    where there is none of the wanted one.
    """
    counts: Counter[str] = Counter()
    for item in items:
        channel = channel_of(item)
        counts[channel] += len(item) if isinstance(item, Stretch) else 1
        if wanted is None and len(counts) > 1:
            continue  # only counted: the error names them all
        if wanted is None or channel == wanted:
            yield item
    names = ", ".join(f"{name} ({count} frames)" for name, count in counts.most_common())
    if wanted is None and len(counts) > 1:
        raise InputError(f"has several channels: {names}", file=log, key="--channel", hint="name the one to read")
    if wanted is not None and counts and not counts[wanted]:
        raise InputError(f"has no frame on {wanted}, but on {names}", file=log, key="--channel")


@dataclass(slots=True)
class StrayStamps:
    """Single frames whose stamp lies further than SORTED_WITHIN_US from those of both neighbours, which go on as
    before: each comes at the time of the one before it. No clock steps for a single frame. MIN_BEHIND of them among
    AMONG_FRAMES are frames out of order, and stay as they are."""

    log: Path
    count: int = 0
    first: int = 0  # its number
    first_off_us: int = 0
    _number: int = 0  # of frames before what is looked at
    _before_us: int | None = None
    _newest: deque[int] = field(default_factory=deque)  # numbers of frames that lie so, taken for stray or not

    def put(self, items: Iterable[SomeItem]) -> Iterator[SomeItem]:
        """The same frames, each item when the next is known."""
        held: SomeItem | None = None
        for item in items:
            if held is not None:
                yield self._mended(held, int(item.stamps_us[0]) if isinstance(item, Stretch) else item[0].stamp_us)
            held = item
        if held is not None:
            yield self._mended(held, None)

    def _mended(self, item: SomeItem, after_us: int | None) -> SomeItem:
        if not isinstance(item, Stretch):
            stamp_us = item[0].stamp_us
            if abs(stamp_us - (stamp_us if self._before_us is None else self._before_us)) <= SORTED_WITHIN_US:
                self._number, self._before_us = self._number + 1, stamp_us
                return item  # most are so, and arrays are slow
        stamps = item.stamps_us if isinstance(item, Stretch) else np.array([item[0].stamp_us])
        before_us = int(stamps[0]) if self._before_us is None else self._before_us
        edges = np.concatenate(([before_us], stamps, [stamps[-1] if after_us is None else after_us]))
        far = np.abs(np.diff(edges)) > SORTED_WITHIN_US
        stray = far[:-1] & far[1:] & (np.abs(edges[2:] - edges[:-2]) <= SORTED_WITHIN_US)
        at = [k for k in np.flatnonzero(stray).tolist() if self._is_single(self._number + k + 1)]
        if at:
            stray[:] = False
            stray[at] = True
            if not self.count:
                self.first, self.first_off_us = self._number + int(at[0]) + 1, int(stamps[at[0]] - edges[at[0]])
            self.count += len(at)
            stamps = np.where(stray, edges[:-2], stamps)
            if isinstance(item, Stretch):
                item = replace(item, stamps_us=stamps)
            else:
                frame, channel = item
                item = replace(frame, stamp_us=int(stamps[0])), channel
        self._number += len(stamps)
        self._before_us = int(stamps[-1])
        return item

    def _is_single(self, number: int) -> bool:
        self._newest.append(number)
        while self._newest[0] < number - AMONG_FRAMES:
            self._newest.popleft()
        return len(self._newest) < MIN_BEHIND

    def warnings(self) -> list[str]:
        """A sentence for a person, if there are any."""
        if not self.count:
            return []
        one = self.count == 1
        where = f"frame {self.first}" if one else f"{self.count} frames, first frame {self.first}"
        way = "ahead of" if self.first_off_us > 0 else "behind"
        return [
            f"{self.log}: bad stamp of {where}, {abs(self.first_off_us) * 1e-6:.3g} s {way} its neighbours': taken at "
            "the time of the frame before"
        ]


@dataclass(slots=True)
class TimeOrder:
    """Frames in the order of their stamps, if the log has them out of order by no more than SORTED_WITHIN_US.

    Stamps that step back now and then are those of a clock that was set: they stay. Nothing of a log in order is
    touched.
    """

    log: Path
    steps: int = 0  # back
    first_step: int = 0  # number of its frame
    largest_step_us: int = 0
    sorted_from: int = 0  # number of the first frame behind, 0: not sorted
    moved: int = 0
    largest_move_us: int = 0
    _newest_us: int | None = None
    _released_us: int | None = None
    _number: int = 0  # of the newest frame
    _behind: deque[int] = field(default_factory=deque)  # numbers of frames

    def put(self, items: Iterable[Item]) -> Iterator[Item]:
        """The same frames. Raises InputError for a log that is out of order by more."""
        items = iter(items)
        held: deque[tuple[int, Item]] = deque()  # with their newest stamp
        for item in items:
            newest_us = self._look(item)
            held.append((newest_us, item))
            if len(self._behind) >= MIN_BEHIND:
                yield from stretches(self._sort(itertools.chain((i for _, i in held), items)))
                return
            self._forget()
            while not self._behind and held and not 0 <= newest_us - held[0][0] <= SORTED_WITHIN_US:
                yield self._release(held.popleft())
        while held:
            yield self._release(held.popleft())

    def _forget(self) -> None:
        """Frames behind that lie too far back are steps of the clock."""
        while self._behind and self._behind[0] < self._number - AMONG_FRAMES:
            self._behind.popleft()

    def _release(self, held: tuple[int, Item]) -> Item:
        self._released_us = held[0]
        return held[1]

    def _look(self, item: Item) -> int:
        """Note the steps back of an item. Returns the newest stamp."""
        if isinstance(item, Stretch):
            stamps = item.stamps_us
            first = self._newest_us is None or stamps[0] >= self._newest_us - BEHIND_US
            if first and (np.maximum.accumulate(stamps) - stamps).max() <= BEHIND_US:
                self._number += len(item)
                newest_us = int(stamps.max())
                self._newest_us = newest_us if self._newest_us is None else max(newest_us, self._newest_us)
                return self._newest_us
        for stamp_us in item.stamps_us.tolist() if isinstance(item, Stretch) else (item[0].stamp_us,):
            self._number += 1
            behind_us = 0 if self._newest_us is None else self._newest_us - stamp_us
            if behind_us > BEHIND_US:
                self.first_step = self.first_step or self._number
                self.steps += 1
                self.largest_step_us = max(self.largest_step_us, behind_us)
                self._behind.append(self._number)
                self._forget()
                if len(self._behind) >= MIN_BEHIND:
                    break  # it is to be sorted, whatever follows
            if behind_us > BEHIND_US or self._newest_us is None or stamp_us > self._newest_us:
                self._newest_us = stamp_us
        assert self._newest_us is not None
        return self._newest_us

    def _sort(self, items: Iterable[Item]) -> Iterator[tuple[Frame, str]]:
        """Frames from here on in order."""
        self.sorted_from, self.steps = self._behind[0], self.steps - len(self._behind)
        heap: list[tuple[int, int, Frame, str]] = []
        newest_us = None
        numbers = itertools.count()
        for frame, channel in itertools.chain.from_iterable(map(frames_of, items)):
            stamp_us = frame.stamp_us
            if self._released_us is not None and stamp_us < self._released_us - BEHIND_US:
                raise InputError(
                    f"out of time order by more than {SORTED_WITHIN_US * 1e-6:g} s, from frame {self.sorted_from} on",
                    file=self.log,
                    hint="sort it by its stamps",
                )
            newest_us = stamp_us if newest_us is None else newest_us
            if stamp_us < newest_us:
                self.moved += 1
                self.largest_move_us = max(self.largest_move_us, newest_us - stamp_us)
            newest_us = max(newest_us, stamp_us)
            heapq.heappush(heap, (stamp_us, next(numbers), frame, channel))
            while heap[0][0] < newest_us - SORTED_WITHIN_US:
                self._released_us, _, old, of = heapq.heappop(heap)
                yield old, of
        while heap:
            _, _, old, of = heapq.heappop(heap)
            yield old, of

    def warnings(self) -> list[str]:
        """Sentences for a person; empty for a log in order."""
        out = []
        if self.sorted_from:
            out.append(
                f"{self.log}: out of time order from frame {self.sorted_from} on: {self.moved} frames behind the "
                f"newest, by up to {self.largest_move_us * 1e-6:.3g} s; sorted"
            )
        if self.steps:
            out.append(
                f"{self.log}: its stamps step back {self.steps} time{'s' * (self.steps > 1)}, first at frame "
                f"{self.first_step}, by up to {self.largest_step_us * 1e-6:.3g} s: taken for steps of the clock"
            )
        return out


class MonotonicTime:
    """What is added to a log's stamps, for what was drawn last from `items`.

    A stamp further than BEHIND_US behind the newest is a step of the clock, as the core takes it: its frame comes at
    the newest time, and those that follow go on from there. Gaps longer than MAX_SILENCE_US are noted.
    """

    def __init__(self) -> None:
        self.correction_us = 0
        self.steps: list[ClockStep] = []
        self._gaps: list[tuple[int, int]] = []
        self._newest_us: int | None = None

    @property
    def gaps(self) -> Gaps:
        """Those so far, in the time that goes on."""
        return Gaps.of(self._gaps)

    def items(self, items: Iterable[SomeItem]) -> Iterator[SomeItem]:
        """The same frames with their own stamps, a stretch cut where the clock steps, and behind the first frame after
        that: with it, what is left of before is made."""
        for item in items:
            if isinstance(item, Stretch):
                yield from self._parts(item)
            else:
                self._look(item[0].stamp_us)
                yield item

    def moved(self, item: SomeItem) -> SomeItem:
        """What was drawn last, with stamps of the time that goes on."""
        if not self.correction_us:
            return item
        if isinstance(item, Stretch):
            return replace(item, stamps_us=item.stamps_us + self.correction_us)
        frame, channel = item
        return replace(frame, stamp_us=frame.stamp_us + self.correction_us), channel

    def made(self, stamp_us: int) -> int:
        """The time that goes on, of what a core made of the log. What is left to make when the clock is set back is of
        before."""
        if not self.steps:
            return stamp_us
        step = self.steps[-1]
        behind_us = step.at_us - (stamp_us + step.before_us)
        assert self._newest_us is not None
        just_now = self._newest_us - step.at_us < LAST_TICK_US
        if just_now and -LAST_TICK_US < behind_us < LAST_TICK_US < step.back_us:
            return min(stamp_us + step.before_us, step.at_us)
        return stamp_us + self.correction_us

    def _parts(self, s: Stretch) -> Iterator[Stretch]:
        begin, stamps = 0, s.stamps_us
        while begin < len(s):
            steps = len(self.steps)
            self._look(int(stamps[begin]))
            assert self._newest_us is not None
            newest = np.maximum.accumulate(np.maximum(stamps[begin:] + self.correction_us, self._newest_us))
            behind = newest - (stamps[begin:] + self.correction_us) > BEHIND_US
            count = int(behind.argmax()) if behind.any() else len(behind)
            if len(self.steps) > steps:
                count = 1
            self._newest_us = int(newest[count - 1])
            for k in np.flatnonzero(np.diff(newest[:count]) > MAX_SILENCE_US).tolist():
                self._gaps.append((int(newest[k]), int(newest[k + 1])))
            yield s if count == len(s) else s.part(begin, begin + count)
            begin += count

    def _look(self, stamp_us: int) -> None:
        time_us = stamp_us + self.correction_us
        if self._newest_us is not None and self._newest_us - time_us > BEHIND_US:
            back_us = self._newest_us - time_us
            self.steps.append(ClockStep(self._newest_us, back_us, self.correction_us))
            self.correction_us += back_us
            time_us = self._newest_us
        if self._newest_us is not None and time_us - self._newest_us > MAX_SILENCE_US:
            self._gaps.append((self._newest_us, time_us))
        self._newest_us = time_us if self._newest_us is None else max(self._newest_us, time_us)
