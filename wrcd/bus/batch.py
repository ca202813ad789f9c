"""Many frames in one piece of memory, as wrcd/bus/c/wrcd_frame.h has them."""

import struct
from collections.abc import Iterator, Sequence

from wrcd.bus.frame import ERROR, EXTENDED, ID_BITS, REMOTE, STANDARD_BITS, Frame

RECORD = struct.Struct("=qIBBH8s")  # stamp, the kernel's word, length, flags, reserved, data
FD_RECORD = struct.Struct("=qIBBH64s")
_FD, _FD_BITS = 4, 3  # flags


class FrameBatch:
    """Frames that are made only when they are looked at. records: one behind the other, RECORD's or FD_RECORD's."""

    __slots__ = ("kind", "records")

    def __init__(self, records: bytes, fd: bool = False) -> None:
        self.records, self.kind = records, FD_RECORD if fd else RECORD

    @classmethod
    def of(cls, frames: Sequence[Frame]) -> "FrameBatch":
        """Of frames; a DLC above 8 is not kept."""
        fd = any(f.fd for f in frames)
        kind = FD_RECORD if fd else RECORD
        return cls(b"".join(_record(kind, f) for f in frames), fd)

    @property
    def stride(self) -> int:
        """Bytes of a record."""
        return self.kind.size

    def __len__(self) -> int:
        return len(self.records) // self.kind.size

    def __iter__(self) -> Iterator[Frame]:
        for stamp_us, word, length, flags, _, data in self.kind.iter_unpack(self.records):
            yield frame_of(stamp_us, word, data[:length], flags)

    def frame(self, k: int) -> Frame:
        """The k-th of them."""
        stamp_us, word, length, flags, _, data = self.kind.unpack_from(self.records, k * self.stride)
        return frame_of(stamp_us, word, data[:length], flags)


def joined(first: FrameBatch, second: FrameBatch) -> FrameBatch:
    """One behind the other."""
    if not first:
        return second
    if first.kind is second.kind:
        return FrameBatch(first.records + second.records, first.kind is FD_RECORD)
    return FrameBatch.of([*first, *second])


def frame_of(stamp_us: int, word: int, data: bytes, flags: int = 0) -> Frame:
    """The frame of the kernel's word and so many bytes."""
    number = word & (ID_BITS if word & (EXTENDED | ERROR) else STANDARD_BITS)
    if number == word and not flags:
        return Frame(stamp_us, number, data)
    if word & ERROR:
        return Frame(stamp_us, number, data, error=True)
    if word & REMOTE:  # it asks for so many bytes, and has none
        return Frame(stamp_us, number, b"", bool(word & EXTENDED), remote=True, extra=len(data))
    fd = bool(flags & _FD)
    return Frame(stamp_us, number, data, extended=bool(word & EXTENDED), fd=fd, extra=flags & _FD_BITS)


def word_of(f: Frame) -> int:
    """The kernel's word of a frame: its id and flags."""
    return f.can_id | EXTENDED * f.extended | REMOTE * f.remote | ERROR * f.error


def _record(kind: struct.Struct, f: Frame) -> bytes:
    flags = _FD | f.extra & _FD_BITS if f.fd else 0
    return kind.pack(f.stamp_us, word_of(f), f.extra if f.remote else len(f.data), flags, 0, f.data)
