"""Ticks that are over and wait for their block's end: the bank then runs on all of them at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.core.causes import Cause
from wrcd.core.inputs import TickInputs
from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.paper.window import BLOCK_TICKS
from wrcd.estimator.records import Ticks


@dataclass(init=False, repr=False, eq=False)
class Block:
    """Up to BLOCK_TICKS ticks on end, and what speaks against each of them."""

    _z: FloatArray
    _present: BoolArray
    _torque_ratio: FloatArray
    speeds_m_s: list[float]
    speed_jumped: list[bool]  # by tick
    _fast: list[bool]
    unavailable: list[list[bool]]  # by tick and axle: an input had been silent for too long
    causes: list[list[Cause]]  # likewise: what speaks against it
    number: int = 0  # of the first tick
    _count: int = 0

    def __init__(self, axles: int) -> None:
        self._z = np.zeros((BLOCK_TICKS, CHANNELS * axles))
        self._present = np.zeros((BLOCK_TICKS, CHANNELS * axles), dtype=bool)
        self._torque_ratio = np.zeros((BLOCK_TICKS, axles))
        self.speeds_m_s = [0.0] * BLOCK_TICKS
        self.speed_jumped = [False] * BLOCK_TICKS
        self._fast = [False] * BLOCK_TICKS
        self.unavailable = [[False] * axles for _ in range(BLOCK_TICKS)]
        self.causes = [[Cause.NONE] * axles for _ in range(BLOCK_TICKS)]

    def __len__(self) -> int:
        return self._count

    def clear(self) -> None:
        """Begin the next block."""
        self._count = 0

    def add(self, number: int, tick: TickInputs, causes: Sequence[Cause], fast_enough: bool) -> None:
        """A tick is over; what speaks against it by axle; whether the train is fast enough for an estimate."""
        k = self._count
        if k == 0:
            self.number = number
        self._count = k + 1
        self._z[k] = tick.z
        self._present[k] = True if tick.present is None else tick.present
        self._torque_ratio[k] = tick.torque_ratio
        self.speeds_m_s[k], self.speed_jumped[k] = abs(tick.speed_m_s), tick.speed_jumped
        self._fast[k] = fast_enough
        self.causes[k] = list(causes)
        self.unavailable[k] = [axle in tick.unavailable for axle in range(len(causes))]

    def ticks(self) -> Ticks:
        """All of them, for the estimator; what is present may still be masked."""
        m, shape = self._count, (self._count, CHANNELS, -1)
        return Ticks(
            self.number, self._z[:m].reshape(shape), self._present[:m].reshape(shape), self._torque_ratio[:m],
            self.speeds_m_s[:m],
        )  # fmt: skip

    def running(self, k: int) -> list[bool]:
        """Which axles have what an estimate needs."""
        if not self._fast[k] or self.speed_jumped[k]:
            return [False] * len(self.unavailable[k])
        return [not silent for silent in self.unavailable[k]]

    @property
    def is_sound(self) -> bool:
        """Whether every axle has what an estimate needs in every tick, and nothing speaks against them."""
        return all(
            self._fast[j] and not self.speed_jumped[j] and True not in self.unavailable[j] and not any(self.causes[j])
            for j in range(self._count)
        )
