"""The last frames, in one piece of memory that another process can read."""

import mmap
import os
import struct
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from wrcd.bus.batch import FrameBatch, word_of
from wrcd.bus.frame import ERROR, EXTENDED, ID_BITS, REMOTE, Frame

RECEIVED, SENT = range(2)
_FD = 0x80
_HEAD = "<qIBBH"  # stamp, id and flags, length, kind, position's low bits; data behind them
_CLASSICAL = np.dtype([("frame", "V13"), ("kind", "u1"), ("low", "<u2"), ("data", "V8")])  # as a batch has its frames
CLASSICAL_BYTES, FD_BYTES = 8, 64
_LOW = 0xFFFF


class Overwritten(Exception):
    """A record is not there any more."""


class Ring:
    """Records of one size; the oldest is overwritten. Positions count all that there ever were.

    Of each frame so many bytes of data are kept: all of a CAN FD frame only where one is used.
    """

    def __init__(self, records: int, data_bytes: int = CLASSICAL_BYTES) -> None:
        """Raises OSError where there is no such memory."""
        self.data_bytes = data_bytes
        self._record = _record_of(data_bytes)
        # a length that a turn of the low bits does not divide: what has been overwritten shows
        self.records = records + (records % (_LOW + 1) == 0)
        size = self.records * self._record.size
        self.fd = os.memfd_create("wrcd-ring")
        os.ftruncate(self.fd, size)
        self._memory = mmap.mmap(self.fd, size)
        self.end = 0

    def put_frame(self, kind: int, f: Frame) -> None:
        """A frame."""
        end, length = self.end, min(len(f.data), self.data_bytes)
        at, kind = end % self.records * self._record.size, kind | _FD * f.fd
        self._record.pack_into(self._memory, at, f.stamp_us, word_of(f), length, kind, end & _LOW, f.data)
        self.end = end + 1

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

    def stamp_us(self, position: int) -> int:
        """The stamp of a frame that is still there."""
        return int(self._record.unpack_from(self._memory, position % self.records * self._record.size)[0])

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()
        os.close(self.fd)


def _record_of(data_bytes: int) -> struct.Struct:
    return struct.Struct(f"{_HEAD}{data_bytes}s")


def read_ring(fd: int, data_bytes: int, first: int, end: int) -> Iterator[tuple[int, Frame]]:
    """Kinds and frames from position first to end, oldest first, of a ring's memory, which the call copies. Taking them
    raises Overwritten."""
    record, size = _record_of(data_bytes), os.fstat(fd).st_size
    begin, stop = first * record.size % size, end * record.size % size
    whole = begin < stop or first == end
    memory = os.pread(fd, stop - begin, begin) if whole else os.pread(fd, size - begin, begin) + os.pread(fd, stop, 0)
    return _frames(record.iter_unpack(memory), first)


def _frames(records: Iterable[tuple[Any, ...]], first: int) -> Iterator[tuple[int, Frame]]:
    for at, (stamp_us, word, length, kind, low, data) in enumerate(records, first):
        if low != at & _LOW:
            raise Overwritten
        remote = bool(word & REMOTE)
        # a remote frame has a length but no data, and no log can tell
        kept = b"" if remote else data[:length]
        extended, error, fd_frame = bool(word & EXTENDED), bool(word & ERROR), bool(kind & _FD)
        yield kind & ~_FD, Frame(stamp_us, word & ID_BITS, kept, extended, remote, error, fd_frame)
