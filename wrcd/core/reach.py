"""How well each input is reached: a register of eight bits, as chrony keeps of its servers, and the newest refusal."""

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.reasons import Reason
from wrcd.core.jitter_buffer import NEVER

BITS = 8
_ALL = (1 << BITS + 1) - 1  # one more: the interval that is not over yet
_LABELS = ("None", *(r.label for r in Reason))


class Reach:
    """Per input and axle, (quantities, n). A bit stands for one time-out that is over, the newest lowest; set: a good
    frame came in it."""

    STATE = ("_register", "_interval", "_rejected", "_rejected_us")

    def __init__(self, timeout_us: NDArray[np.int64]) -> None:
        self._timeout_us = np.maximum(timeout_us, 1)
        self._register: NDArray[np.int64] = np.zeros(timeout_us.shape, dtype=np.int64)
        self._interval: NDArray[np.int64] = np.zeros(timeout_us.shape, dtype=np.int64)
        self._rejected: NDArray[np.int64] = np.zeros(timeout_us.shape, dtype=np.int64)  # place in _LABELS
        self._rejected_us: NDArray[np.int64] = np.full(timeout_us.shape, NEVER, dtype=np.int64)

    def accept(self, quantity: int, axle: int, stamp_us: int) -> None:
        """A good frame."""
        self._shift(quantity, axle, stamp_us)
        self._register[quantity, axle] |= 1

    def reject(self, quantity: int, axle: int, stamp_us: int, reason: Reason) -> None:
        """A frame that was not taken."""
        self._rejected[quantity, axle] = _LABELS.index(reason.label)
        self._rejected_us[quantity, axle] = stamp_us

    def read(self, quantity: int, axle: int, now_us: int) -> tuple[int, str]:
        """The register, and the label of the newest refusal within it ("None")."""
        self._shift(quantity, axle, now_us)
        recent = now_us - self._rejected_us[quantity, axle] <= BITS * self._timeout_us[quantity, axle]
        register = int(self._register[quantity, axle]) >> 1
        return register, _LABELS[self._rejected[quantity, axle] if recent else 0]

    def reset(self) -> None:
        """A step of time: when anything came cannot be told any more."""
        self._register[:] = 0
        self._interval[:] = 0
        self._rejected_us[:] = NEVER

    def _shift(self, quantity: int, axle: int, now_us: int) -> None:
        interval = now_us // int(self._timeout_us[quantity, axle])
        passed = interval - int(self._interval[quantity, axle])
        if passed > 0:
            register = 0 if passed > BITS else int(self._register[quantity, axle]) << passed
            self._register[quantity, axle] = register & _ALL
            self._interval[quantity, axle] = interval
