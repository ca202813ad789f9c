"""What frames take of a bus."""

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.frame import EXTENDED
from wrcd.tools.monitor.batch import ERROR, FD, REMOTE, Batch

BIT_RATE = 500_000  # bit/s, where nobody says another


def bits(batch: Batch) -> NDArray[np.float64]:
    """Bits of each frame on the wire, the three between two frames included, with the mean of fewest and most stuff
    bits: one after the first five of the bits from start of frame to CRC, and one after every further four, at most.

    All bits count as of the arbitration's rate: of an FD frame whose data is faster it is the most that it can take.
    """
    payload = np.where(batch.flags & REMOTE, 0, batch.length) * 8
    covered = np.where(batch.key & EXTENDED, 54, 34) + payload
    tail = np.where(batch.flags & FD, np.where(payload > 128, 23, 19), 13)
    out = covered + tail + (covered - 1) // 4 / 2
    return np.where(batch.flags & ERROR, 0.0, out)
