"""Measurements on their way to a tick."""

from collections import deque

NEVER = -(1 << 60)


class JitterBuffer:
    """Give each tick one measurement of every place (a channel of an axle), in the order in which they came.

    A sensor's cycle and the tick are equal and drift against each other; with the bus's jitter, frames near a tick's
    edge come two to one tick and none to the next. So one measurement may wait for the next tick: after the first such
    pair none is lost and no tick is empty. More than one never waits (a third drops the oldest), so that a measurement
    is used at most one tick late, and a sensor twice as fast as the tick has every second one used. One that has kept
    others waiting for `patience` ticks on end, and was never needed, is dropped: two channels that are a tick apart
    are no longer of the same moment.
    """

    STATE = {"waiting": "_waiting", "surplus_ticks": "_surplus_ticks", "used_us": "used_us"}

    def __init__(self, places: int, patience: int) -> None:
        self._patience = patience
        self._surplus_ticks = [0] * places  # ticks on end after which one still waited
        # (value, stamp in microseconds), at most two: for the open tick and for the one after it
        self._waiting: list[deque[tuple[float, int]]] = [deque(maxlen=2) for _ in range(places)]
        self.used_us = [NEVER] * places  # stamps of what ticks used last

    def put(self, place: int, value: float, stamp_us: int) -> None:
        """A measurement has come."""
        self._waiting[place].append((value, stamp_us))

    def take(self) -> tuple[list[float], list[bool] | None]:
        """The tick is over: its measurements by place (0 where there is none), and which there are; None: all."""
        values, present, used_us, surplus = [], None, self.used_us, self._surplus_ticks
        for place, waiting in enumerate(self._waiting):
            if waiting:
                value, used_us[place] = waiting.popleft()
                values.append(value)
                if waiting:
                    surplus[place] += 1
                    if surplus[place] >= self._patience:
                        waiting.popleft()
                        surplus[place] = 0
                elif surplus[place]:
                    surplus[place] = 0
            else:
                values.append(0.0)
                surplus[place] = 0
                if present is None:
                    present = [True] * len(self._waiting)
                present[place] = False
        return values, present

    def reset(self) -> None:
        """Nothing that came before counts."""
        for waiting in self._waiting:
            waiting.clear()
        self._surplus_ticks = [0] * len(self._waiting)
        self.used_us = [NEVER] * len(self._waiting)
