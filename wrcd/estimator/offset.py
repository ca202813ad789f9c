"""What a sensor says while nothing happens: its bias, and the centrifugal force of a long curve."""

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray


class Offset:
    """Running mean of every channel of every axle, taken off before the filters.

    Filters that start from nothing would have to learn a bias, for seconds, and meanwhile look like another contact.
    The mean of all that came so far, then of the last `ticks` (exponentially), is there from the first tick on.
    """

    STATE = ("_mean", "_count")

    def __init__(self, ticks: int, axles: int) -> None:
        self._ticks = float(ticks)
        self._mean: FloatArray = np.zeros((CHANNELS, axles))
        self._count: FloatArray = np.zeros((CHANNELS, axles))

    @property
    def known(self) -> tuple[FloatArray, FloatArray]:
        """What has been learnt, to be put back if a sample turns out to be absurd."""
        return self._mean, self._count

    @known.setter
    def known(self, before: tuple[FloatArray, FloatArray]) -> None:
        self._mean, self._count = before

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._mean[:, axle] = 0.0
        self._count[:, axle] = 0.0

    def without(self, z: FloatArray) -> FloatArray:
        """z (2, n) without its offset as known so far."""
        return z - self._mean

    def take(self, z: FloatArray, present: BoolArray) -> FloatArray:
        """z (2, n) without its offset; a channel that is not present teaches nothing."""
        self._count = np.minimum(self._count + present, self._ticks)
        gain = np.where(present, 1.0 / np.maximum(self._count, 1.0), 0.0)
        self._mean = self._mean + gain * np.where(present, z - self._mean, 0.0)
        return z - self._mean
