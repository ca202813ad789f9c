"""Many frames in one piece of memory, as wrcd/bus/c/wrcd_frame.h has them."""

import struct
from collections.abc import Iterator, Sequence

from wrcd.bus.frame import ERROR, EXTENDED, ID_BITS, REMOTE, STANDARD_BITS, Frame

RECORD = struct.Struct("=qIBBH8s")  # stamp, the kernel's word, length, flags, reserved, data
FD_RECORD = struct.Struct("=qIBBH64s")
_FD = 4  # a flag


class FrameBatch:
    """Frames that are made only when they are looked at. records: one behind the other, RECORD's or FD_RECORD's."""

    __slots__ = ("_kind", "records")

    def __init__(self, records: bytes, fd: bool = False) -> None:
        self.records, self._kind = records, FD_RECORD if fd else RECORD

    @classmethod
    def of(cls, frames: Sequence[Frame]) -> "FrameBatch":
        """Of frames; a DLC above 8 is not kept."""
        fd = any(f.fd for f in frames)
        kind = FD_RECORD if fd else RECORD
        return cls(b"".join(_record(kind, f) for f in frames), fd)

    @property
    def stride(self) -> int:
        """Bytes of a record."""
        return self._kind.size

    def __len__(self) -> int:
        return len(self.records) // self._kind.size

    def __iter__(self) -> Iterator[Frame]:
        for stamp_us, word, length, flags, _, data in self._kind.iter_unpack(self.records):
            yield frame_of(stamp_us, word, data[:length], bool(flags & _FD))

    def frame(self, k: int) -> Frame:
        """The k-th of them."""
        stamp_us, word, length, flags, _, data = self._kind.unpack_from(self.records, k * self._kind.size)
        return frame_of(stamp_us, word, data[:length], bool(flags & _FD))


def joined(first: FrameBatch | list[Frame], second: FrameBatch | list[Frame]) -> FrameBatch | list[Frame]:
    """One behind the other."""
    if not first:
        return second
    if isinstance(first, FrameBatch) and isinstance(second, FrameBatch) and first.stride == second.stride:
        return FrameBatch(first.records + second.records, first.stride == FD_RECORD.size)
    return [*first, *second]


def frame_of(stamp_us: int, word: int, data: bytes, fd: bool = False) -> Frame:
    """The frame of the kernel's word and so many bytes."""
    number = word & (ID_BITS if word & (EXTENDED | ERROR) else STANDARD_BITS)
    if number == word and not fd:
        return Frame(stamp_us, number, data)
    if word & ERROR:
        return Frame(stamp_us, number, data, error=True)
    if word & REMOTE:  # it asks for so many bytes, and has none
        return Frame(stamp_us, number, b"", bool(word & EXTENDED), remote=True, extra=len(data))
    return Frame(stamp_us, number, data, extended=bool(word & EXTENDED), fd=fd)


def word_of(f: Frame) -> int:
    """The kernel's word of a frame: its id and flags."""
    return f.can_id | EXTENDED * f.extended | REMOTE * f.remote | ERROR * f.error


def _record(kind: struct.Struct, f: Frame) -> bytes:
    return kind.pack(f.stamp_us, word_of(f), f.extra if f.remote else len(f.data), _FD * f.fd, 0, f.data)
