"""Counts that wrap round, of a sender that may start anew."""

import numpy as np
from numpy.typing import NDArray


def restarted(values: NDArray[np.float64], modulo: float) -> NDArray[np.bool_]:
    """Where a count, (n,), began anew before a frame, (n - 1,): it fell, and had it wrapped round it would have grown
    by half the modulo or more."""
    steps = np.diff(values)
    out: NDArray[np.bool_] = (steps < 0) & (steps % modulo >= modulo / 2)
    return out


def growth(values: NDArray[np.float64], modulo: float, anew: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """By how much a count, (n,), grew from each frame to the next, (n - 1,). Where it began anew (None: as it tells
    itself) what it says has grown since."""
    anew = restarted(values, modulo) if anew is None else anew
    out: NDArray[np.float64] = np.where(anew, values[1:], np.diff(values) % modulo)
    return out
