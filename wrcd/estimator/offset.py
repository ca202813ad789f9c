"""What a sensor says while nothing happens: its bias, and the centrifugal force of a long curve."""

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.recursion import exponential, smoothed

Checkpoint = tuple[FloatArray, FloatArray]


class Offset:
    """Subtracts a running mean from every channel of every axle, before the filters.

    Left to the Kalman filters, a sensor's bias takes seconds to converge and until then looks like another contact
    condition. The mean of all that came so far, then of the last `ticks` (exponentially), is there from the first tick
    on.
    """

    STATE = {"mean": "_mean", "count": "_count"}

    def __init__(self, ticks: int, axles: int) -> None:
        self._ticks = float(ticks)
        self._mean: FloatArray = np.zeros((CHANNELS, axles))
        self._count: FloatArray = np.zeros((CHANNELS, axles))
        self._block = exponential(1.0 / self._ticks)
        self.newest_share = 1.0 - 1.0 / self._ticks  # what is left of a settled axle's deviation after its own tick

    def checkpoint(self) -> Checkpoint:
        """What has been learnt, for rollback()."""
        return self._mean, self._count

    def rollback(self, to: Checkpoint) -> None:
        """Undo everything since a checkpoint."""
        self._mean, self._count = to

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._mean[:, axle] = 0.0
        self._count[:, axle] = 0.0

    @property
    def settled(self) -> BoolArray:
        """(n,): which axles' mean is of the last ticks only."""
        return np.asarray((self._count >= self._ticks).all(axis=0))

    def deviation(self, z: FloatArray) -> FloatArray:
        """z (2, n) less its offset as known so far."""
        return z - self._mean

    def step(self, z: FloatArray, present: BoolArray) -> FloatArray:
        """Return z (2, n) less its offset. A channel that is not present teaches nothing."""
        self._count = np.minimum(self._count + present, self._ticks)
        gain = np.where(present, 1.0 / np.maximum(self._count, 1.0), 0.0)
        self._mean = self._mean + gain * np.where(present, z - self._mean, 0.0)
        return z - self._mean

    def step_settled(self, z: FloatArray) -> FloatArray:
        """The same for m ticks z (m, 2, n) that are all present, of axles that are settled."""
        mean = smoothed(self._block, self._mean, z)
        self._mean = mean[-1].copy()
        return z - mean[1:]
