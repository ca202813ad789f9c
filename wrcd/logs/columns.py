"""A stretch of a log by columns: lines to arrays, as many at once as are regular.

A line is regular if candump wrote it so: "(1700000000.123456) can0 091#0011223344556677", perhaps with nine decimals
(all lines then), and with " R" or " T" behind it. Everything else goes the ordinary way.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import EXTENDED, ID_BITS, Frame
from wrcd.native import library

IntArray = NDArray[np.int64]
MIN_ROWS, MAX_ROWS = 32, 5000  # fewer at once are not worth it, more need memory
_RECORD, _FD_RECORD = (
    np.dtype([("stamp_us", "i8"), ("word", "u4"), ("length", "u1"), ("flags", "u1"), ("rest", "u2"), ("data", "u1", n)])
    for n in (8, 64)
)
_FD = 4  # a flag
_ENDS = (18, 21)  # where the bracket behind a stamp of micro- or nanoseconds is


@dataclass(frozen=True, slots=True)
class Stretch:
    """Frames of one channel in the order of the log, all of them plain."""

    channel: str
    stamps_us: IntArray  # (k,)
    ids: IntArray
    extended: NDArray[np.bool_]
    lengths: IntArray
    data: NDArray[np.uint8]  # (k, 8), zeros behind the data

    def __len__(self) -> int:
        return len(self.stamps_us)

    @property
    def keys(self) -> IntArray:
        """Identities of their messages (Frame.key)."""
        return self.ids | np.where(self.extended, EXTENDED, 0)

    @property
    def batch(self) -> FrameBatch:
        """The same in one piece."""
        return batch_of(self.stamps_us, self.keys, self.lengths, self.data)

    def frame(self, k: int) -> Frame:
        """One of them."""
        return Frame(
            int(self.stamps_us[k]), int(self.ids[k]), self.data[k, : self.lengths[k]].tobytes(), bool(self.extended[k])
        )

    def part(self, first: int, end: int) -> "Stretch":
        """Frames first … end - 1."""
        return Stretch(
            self.channel, self.stamps_us[first:end], self.ids[first:end], self.extended[first:end],
            self.lengths[first:end], self.data[first:end],
        )  # fmt: skip

    @staticmethod
    def runs(flags: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
        """Where runs of equal flags begin and end."""
        return itertools.pairwise([0, *(np.flatnonzero(flags[1:] != flags[:-1]) + 1).tolist(), len(flags)])

    def frames(self) -> Iterator[Frame]:
        """All of them."""
        return map(self.frame, range(len(self)))


def batch_of(
    stamps_us: IntArray, keys: IntArray, lengths: NDArray[Any], data: NDArray[np.uint8], fd: bool = False
) -> FrameBatch:
    """Frames of columns, with data (n, up to 8, of CAN FD 64)."""
    out = np.zeros(len(stamps_us), dtype=_FD_RECORD if fd else _RECORD)
    out["stamp_us"], out["word"], out["length"], out["flags"] = stamps_us, keys, lengths, _FD * fd
    out["data"][:, : data.shape[1]] = data[:, : out["data"].shape[1]]
    return FrameBatch(out.tobytes(), fd)


Item = Stretch | tuple[Frame, str]


def stretches(frames: Iterable[tuple[Frame, str]]) -> Iterator[Item]:
    """The same frames and channels: those that are plain, many at once."""
    held: list[Frame] = []
    of = ""
    for frame, channel in frames:
        if held and (not frame.plain or channel != of or len(held) >= MAX_ROWS):
            yield _stretch(held, of)
            held = []
        if frame.plain:
            held.append(frame)
            of = channel
        else:
            yield frame, channel
    if held:
        yield _stretch(held, of)


def _stretch(frames: Sequence[Frame], channel: str) -> Stretch:
    whole = b"".join([f.data.ljust(8, b"\0") for f in frames])
    return Stretch(
        channel,
        np.array([f.stamp_us for f in frames], dtype=np.int64),
        np.array([f.can_id for f in frames], dtype=np.int64),
        np.array([f.extended for f in frames]),
        np.array([len(f.data) for f in frames], dtype=np.int64),
        np.frombuffer(whole, dtype=np.uint8).reshape(-1, 8),
    )


def parse_lines(text: bytes) -> tuple[Stretch, NDArray[np.bool_], IntArray, IntArray] | None:
    """Whole candump lines: the regular ones, which of the lines they are, and where each line begins and ends.

    None where that is not worth it.
    """
    ends = np.flatnonzero(np.frombuffer(text, dtype=np.uint8) == ord("\n")).astype(np.int64, copy=False)
    bracket = text.find(b") ", _ENDS[0])
    begin = bracket + 2  # of the channel
    head = text.find(b" ", begin) + 1  # where the id begins
    channel = text[begin : head - 1]
    if len(ends) < MIN_ROWS or bracket not in _ENDS or not 0 < head <= begin + 17 or channel.split() != [channel]:
        return None
    frames, regular = np.zeros(len(ends), dtype=_RECORD), np.zeros(len(ends), dtype=bool)
    library().wrcd_read_lines(text, len(ends), ends.ctypes.data, bracket, head, frames.ctypes.data, regular.ctypes.data)
    words, name = frames["word"], channel.decode(errors="replace")
    ids, lengths = (words & ID_BITS).astype(np.int64), frames["length"].astype(np.int64)
    whole = Stretch(name, frames["stamp_us"], ids, words >= EXTENDED, lengths, frames["data"])
    return whole, regular, np.concatenate(([0], ends[:-1] + 1)), ends
