"""Adhesion by class, as the daemon's Surface has them, over the way and over the time."""

import numpy as np
from numpy.typing import NDArray

from wrcd.core.vocabulary import SURFACES

NOT_VALID = "not Valid"
CLASSES = (*(name for _, name in SURFACES), NOT_VALID)  # the most slippery last but one
_LOWS = np.array(sorted(low for low, _ in SURFACES))[1:]  # from which the next better one begins
N = len(CLASSES)

FloatArray = NDArray[np.float64]


def classes(valid: NDArray[np.bool_], mu_pct: FloatArray) -> NDArray[np.int64]:
    """The place in CLASSES of each frame (n,): what is not Valid, or says no adhesion, is of none of the surfaces."""
    better = np.searchsorted(_LOWS, mu_pct, side="right")
    return np.where(valid & np.isfinite(mu_pct), N - 2 - better, N - 1)


class Bins:
    """What falls into equal steps (of way or time), by class. It grows as the log goes on."""

    def __init__(self, step: float) -> None:
        self.step = step
        self._sums = np.zeros((0, N))

    def add(self, at: FloatArray, of: NDArray[np.int64], amounts: FloatArray) -> None:
        """Amounts (n,) of classes at places of the way or time (n,), from 0 on."""
        if not len(at):
            return
        steps = (at / self.step).astype(np.int64)
        missing = int(steps.max()) + 1 - len(self._sums)
        if missing > 0:
            self._sums = np.concatenate((self._sums, np.zeros((missing, N))))
        self._sums += np.bincount(steps * N + of, amounts, self._sums.size).reshape(-1, N)

    @property
    def total(self) -> FloatArray:
        """(N,), of all steps."""
        return np.asarray(self._sums.sum(axis=0), dtype=np.float64)

    def merged(self, step: float) -> FloatArray:
        """(n, N) by a step that is a multiple of the own one."""
        return merged(self._sums, round(step / self.step))


def merged(sums: FloatArray, many: int) -> FloatArray:
    """(ceil(n / many), N): so many steps as one; the last may be shorter."""
    if many == 1 or not len(sums):
        return sums
    return np.add.reduceat(sums, np.arange(0, len(sums), many), axis=0)
