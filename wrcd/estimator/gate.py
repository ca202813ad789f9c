"""One absurd sample is left out; several in a row are no accident, and what was known before them does not hold."""

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, MODELS, FloatArray

# An innovation is absurd if it is this many times its usual size for every model. Of 330,000 in the rig's scenarios,
# changes of rail included, the largest was 4.2 times.
ABSURD = 5.0
MEMORY_TICKS = 100.0  # over which the usual size is taken
LEAST_TICKS = 20.0  # before it is known well enough to judge by
MOST_IN_A_ROW = 3


class Gate:
    """Judges innovations by their running mean square, per model, channel and axle."""

    STATE = ("_power", "_count", "_row")

    def __init__(self, axles: int) -> None:
        self._power: FloatArray = np.zeros((MODELS, CHANNELS, axles))
        self._count: FloatArray = np.zeros((CHANNELS, axles))
        self._row: FloatArray = np.zeros((CHANNELS, axles))  # absurd ones in a row

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._power[:, :, axle] = 0.0
        self._count[:, axle] = 0.0
        self._row[:, axle] = 0.0

    def absurd(self, e: FloatArray, present: BoolArray) -> BoolArray:
        """Which samples (2, n) to leave out, by their innovations e (4, 2, n). Not finite is absurd, too."""
        with np.errstate(over="ignore", invalid="ignore"):
            usual: BoolArray = np.any(e * e <= ABSURD**2 * self._power, axis=0)
        known = (self._count >= LEAST_TICKS) | ~np.isfinite(e).all(axis=0)
        out: BoolArray = present & known & ~usual
        return out

    def learn(self, e: FloatArray, present: BoolArray, absurd: BoolArray) -> BoolArray:
        """Learn from the samples (present) that were used. Returns the axles (n,) where too many in a row were not."""
        self._row = np.where(absurd, self._row + 1.0, np.where(present, 0.0, self._row))
        self._count = np.minimum(self._count + present, MEMORY_TICKS)
        gain = np.where(present, 1.0 / np.maximum(self._count, 1.0), 0.0)
        self._power = self._power + gain * (e * e - self._power)
        out: BoolArray = np.any(self._row > MOST_IN_A_ROW, axis=0)
        return out
