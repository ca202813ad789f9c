"""What is held of a bus: frames many at once as arrays, the newest of them as they came, and columns that grow."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.frame import EXTENDED, Frame
from wrcd.logs.columns import Stretch
from wrcd.monitor.bus_reader import WIDTHS, pack

_FIELDS = [("stamp_us", "<i8"), ("key", "<u4"), ("flags", "u1"), ("extra", "u1"), ("length", "u1")]
_DTYPES = {width: np.dtype([*_FIELDS, ("data", "u1", (width,))]) for width in WIDTHS}
REMOTE, ERROR, FD = 1, 2, 4  # bits of flags, as reader.pack() sets them
MIN_FRAMES = 1_000  # of a batch that is kept as it is: of a smaller one the arrays cost more than the frames
FIRST_ROWS = 256
NO_ROWS = np.zeros(0, np.int64)


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
        """Return what pack() wrote."""
        rows = np.frombuffer(packed, dtype=_DTYPES[width])
        return cls(
            rows["stamp_us"].astype(np.int64), rows["key"].astype(np.int64), rows["flags"].copy(),
            rows["extra"].copy(), rows["length"].astype(np.int64), rows["data"].copy(),
        )  # fmt: skip

    @classmethod
    def of_frames(cls, frames: Sequence[Frame]) -> "Batch":
        """Return single frames as one batch."""
        return cls.of_bytes(*pack(frames))

    @classmethod
    def of_stretch(cls, s: Stretch) -> "Batch":
        """Return a stretch of a log."""
        none = np.zeros(len(s), dtype=np.uint8)
        return cls(s.stamps_us, s.keys, none, none, s.lengths, s.data)

    @classmethod
    def joined(cls, parts: Sequence["Batch"]) -> "Batch":
        """Return parts one after the other, as wide as the widest."""
        if len(parts) == 1:
            return parts[0]
        width = max(b.data.shape[1] for b in parts)
        columns = [np.concatenate([getattr(b, name) for b in parts]) for name in cls.__slots__[:-1]]
        columns.append(np.concatenate([np.pad(b.data, ((0, 0), (0, width - b.data.shape[1]))) for b in parts]))
        return cls(*columns)

    def within(self, begin_us: int, end_us: int) -> "Batch":
        """Return the frames stamped from a time until before another."""
        rows = (self.stamp_us >= begin_us) & (self.stamp_us < end_us)
        return Batch(*(getattr(self, name)[rows] for name in Batch.__slots__))

    def frames(self) -> Iterable[Frame]:
        """Return one frame after the other."""
        return map(self._frame, range(len(self)))

    def _frame(self, k: int) -> Frame:
        key, flags = int(self.key[k]), int(self.flags[k])
        return Frame(
            int(self.stamp_us[k]), key & ~EXTENDED, self.data[k, : self.length[k]].tobytes(),
            bool(key & EXTENDED), bool(flags & REMOTE), bool(flags & ERROR), bool(flags & FD), int(self.extra[k]),
        )  # fmt: skip


class Held:
    """The newest frames as they came, at most max_frames of them or one batch, in few large batches."""

    def __init__(self, max_frames: int) -> None:
        self._max = max_frames
        self._whole: deque[Batch] = deque()
        self._small: list[Batch] = []  # after those
        self._small_frames = 0
        self.frames = 0

    def add(self, batch: Batch) -> None:
        """Take newer frames."""
        self._small.append(batch)
        self._small_frames += len(batch)
        self.frames += len(batch)
        if self._small_frames >= MIN_FRAMES:
            self._gather()
        while self.frames > self._max and len(self._whole) > 1:
            self.frames -= len(self._whole.popleft())

    def _gather(self) -> None:
        if self._small:
            self._whole.append(Batch.joined(self._small))
            self._small, self._small_frames = [], 0

    def __len__(self) -> int:
        return len(self._whole) + len(self._small)

    def __iter__(self) -> Iterator[Batch]:
        self._gather()
        return iter(tuple(self._whole))


class ColumnBuffer:
    """Columns of equal length by name, of the first rows' kinds; beyond max_rows the oldest rows go."""

    def __init__(self, max_rows: int) -> None:
        self._max = max_rows
        self._rows = min(FIRST_ROWS, max_rows)
        self._columns: dict[str, NDArray[Any]] = {}
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column, oldest row first: a view, to be read before the next append()."""
        return self._columns.get(name, NO_ROWS)[self._begin : self._end]

    def part(self, rows: slice = slice(None)) -> dict[str, NDArray[Any]]:
        """Return all columns, or rows of them."""
        return {name: self[name][rows] for name in self._columns}

    def clear(self) -> None:
        """Forget all rows."""
        self._begin = self._end = 0

    def append(self, values: Mapping[str, NDArray[Any]]) -> None:
        """Take rows, every column's of the same number."""
        n = len(next(iter(values.values())))
        if not self._columns:
            self._columns = {name: np.zeros((self._rows, *v.shape[1:]), v.dtype) for name, v in values.items()}
        if n > self._max:
            values = {name: v[n - self._max :] for name, v in values.items()}
            n = self._max
        if self._end + n > self._rows:
            self._make_room(n)
        for name, v in values.items():
            self._columns[name][self._end : self._end + n] = v
        self._end += n
        self._begin = max(self._begin, self._end - self._max)

    def _make_room(self, n: int) -> None:
        """Move what is kept to the front, of longer arrays where half of these are in use."""
        kept = min(len(self), self._max - n)
        first = self._end - kept
        rows = self._rows
        while rows < 2 * (kept + n) and rows < 2 * self._max:
            rows *= 2
        for name, column in self._columns.items():
            longer = column if rows == self._rows else np.zeros((rows, *column.shape[1:]), dtype=column.dtype)
            longer[:kept] = column[first : self._end].copy()
            self._columns[name] = longer
        self._begin, self._end, self._rows = 0, kept, rows
