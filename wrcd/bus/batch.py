"""Many classical frames in one piece of memory, as wrcd/bus/c/wrcd_frame.h has them."""

import struct
from collections.abc import Iterator, Sequence

from wrcd.bus.frame import ERROR, EXTENDED, ID_BITS, REMOTE, STANDARD_BITS, Frame

RECORD = struct.Struct("=qIBBH8s")  # stamp, the kernel's word, length, flags, reserved, data


class FrameBatch:
    """Frames that are made only when they are looked at. records: one behind the other."""

    __slots__ = ("records",)

    def __init__(self, records: bytes) -> None:
        self.records = records

    @classmethod
    def of(cls, frames: Sequence[Frame]) -> "FrameBatch":
        """Of classical frames; a DLC above 8 is not kept. Raises ValueError for one of CAN FD."""
        if any(f.fd for f in frames):
            raise ValueError("a batch holds no CAN FD frame")
        return cls(b"".join(map(_record, frames)))

    def __len__(self) -> int:
        return len(self.records) // RECORD.size

    def __iter__(self) -> Iterator[Frame]:
        for stamp_us, word, length, _, _, data in RECORD.iter_unpack(self.records):
            yield frame_of(stamp_us, word, data[:length])

    def frame(self, k: int) -> Frame:
        """The k-th of them."""
        stamp_us, word, length, _, _, data = RECORD.unpack_from(self.records, k * RECORD.size)
        return frame_of(stamp_us, word, data[:length])


def joined(first: FrameBatch | list[Frame], second: FrameBatch | list[Frame]) -> FrameBatch | list[Frame]:
    """One behind the other."""
    if not first:
        return second
    if isinstance(first, FrameBatch) and isinstance(second, FrameBatch):
        return FrameBatch(first.records + second.records)
    return [*first, *second]


def frame_of(stamp_us: int, word: int, data: bytes) -> Frame:
    """The classical frame of the kernel's word and so many bytes."""
    number = word & (ID_BITS if word & (EXTENDED | ERROR) else STANDARD_BITS)
    if number == word:
        return Frame(stamp_us, number, data)
    if word & ERROR:
        return Frame(stamp_us, number, data, error=True)
    if word & REMOTE:  # it asks for so many bytes, and has none
        return Frame(stamp_us, number, b"", bool(word & EXTENDED), remote=True, extra=len(data))
    return Frame(stamp_us, number, data, extended=True)


def word_of(f: Frame) -> int:
    """The kernel's word of a frame: its id and flags."""
    return f.can_id | EXTENDED * f.extended | REMOTE * f.remote | ERROR * f.error


def _record(f: Frame) -> bytes:
    return RECORD.pack(f.stamp_us, word_of(f), f.extra if f.remote else len(f.data), 0, 0, f.data)
