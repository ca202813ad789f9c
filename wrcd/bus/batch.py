"""Frames as records: what the kernel or a log gave, many at once, without an object for each."""

from collections.abc import Iterator, Sequence
from struct import Struct
from typing import Any

import numpy as np

from wrcd.bus.frame import Frame

# As `wrcd_frame` in wrcd/bus/c/wrcd_frame.h. word: the id, with these flags.
RECORD = np.dtype(
    [("stamp_us", np.int64), ("word", np.uint32), ("length", np.uint8), ("flags", np.uint8), ("cause", np.uint16),
     ("data", np.uint8, 8)]
)  # fmt: skip
_LAYOUT = Struct("=qIBBH8s")
EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
Records = np.ndarray[Any, np.dtype[np.void]]


def records_of(frames: Sequence[Frame]) -> Records:
    """Classical frames as records."""
    packed = []
    for f in frames:
        word = f.can_id | EXTENDED * f.extended | REMOTE * f.remote | ERROR * f.error
        packed.append(_LAYOUT.pack(f.stamp_us, word, len(f.data), 0, 0, f.data))
    return np.frombuffer(b"".join(packed), dtype=RECORD)


def frames_of(records: Records) -> Iterator[Frame]:
    """The frames of records."""
    for stamp_us, word, length, _, _, data in _LAYOUT.iter_unpack(np.ascontiguousarray(records)):
        if word <= 0x7FF:  # almost always
            yield Frame(stamp_us, word, data[:length])
        else:
            extended = bool(word & EXTENDED)
            yield Frame(
                stamp_us, word & (0x1FFF_FFFF if extended else 0x7FF), data[:length], extended,
                remote=bool(word & REMOTE), error=bool(word & ERROR),
            )  # fmt: skip
