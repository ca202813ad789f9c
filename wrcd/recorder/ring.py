"""The last frames, in one piece of memory that another process can read."""

import mmap
import os
import struct
from collections.abc import Iterator, Sequence

import numpy as np

from wrcd.bus.batch import FrameBatch, word_of
from wrcd.bus.frame import ERROR, EXTENDED, ID_BITS, REMOTE, Frame

# What a record tells: a frame came, a frame went, the clock closed ticks, the health of loop or link changed.
RECEIVED, SENT, ADVANCED, HEALTH = range(4)
_FD = 0x80
_HEAD = "<qIBBH"  # stamp, id and flags, length, kind, position's low bits; data behind them
_CLASSICAL = np.dtype([("frame", "V13"), ("kind", "u1"), ("low", "<u2"), ("data", "V8")])  # as a batch has its frames
CLASSICAL_BYTES, FD_BYTES = 8, 64
_LOW = 0xFFFF


class Overwritten(Exception):
    """The record is not there any more."""


class Ring:
    """Records of one size; the oldest is overwritten. Positions count all that there ever were.

    Of each frame so many bytes of data are kept: all of a CAN FD frame only where one is used.
    """

    def __init__(self, records: int, data_bytes: int = CLASSICAL_BYTES) -> None:
        """Raises OSError where there is no such memory."""
        self.data_bytes = data_bytes
        self._record = record_of(data_bytes)
        # a length that a turn of the low bits does not divide: what has been overwritten shows
        self.records = records + (records % (_LOW + 1) == 0)
        size = self.records * self._record.size
        self.fd = os.memfd_create("wrcd-ring")
        os.ftruncate(self.fd, size)
        self._memory = mmap.mmap(self.fd, size)
        self.end = 0

    def put(self, kind: int, stamp_us: int, word: int = 0, data: bytes = b"") -> None:
        """One record."""
        end = self.end
        at, length = end % self.records * self._record.size, min(len(data), self.data_bytes)
        self._record.pack_into(self._memory, at, stamp_us, word, length, kind, end & _LOW, data)
        self.end = end + 1

    def put_frame(self, kind: int, f: Frame) -> None:
        """A frame."""
        self.put(kind | _FD * f.fd, f.stamp_us, word_of(f), f.data)

    def put_frames(self, kind: int, frames: FrameBatch | Sequence[Frame]) -> None:
        """Frames, of a batch as they are."""
        if not isinstance(frames, FrameBatch) or self.data_bytes != CLASSICAL_BYTES:
            for f in frames:
                self.put_frame(kind, f)
            return
        records = np.frombuffer(frames.records, _CLASSICAL).copy()
        records["kind"], records["low"] = kind, np.arange(self.end, self.end + len(records)) & _LOW
        while len(records):
            at = self.end % self.records
            part, records = records[: self.records - at], records[self.records - at :]
            self._memory[at * part.itemsize : (at + len(part)) * part.itemsize] = part.tobytes()
            self.end += len(part)

    def since(self, position: int) -> Iterator[tuple[int, Frame]]:
        """Kinds and records from a position on, oldest first; what is no frame has only a stamp. Raises Overwritten."""
        return read_ring(self._memory, position, self.end, self.data_bytes)

    def holds(self, position: int, more: int = 0) -> bool:
        """Whether nothing since a position has been overwritten, nor will be by so many more."""
        return self.end + more - position <= self.records

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()
        os.close(self.fd)


def record_of(data_bytes: int) -> struct.Struct:
    """A record with so many bytes of data."""
    return struct.Struct(f"{_HEAD}{data_bytes}s")


def read_ring(
    memory: bytes | mmap.mmap, position: int, end: int, data_bytes: int = CLASSICAL_BYTES
) -> Iterator[tuple[int, Frame]]:
    """What Ring.since says, from its memory or a copy of it."""
    record = record_of(data_bytes)
    records = len(memory) // record.size
    for at in range(position, end):
        stamp_us, word, length, kind, low, data = record.unpack_from(memory, at % records * record.size)
        if low != at & _LOW:
            raise Overwritten
        remote = bool(word & REMOTE)
        # a remote frame has a length but no data, and no log can tell
        kept = b"" if remote else data[:length]
        frame = Frame(
            stamp_us, word & ID_BITS, kept, bool(word & EXTENDED), remote, bool(word & ERROR), bool(kind & _FD)
        )
        yield kind & ~_FD, frame
