"""A stretch of a log by columns: lines to arrays, frames to samples, as many at once as are regular.

A line is regular if candump wrote it so: "(1700000000.123456) can0 091#0011223344556677", perhaps with nine decimals
(all lines then), and with " R" or " T" behind it. A message is regular in a
stretch if every frame of it passes all checks and its E2E counter goes on; its samples are then the same as those that
its reader gives for one frame after the other. Everything else goes the ordinary way.
"""

import itertools
import operator
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.batch import FrameBatch
from wrcd.bus.codec import MessageReader, Receiver, Sample
from wrcd.bus.e2e import crcs
from wrcd.bus.frame import EXTENDED, Frame

IntArray = NDArray[np.int64]
Samples = Sequence[Sample]
MIN_ROWS, MAX_ROWS = 32, 5000  # fewer at once are not worth it, more need memory
_RECORD = np.dtype([("stamp_us", "i8"), ("word", "u4"), ("length", "u1"), ("rest", "u1", 3), ("data", "u1", 8)])
_ENDS = (18, 21)  # where the bracket behind a stamp of micro- or nanoseconds is
_DIGITS = [*range(1, 11), *range(12, 18)]
_POWERS = 10 ** np.arange(15, -1, -1, dtype=np.int64)
_HEX = np.full(256, 255, dtype=np.uint8)
for _digits, _first in ((b"0123456789", 0), (b"ABCDEF", 10), (b"abcdef", 10)):
    for _k, _character in enumerate(_digits):
        _HEX[_character] = _first + _k


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
        out = np.zeros(len(self), dtype=_RECORD)
        out["stamp_us"], out["word"], out["length"], out["data"] = self.stamps_us, self.keys, self.lengths, self.data
        return FrameBatch(out.tobytes())

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
    buffer = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(buffer == ord("\n"))
    starts = np.concatenate(([0], ends[:-1] + 1))
    lengths = ends - starts
    # a direction behind the data
    last = buffer[np.maximum(ends - 1, 0)]
    directed = (buffer[np.maximum(ends - 2, 0)] == ord(" ")) & ((last == ord("R")) | (last == ord("T")))
    lengths = np.where(directed, lengths - 2, lengths)
    bracket = text.find(b")", _ENDS[0])
    begin = bracket + 2  # of the channel
    space = text.find(b" ", begin)
    if len(ends) < MIN_ROWS or bracket not in _ENDS or space < 0 or space > begin + 16:
        return None
    channel = text[begin:space]
    if channel.split() != [channel]:
        return None
    head = begin + len(channel) + 1
    digits_at = [*_DIGITS, *range(18, bracket)]
    k = len(ends)
    regular = np.zeros(k, dtype=bool)
    stamps, ids, sizes = np.zeros(k, dtype=np.int64), np.zeros(k, dtype=np.int64), np.zeros(k, dtype=np.int64)
    extended, data = np.zeros(k, dtype=bool), np.zeros((k, 8), dtype=np.uint8)
    for length in np.unique(lengths):
        rest = int(length) - head
        digits = 8 if rest % 2 else 3
        size = (rest - digits - 1) // 2
        if not 0 <= size <= 8:
            continue
        rows = np.flatnonzero(lengths == length)
        lines = buffer[starts[rows][:, None] + np.arange(length)]
        numbers = lines[:, digits_at] - np.uint8(ord("0"))
        nibbles = _HEX[lines[:, head:]]
        mark = nibbles[:, digits].copy()
        nibbles[:, digits] = 0
        good = (lines[:, [0, 11, bracket, begin - 1]] == np.frombuffer(b"(.) ", dtype=np.uint8)).all(axis=1)
        good &= (lines[:, begin:head] == np.frombuffer(channel + b" ", dtype=np.uint8)).all(axis=1)
        good &= (lines[:, head + digits] == ord("#")) & (mark == 255)
        good &= (numbers <= 9).all(axis=1) & (nibbles < 16).all(axis=1)
        identifier = nibbles[:, :digits].astype(np.int64) @ (16 ** np.arange(digits - 1, -1, -1, dtype=np.int64))
        good &= identifier <= (0x7FF if digits == 3 else 0x1FFFFFFF)
        regular[rows] = good
        stamps[rows] = numbers[:, :16].astype(np.int64) @ _POWERS
        ids[rows] = identifier
        sizes[rows], extended[rows] = size, digits == 8
        payload = nibbles[:, digits + 1 :]
        data[rows[:, None], np.arange(size)] = payload[:, ::2] << 4 | payload[:, 1::2]
    whole = Stretch(channel.decode(errors="replace"), stamps, ids, extended, sizes, data)
    return whole, regular, starts, ends


class ReadFrame(NamedTuple):
    """A mapped frame of a stretch."""

    place: int  # in the stretch
    stamp_us: int
    reader: MessageReader
    samples: Samples | None  # None: the reader is to be given the frame


class Columns:
    """Reads stretches for a receiver."""

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver

    def read(self, s: Stretch) -> list[ReadFrame]:
        """The frames that are mapped, in order. The E2E counters of those with samples have been followed."""
        out: list[ReadFrame] = []
        keys = s.keys
        for key, reader in self._receiver.readers.items():
            places = np.flatnonzero(keys == key)
            if not len(places):
                continue
            found = _regular(reader, s, places) if len(places) > 1 else None
            samples: Sequence[Samples | None] = [None] * len(places) if found is None else found
            stamps_us = s.stamps_us[places].tolist()
            out += map(ReadFrame, places.tolist(), stamps_us, itertools.repeat(reader), samples)
        out.sort(key=operator.itemgetter(0))
        return out


def _regular(reader: MessageReader, s: Stretch, rows: IntArray) -> list[Samples] | None:
    """The samples of one message's frames, if every one of them passes."""
    if reader.order is None or reader.fd or (s.lengths[rows] != reader.length).any():
        return None
    data, checker = s.data[rows], reader.checker
    counters = data[:, 1] & 0x0F
    if checker is not None and not checker.goes_on(counters.tolist()):
        return None
    if checker is not None and (crcs(data, checker.start, reader.length) != data[:, 0]).any():
        return None
    columns, is_degraded = reader.read_columns(data)
    if any(np.isnan(values).any() for values in columns):
        return None
    if checker is not None:
        checker.follow(int(counters[-1]), data[-1, : reader.length].tobytes(), int(s.stamps_us[rows[-1]]), len(rows))
    degraded = is_degraded.tolist()
    samples = [
        [Sample(signal.number, v, d) for v, d in zip(values.tolist(), degraded, strict=True)]
        for signal, values in zip(reader.signals, columns, strict=True)
    ]
    return list(zip(*samples, strict=True))
