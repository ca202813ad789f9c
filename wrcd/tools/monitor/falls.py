"""Falls and rises of an axle's adhesion while it grows: story/falls.py over what is new."""

import numpy as np

from wrcd.tools.story.falls import of_axle
from wrcd.tools.story.records import Adhesion, Axle, Fall

SETTLED_US = 15_000_000  # a fall that ended so long ago is not looked at again
BACK_US = 30_000_000  # looked at each time: the level before, and what is not settled


class Falls:
    """Of one axle. What is settled is kept; the rest is found again from the newest columns."""

    def __init__(self, axle: int) -> None:
        self._axle = axle
        self._settled: list[Fall] = []
        self._looked_us: int | None = None  # up to there everything has been found

    def update(self, adhesion: Adhesion) -> tuple[Fall, ...]:
        """All of them, oldest first."""
        times = adhesion.time_us
        if not len(times):
            return tuple(self._settled)
        now_us = int(times[-1])
        after_us = self._settled[-1].end_us if self._settled else int(times[0])
        begin_us = after_us if self._looked_us is None else max(after_us, self._looked_us - BACK_US)
        first = int(np.searchsorted(times, begin_us))
        part = Adhesion(*(getattr(adhesion, name)[first:] for name in Adhesion.__slots__))
        found = of_axle(Axle(self._axle, part, None, None, None, ()))
        done = [f for f in found if f.end_us < now_us - SETTLED_US]
        self._settled += done
        self._looked_us = now_us
        return (*self._settled, *found[len(done) :])
