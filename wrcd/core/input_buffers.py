"""What has come of every input: measurements on their way to a tick, how well each is reached, what was refused since.

A place is a quantity of an axle. The register of eight bits is as chrony keeps one of its servers.
"""

from collections import Counter, deque
from collections.abc import Sequence

from wrcd.bus.reasons import Reason

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

    _waiting: list[deque[tuple[float, int]]]
    _surplus_ticks: list[int]  # ticks on end after which one still waited
    used_us: list[int]  # stamps of what ticks used last

    def __init__(self, places: int, patience: int) -> None:
        self._patience = patience
        self._surplus_ticks = [0] * places
        # (value, stamp in microseconds), at most two: for the open tick and for the one after it
        self._waiting = [deque(maxlen=2) for _ in range(places)]
        self.used_us = [NEVER] * places

    def put(self, place: int, value: float, stamp_us: int) -> None:
        """A measurement has come; NaN: one that is not to be used, and has its tick all the same."""
        self._waiting[place].append((value, stamp_us))

    def take(self) -> tuple[list[float], list[bool] | None]:
        """The tick is over: its measurements by place (0 where there is none), and which there are; None: all."""
        values, present, used_us, surplus = [], None, self.used_us, self._surplus_ticks
        for place, waiting in enumerate(self._waiting):
            if waiting:
                value, stamp_us = waiting.popleft()
                if waiting:
                    surplus[place] += 1
                    if surplus[place] >= self._patience:
                        waiting.popleft()
                        surplus[place] = 0
                elif surplus[place]:
                    surplus[place] = 0
                if value == value:  # not NaN
                    values.append(value)
                    used_us[place] = stamp_us
                    continue
            else:
                surplus[place] = 0
            values.append(0.0)
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


BITS = 8
_ALL = (1 << BITS + 1) - 1  # one more: the interval that is not over yet
_LABELS = ("None", *(r.label for r in Reason))
_NUMBERS = {reason: number for number, reason in enumerate(Reason, 1)}


class Reach:
    """By place (a quantity of an axle). A bit stands for one time-out that is over, the newest lowest; set: a good
    frame came in it."""

    _register: list[int]
    _until_us: list[int]  # end of the interval that the lowest bit stands for
    _rejected: list[int]  # number in _LABELS
    _rejected_us: list[int]

    def __init__(self, timeouts_us: Sequence[int]) -> None:
        self._timeout_us = [max(1, t) for t in timeouts_us]
        self._register = [0] * len(timeouts_us)
        self._until_us = [0] * len(timeouts_us)
        self._rejected = [0] * len(timeouts_us)
        self._rejected_us = [NEVER] * len(timeouts_us)

    def accept(self, place: int, stamp_us: int) -> None:
        """A good frame."""
        if stamp_us >= self._until_us[place]:
            self._shift(place, stamp_us)
            self._register[place] |= 1
        elif not self._register[place] & 1:
            self._register[place] |= 1

    def reject(self, place: int, stamp_us: int, reason: Reason) -> None:
        """A frame that was not accepted."""
        self._rejected[place] = _NUMBERS[reason]
        self._rejected_us[place] = stamp_us

    @property
    def rejected_until_us(self) -> int:
        """Up to when any rejection is told."""
        return max(at + BITS * timeout for at, timeout in zip(self._rejected_us, self._timeout_us, strict=True))

    def read(self, place: int, now_us: int) -> tuple[int, str]:
        """The register, and the label of the newest rejection within it ("None")."""
        if now_us >= self._until_us[place]:
            self._shift(place, now_us)
        recent = now_us - self._rejected_us[place] <= BITS * self._timeout_us[place]
        return self._register[place] >> 1, _LABELS[self._rejected[place] if recent else 0]

    def reset(self) -> None:
        """A step of time: when anything came is not known any more."""
        self._register = [0] * len(self._register)
        self._until_us = [0] * len(self._register)
        self._rejected_us = [NEVER] * len(self._register)

    def _shift(self, place: int, now_us: int) -> None:
        timeout_us = self._timeout_us[place]
        interval = now_us // timeout_us
        passed = interval + 1 - self._until_us[place] // timeout_us
        self._register[place] = 0 if passed > BITS else self._register[place] << passed & _ALL
        self._until_us[place] = (interval + 1) * timeout_us


class Refusals:
    """By place (a quantity of an axle). Costs nothing while no frame is refused: a good frame is known by its stamp."""

    _counts: list[Counter[str]]
    _good_us: list[int]  # stamp of the good frame that they came after

    def __init__(self, places: int) -> None:
        self._counts = [Counter() for _ in range(places)]
        self._good_us = [NEVER] * places

    def reject(self, place: int, good_us: int, reason: Reason) -> None:
        """A frame was refused, the newest good one being of good_us."""
        if good_us != self._good_us[place]:
            self._good_us[place] = good_us
            self._counts[place].clear()
        self._counts[place][reason.value] += 1

    def since(self, place: int, good_us: int) -> str:
        """How many and why: "12 crc, 1 repeat"; nothing where none was."""
        if good_us != self._good_us[place]:
            return ""
        return ", ".join(f"{n} {reason}" for reason, n in self._counts[place].most_common())

    def reset(self) -> None:
        """A step of time, or a long silence."""
        for count in self._counts:
            count.clear()
        self._good_us = [NEVER] * len(self._good_us)
