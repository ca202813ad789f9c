"""The last frames, in one piece of memory that another process can read."""

import mmap
import os
import struct
from collections.abc import Iterator

from wrcd.bus.frame import Frame

# What a record tells: a frame came, a frame went, the clock closed ticks, the health of loop or link changed.
RECEIVED, SENT, ADVANCED, HEALTH = range(4)
_FD = 0x80
_EXTENDED, _REMOTE, _ERROR = 0x80000000, 0x40000000, 0x20000000
_RECORD = struct.Struct("<qIBBH8s")  # stamp, id and flags, length, kind, position's low bits, data
_LOW = 0xFFFF


class Overwritten(Exception):
    """The record is not there any more."""


class Ring:
    """Records of one size; the oldest is overwritten. Positions count all that there ever were.

    Of a CAN FD frame the first eight bytes are kept: none is ever used.
    """

    def __init__(self, records: int) -> None:
        """Raises OSError where there is no such memory."""
        # a length that a turn of the low bits does not divide: what has been overwritten shows
        self.records = records + (records % (_LOW + 1) == 0)
        size = self.records * _RECORD.size
        self.fd = os.memfd_create("wrcd-ring")
        os.ftruncate(self.fd, size)
        self._memory = mmap.mmap(self.fd, size)
        self.end = 0

    def put(self, kind: int, stamp_us: int, word: int = 0, data: bytes = b"") -> None:
        """One record."""
        end = self.end
        at = end % self.records * _RECORD.size
        _RECORD.pack_into(self._memory, at, stamp_us, word, min(len(data), 8), kind, end & _LOW, data)
        self.end = end + 1

    def put_frame(self, kind: int, f: Frame) -> None:
        """A frame."""
        word = f.can_id
        if f.extended or f.remote or f.error or f.fd:
            word |= _EXTENDED * f.extended | _REMOTE * f.remote | _ERROR * f.error
            kind |= _FD * f.fd
        self.put(kind, f.stamp_us, word, f.data)

    def since(self, position: int) -> Iterator[tuple[int, Frame]]:
        """Kinds and records from a position on, oldest first; what is no frame has only a stamp. Raises Overwritten."""
        return read_ring(self._memory, position, self.end)

    def holds(self, position: int, more: int = 0) -> bool:
        """Whether nothing since a position has been overwritten, nor will be by so many more."""
        return self.end + more - position <= self.records

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()
        os.close(self.fd)


def read_ring(memory: bytes | mmap.mmap, position: int, end: int) -> Iterator[tuple[int, Frame]]:
    """What Ring.since says, from its memory or a copy of it."""
    records = len(memory) // _RECORD.size
    for at in range(position, end):
        stamp_us, word, length, kind, low, data = _RECORD.unpack_from(memory, at % records * _RECORD.size)
        if low != at & _LOW:
            raise Overwritten
        remote = bool(word & _REMOTE)
        # a remote frame has a length but no data, and no log can tell
        kept = b"" if remote else data[:length]
        frame = Frame(
            stamp_us, word & 0x1FFFFFFF, kept, bool(word & _EXTENDED), remote, bool(word & _ERROR), bool(kind & _FD)
        )
        yield kind & ~_FD, frame
