"""Counts that wrap round, of a sender that may start anew."""

import numpy as np
from numpy.typing import NDArray


def growth(values: NDArray[np.float64], modulo: int) -> NDArray[np.float64]:
    """By how much a count, (n,), grew from each frame to the next, (n - 1,).

    A count that falls has wrapped round, or its sender has started anew and counts from 0. The lesser growth of less
    than half the modulo is taken for the wrap; else what the count says is what has grown since the start.
    """
    steps = np.diff(values)
    wrapped = steps % modulo
    restarted = (steps < 0) & (wrapped >= modulo / 2)
    out: NDArray[np.float64] = np.where(restarted, values[1:], wrapped)
    return out
