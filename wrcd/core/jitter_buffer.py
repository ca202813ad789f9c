"""Measurements on their way to a tick."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

NEVER = -(1 << 60)


class JitterBuffer:
    """What each tick gets of every channel of every axle: one measurement, in the order in which they came.

    A sensor's cycle and the tick are equal and drift against each other; with the bus's jitter, frames near a tick's
    edge come two to one tick and none to the next. So one measurement may wait for the next tick: after the first such
    pair none is lost and no tick is empty. More than one never waits (a third drops the oldest), so that a measurement
    is used at most one tick late, and a sensor twice as fast as the tick has every second one used. One that has kept
    others waiting for `patience` ticks on end, and was never needed, is dropped: two channels that are a tick apart
    are no longer of the same moment.
    """

    STATE = ("_waiting", "_surplus_ticks", "used_us")

    def __init__(self, channels: int, axles: int, patience: int) -> None:
        self._patience = patience
        self._surplus_ticks = [[0] * axles for _ in range(channels)]  # ticks on end after which one still waited
        # (value, stamp in microseconds), at most two: for the open tick and for the one after it
        self._waiting: list[list[deque[tuple[float, int]]]] = [
            [deque(maxlen=2) for _ in range(axles)] for _ in range(channels)
        ]
        self._shape = (channels, axles)
        self.used_us: NDArray[np.int64] = np.full(self._shape, NEVER, dtype=np.int64)  # stamps of what ticks used last

    def put(self, channel: int, axle: int, value: float, stamp_us: int) -> None:
        """A measurement has come."""
        self._waiting[channel][axle].append((value, stamp_us))

    def take(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """The tick is over: its measurements (0 where there is none) and which there are, both (channels, axles)."""
        value, present = np.zeros(self._shape), np.zeros(self._shape, dtype=bool)
        for c, axles in enumerate(self._waiting):
            for a, waiting in enumerate(axles):
                if waiting:
                    value[c, a], self.used_us[c, a] = waiting.popleft()
                    present[c, a] = True
                self._surplus_ticks[c][a] = self._surplus_ticks[c][a] + 1 if waiting else 0
                if self._surplus_ticks[c][a] >= self._patience:
                    waiting.popleft()
                    self._surplus_ticks[c][a] = 0
        return value, present

    def reset(self) -> None:
        """Nothing that came before counts."""
        for axles in self._waiting:
            for waiting in axles:
                waiting.clear()
        self._surplus_ticks = [[0] * len(axles) for axles in self._surplus_ticks]
        self.used_us[:] = NEVER
