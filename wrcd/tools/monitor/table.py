"""Columns that grow with their rows and forget the oldest."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

FIRST_ROWS = 256


class Table:
    """Columns of equal length, by name: {name: (dtype, width)}, width 0 for one value a row. At most max_rows rows."""

    def __init__(self, columns: Mapping[str, tuple[DTypeLike, int]], max_rows: int) -> None:
        self._max = max_rows
        rows = min(FIRST_ROWS, max_rows)
        self._columns = {
            name: np.zeros((rows, width) if width else rows, dtype=dtype) for name, (dtype, width) in columns.items()
        }
        self._begin = self._end = 0
        self._rows = rows

    def __len__(self) -> int:
        return self._end - self._begin

    def __getitem__(self, name: str) -> NDArray[Any]:
        """A column, oldest row first: a view, to be read before the next append()."""
        return self._columns[name][self._begin : self._end]

    def append(self, **values: Sequence[Any] | NDArray[Any]) -> None:
        """Rows, every column's of the same number; the oldest go beyond max_rows."""
        n = len(next(iter(values.values())))
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
            if rows == self._rows:
                column[:kept] = column[first : self._end].copy()
            else:
                longer = np.zeros((rows, *column.shape[1:]), dtype=column.dtype)
                longer[:kept] = column[first : self._end]
                self._columns[name] = longer
        self._begin, self._end, self._rows = 0, kept, rows
