"""A log's stamps as a time that only goes on: a clock that is set back does not turn it round."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np

from wrcd.bus.columns import Stretch
from wrcd.bus.frame import Frame
from wrcd.bus.log_order import BEHIND_US
from wrcd.tools.story.records import ClockStep

SomeItem = TypeVar("SomeItem", Stretch | tuple[Frame, str], tuple[Frame, str])


class Onward:
    """What is added to a log's stamps, for what was drawn last from `items`.

    A stamp further than BEHIND_US behind the newest is a step of the clock, as the core takes it: its frame comes at
    the newest time, and those that follow go on from there.
    """

    def __init__(self) -> None:
        self.correction_us = 0
        self.steps: list[ClockStep] = []
        self._newest_us: int | None = None

    def items(self, items: Iterable[SomeItem]) -> Iterator[SomeItem]:
        """The same frames with their own stamps, a stretch cut where the clock steps."""
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

    def _parts(self, s: Stretch) -> Iterator[Stretch]:
        begin, stamps = 0, s.stamps_us
        while begin < len(s):
            self._look(int(stamps[begin]))
            assert self._newest_us is not None
            newest = np.maximum.accumulate(np.maximum(stamps[begin:] + self.correction_us, self._newest_us))
            behind = newest - (stamps[begin:] + self.correction_us) > BEHIND_US
            count = int(behind.argmax()) if behind.any() else len(behind)
            self._newest_us = int(newest[count - 1])
            yield s if count == len(s) else s.part(begin, begin + count)
            begin += count

    def _look(self, stamp_us: int) -> None:
        time_us = stamp_us + self.correction_us
        if self._newest_us is not None and self._newest_us - time_us > BEHIND_US:
            back_us = self._newest_us - time_us
            self.steps.append(ClockStep(self._newest_us, back_us, self.correction_us))
            self.correction_us += back_us
            time_us = self._newest_us
        self._newest_us = time_us if self._newest_us is None else max(self._newest_us, time_us)
