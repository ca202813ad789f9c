"""What frames take of a bus."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

BIT_RATE = 500_000  # bit/s, where nobody says another
BEHIND = 13  # bits without stuffing: CRC delimiter, acknowledgement, end of frame, and the three between two frames
HEADS = {False: (19, 22), True: (39, 41)}  # from start of frame to DLC by extended: classical, FD
CRC = 15  # of a classical frame; stuff bits cover it
FD_CRC_16, FD_CRC_64 = 4 + 17 + 6, 4 + 21 + 7  # of up to 16 bytes, of more: stuff count, CRC, its fixed stuff bits


def bits(data_bytes: ArrayLike, extended: ArrayLike, fd: ArrayLike) -> NDArray[np.float64]:
    """Bits of frames on the wire, the three between two frames included, with the mean of fewest and most stuff bits:
    none, and one after the first five and each further four bits that they cover.

    All bits count as of the arbitration's rate: of an FD frame whose data is faster it is the most that it can take.
    """
    payload = 8.0 * np.asarray(data_bytes)
    extended, fd = np.asarray(extended, dtype=bool), np.asarray(fd, dtype=bool)
    (classical, flexible), (classical_29, flexible_29) = HEADS[False], HEADS[True]
    head = np.where(fd, np.where(extended, flexible_29, flexible), np.where(extended, classical_29, classical))
    covered = head + payload + np.where(fd, 0, CRC)
    apart = np.where(fd, np.where(payload > 128, FD_CRC_64, FD_CRC_16), 0)
    out: NDArray[np.float64] = covered + apart + BEHIND + 0.5 * ((covered - 1) // 4)
    return out
