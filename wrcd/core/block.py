"""Ticks that are over and wait for their block's end: the bank then runs on all of them at once."""

from collections.abc import Sequence

import numpy as np

from wrcd.core.causes import Cause
from wrcd.core.inputs import TickInputs
from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.records import Ticks
from wrcd.estimator.window import BLOCK_TICKS


class Block:
    """Up to BLOCK_TICKS ticks on end, and what speaks against each of them."""

    STATE = {
        "first_tick": "number", "ticks": "_count", "measurements": "_z", "present": "_present",
        "torque_ratio": "_torque_ratio", "speeds_m_s": "_speeds_m_s", "speed_jumped": "_speed_jumped",
        "fast_enough": "_fast", "unavailable": "_unavailable", "causes": "_causes",
    }  # fmt: skip

    def __init__(self, axles: int) -> None:
        self.number = 0  # of the first tick
        self._count = 0
        self._z: FloatArray = np.zeros((BLOCK_TICKS, CHANNELS * axles))
        self._present: BoolArray = np.zeros((BLOCK_TICKS, CHANNELS * axles), dtype=bool)
        self._torque_ratio: FloatArray = np.zeros((BLOCK_TICKS, axles))
        self._speeds_m_s = [0.0] * BLOCK_TICKS
        self._speed_jumped = [False] * BLOCK_TICKS
        self._fast = [False] * BLOCK_TICKS
        self._unavailable = [[False] * axles for _ in range(BLOCK_TICKS)]
        self._causes = [[Cause.NONE] * axles for _ in range(BLOCK_TICKS)]

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
        self._speeds_m_s[k], self._speed_jumped[k] = abs(tick.speed_m_s), tick.speed_jumped
        self._fast[k] = fast_enough
        self._causes[k] = list(causes)
        self._unavailable[k] = [axle in tick.unavailable for axle in range(len(causes))]

    def ticks(self) -> Ticks:
        """All of them, for the estimator; what is present may still be masked."""
        m, shape = self._count, (self._count, CHANNELS, -1)
        return Ticks(
            self.number, self._z[:m].reshape(shape), self._present[:m].reshape(shape), self._torque_ratio[:m],
            self._speeds_m_s[:m],
        )  # fmt: skip

    def jumped(self, k: int) -> bool:
        """Whether the speed jumped in a tick."""
        return self._speed_jumped[k]

    def speed_m_s(self, k: int) -> float:
        """The speed in a tick."""
        return self._speeds_m_s[k]

    def unavailable(self, k: int, axle: int) -> bool:
        """Whether an input of an axle had been silent for too long."""
        return self._unavailable[k][axle]

    def causes(self, k: int) -> Sequence[Cause]:
        """What speaks against a tick, by axle."""
        return self._causes[k]

    def running(self, k: int) -> list[bool]:
        """Which axles have what an estimate needs."""
        if not self._fast[k] or self._speed_jumped[k]:
            return [False] * len(self._unavailable[k])
        return [not silent for silent in self._unavailable[k]]

    @property
    def is_sound(self) -> bool:
        """Whether every axle has what an estimate needs in every tick, and nothing speaks against them."""
        return all(
            self._fast[j]
            and not self._speed_jumped[j]
            and True not in self._unavailable[j]
            and not any(self._causes[j])
            for j in range(self._count)
        )
