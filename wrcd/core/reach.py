"""How well each input is reached: a register of eight bits, as chrony keeps of its servers; the newest rejection."""

from collections.abc import Sequence

from wrcd.bus.reasons import Reason
from wrcd.core.jitter_buffer import NEVER

BITS = 8
_ALL = (1 << BITS + 1) - 1  # one more: the interval that is not over yet
_LABELS = ("None", *(r.label for r in Reason))
_NUMBERS = {reason: number for number, reason in enumerate(Reason, 1)}


class Reach:
    """By place (a quantity of an axle). A bit stands for one time-out that is over, the newest lowest; set: a good
    frame came in it."""

    STATE = {
        "register": "_register", "interval_ends_us": "_until_us", "rejected": "_rejected",
        "rejected_us": "_rejected_us",
    }  # fmt: skip

    def __init__(self, timeouts_us: Sequence[int]) -> None:
        self._timeout_us = [max(1, t) for t in timeouts_us]
        self._register = [0] * len(timeouts_us)
        self._until_us = [0] * len(timeouts_us)  # end of the interval that the lowest bit stands for
        self._rejected = [0] * len(timeouts_us)  # number in _LABELS
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

    def read(self, place: int, now_us: int) -> tuple[int, str]:
        """The register, and the label of the newest rejection within it ("None")."""
        if now_us >= self._until_us[place]:
            self._shift(place, now_us)
        recent = now_us - self._rejected_us[place] <= BITS * self._timeout_us[place]
        return self._register[place] >> 1, _LABELS[self._rejected[place] if recent else 0]

    def reset(self) -> None:
        """A step of time: when anything came cannot be told any more."""
        self._register = [0] * len(self._register)
        self._until_us = [0] * len(self._register)
        self._rejected_us = [NEVER] * len(self._register)

    def _shift(self, place: int, now_us: int) -> None:
        timeout_us = self._timeout_us[place]
        interval = now_us // timeout_us
        passed = interval + 1 - self._until_us[place] // timeout_us
        self._register[place] = 0 if passed > BITS else self._register[place] << passed & _ALL
        self._until_us[place] = (interval + 1) * timeout_us
