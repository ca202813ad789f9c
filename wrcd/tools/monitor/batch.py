"""Frames, many at once: as arrays, and as the bytes that go from the reader to the screen."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.columns import Stretch
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.tools.monitor.packing import CLASSICAL, ERROR, FD, REMOTE, pack

_FIELDS = [("stamp_us", "<i8"), ("key", "<u4"), ("flags", "u1"), ("extra", "u1"), ("length", "u1")]
DTYPES = {width: np.dtype([*_FIELDS, ("data", "u1", (width,))]) for width in CLASSICAL}


@dataclass(frozen=True, slots=True)
class Batch:
    """k frames in the order of their arrival."""

    stamp_us: NDArray[np.int64]
    key: NDArray[np.int64]  # Frame.key
    flags: NDArray[np.uint8]  # REMOTE, ERROR, FD
    extra: NDArray[np.uint8]  # Frame.extra
    length: NDArray[np.int64]
    data: NDArray[np.uint8]  # (k, 8), or (k, 64) where one is longer; zeros behind the data

    def __len__(self) -> int:
        return len(self.stamp_us)

    @classmethod
    def of_bytes(cls, width: int, packed: bytes) -> "Batch":
        """What pack() wrote."""
        rows = np.frombuffer(packed, dtype=DTYPES[width])
        return cls(
            rows["stamp_us"].astype(np.int64), rows["key"].astype(np.int64), rows["flags"].copy(),
            rows["extra"].copy(), rows["length"].astype(np.int64), rows["data"].copy(),
        )  # fmt: skip

    @classmethod
    def of_frames(cls, frames: Sequence[Frame]) -> "Batch":
        """Of single ones."""
        return cls.of_bytes(*pack(frames))

    @classmethod
    def of_stretch(cls, s: Stretch) -> "Batch":
        """Of a log's."""
        none = np.zeros(len(s), dtype=np.uint8)
        return cls(s.stamps_us, s.keys, none, none, s.lengths, s.data)

    @classmethod
    def joined(cls, parts: Sequence["Batch"]) -> "Batch":
        """One after the other, as wide as the widest."""
        if len(parts) == 1:
            return parts[0]
        width = max(b.data.shape[1] for b in parts)
        columns = [np.concatenate([getattr(b, name) for b in parts]) for name in cls.__slots__[:-1]]
        columns.append(np.concatenate([np.pad(b.data, ((0, 0), (0, width - b.data.shape[1]))) for b in parts]))
        return cls(*columns)

    def only(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> "Batch":
        """Some of them, or in another order."""
        return Batch(*(getattr(self, name)[rows] for name in Batch.__slots__))

    def within(self, begin_us: int, end_us: int) -> "Batch":
        """The frames stamped from a time until before another."""
        return self.only((self.stamp_us >= begin_us) & (self.stamp_us < end_us))

    def frame(self, k: int) -> Frame:
        """One of them."""
        key, flags = int(self.key[k]), int(self.flags[k])
        return Frame(
            int(self.stamp_us[k]), key & ~EXTENDED, self.data[k, : self.length[k]].tobytes(),
            bool(key & EXTENDED), bool(flags & REMOTE), bool(flags & ERROR), bool(flags & FD), int(self.extra[k]),
        )  # fmt: skip

    def frames(self) -> Iterable[Frame]:
        """One after the other."""
        return map(self.frame, range(len(self)))


__all__ = ["DTYPES", "ERROR", "FD", "REMOTE", "Batch"]
