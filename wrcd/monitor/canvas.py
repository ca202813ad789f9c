"""A screen of characters, each with a style, and curves on it: braille dots, eighths of blocks, shades. What is drawn
knows no terminal; each kind of curve has a shape of its own, so that they can be distinguished without colour."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# What something is, not how it looks: the palettes say that (screen.py).
STYLES = (
    "plain", "dim", "title", "label", "good", "warn", "bad", "available", "used", "fill", "interval", "truth", "cursor",
    "selected", "key", "live", "paused", "log",
)  # fmt: skip
_PLACES = {name: place for place, name in enumerate(STYLES)}
BELOW_CURSOR = (" ", "░", "·")  # what the cursor's line goes over; curves it only marks
_DOTS = np.array([[1, 8], [2, 16], [4, 32], [64, 128]], dtype=np.int64)  # of a braille cell, by line and column
_EIGHTHS = " ▁▂▃▄▅▆▇█"
SHADE, FILL, TRUTH = "░", "·", "╌"
# tops of the scale, in percent, and its steps
STEPS = {5.0: 5, 10.0: 5, 20.0: 4, 30.0: 3, 40.0: 4, 50.0: 5, 60.0: 3, 80.0: 4, 100.0: 5}
TOPS = tuple(STEPS)
MOVES = 50  # of a plot, until all of it is new
SPANS_S = (2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 43200, 86400)


class Rect(NamedTuple):
    """Cells x … x + width - 1 of lines y … y + height - 1."""

    x: int
    y: int
    width: int
    height: int


class Canvas:
    """Characters (height, width) and their styles, as places in STYLES. All characters are one cell wide."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.characters = np.full((height, width), " ", dtype="<U1")
        self.styles = np.zeros((height, width), dtype=np.uint8)

    def put(self, x: int, y: int, text: str, style: str = "plain", width: int | None = None) -> int:
        """Write a text, cut at width and at the edge. Returns the cell behind it."""
        most = self.width - x if width is None else min(width, self.width - x)
        if not 0 <= y < self.height or most <= 0 or not text:
            return x
        if len(text) > most:
            text = text[: most - 1] + "…" if most > 1 else text[:most]
        end = x + len(text)
        self.characters[y, x:end] = list(text)
        self.styles[y, x:end] = _PLACES[style]
        return end

    def put_right(self, end: int, y: int, text: str, style: str = "plain") -> None:
        """Write a text that ends before a cell."""
        self.put(max(end - len(text), 0), y, text, style)

    def invert(self, x: int, rect: Rect) -> None:
        """The cursor: a column of a rectangle."""
        column = self.characters[rect.y : rect.y + rect.height, x]
        styles = self.styles[rect.y : rect.y + rect.height, x]
        styles[:] = np.where(np.isin(column, BELOW_CURSOR), _PLACES["title"], _PLACES["cursor"])
        column[np.isin(column, BELOW_CURSOR)] = "│"

    def runs(self, y: int) -> Iterator[tuple[str, int]]:
        """A line as texts of one style each."""
        styles = self.styles[y]
        edges = [0, *(np.flatnonzero(np.diff(styles)) + 1).tolist(), self.width]
        line = "".join(self.characters[y].tolist())
        for first, end in pairwise(edges):
            yield line[first:end], int(styles[first])

    def changes(self, before: "Canvas | None") -> list[Rect]:
        """Where it differs from another, a span a line; all of it from one of another size."""
        if before is None or (before.width, before.height) != (self.width, self.height):
            return [Rect(0, 0, self.width, self.height)]
        differs = (self.characters != before.characters) | (self.styles != before.styles)
        out = []
        for y in np.flatnonzero(differs.any(axis=1)).tolist():
            # a span a stretch: what is far apart in a line is sent apart
            columns = np.flatnonzero(differs[y])
            cuts = np.flatnonzero(np.diff(columns) > 12)
            for first, end in zip([0, *(cuts + 1).tolist()], [*cuts.tolist(), len(columns) - 1], strict=True):
                x = int(columns[first])
                out.append(Rect(x, y, int(columns[end]) - x + 1, 1))
        return out

    def text(self) -> str:
        """Its characters, a line each."""
        return "\n".join("".join(line).rstrip() for line in self.characters.tolist())


@dataclass(frozen=True, slots=True)
class PlotTimes:
    """The times of a plot's columns: cells of cell_us from begin_us on."""

    begin_us: int
    cell_us: int
    cells: int

    @property
    def end_us(self) -> int:
        """After the last."""
        return self.begin_us + self.cell_us * self.cells

    def column(self, at_us: int) -> int:
        """The cell of a time; beyond the window where it is not in it."""
        return (at_us - self.begin_us) // self.cell_us


def window(end_us: int, span_us: int, cells: int) -> PlotTimes:
    """So many cells up to a time. Their edges are fixed: a plot that moves on moves by whole cells, a wide one by
    several at once, for all of it is sent to the terminal then."""
    cell_us = max(span_us // cells, 1000)
    by = max(cells // MOVES, 1)
    end = -(-end_us // (cell_us * by)) * by
    return PlotTimes((end - cells) * cell_us, cell_us, cells)


def extremes(
    times: NDArray[np.int64], values: NDArray[np.float32], begin_us: int, step_us: int, steps: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and greatest value of each step, NaN where there is none."""
    edges = np.searchsorted(times, begin_us + step_us * np.arange(steps + 1))
    low, high = np.full(steps, np.nan), np.full(steps, np.nan)
    filled = np.flatnonzero(edges[1:] > edges[:-1])
    if len(filled):
        part = values[edges[0] : edges[-1]]
        starts = edges[filled] - edges[0]
        low[filled], high[filled] = np.fmin.reduceat(part, starts), np.fmax.reduceat(part, starts)
    return low, high


def carried(values: NDArray[np.float64], most: int) -> NDArray[np.float64]:
    """The same, where steps without a value between two with one, at most so many, have the one before."""
    there = np.flatnonzero(np.isfinite(values))
    if not len(there) or most < 1:
        return values
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    gap = np.arange(len(values)) - last
    fill = (last >= 0) & (gap > 0) & (gap <= most)
    out = values.copy()
    out[fill] = values[last[fill]]
    return out


def top_of(highest: float) -> float:
    """Of the scale that shows a value."""
    return next((t for t in TOPS if highest <= t * 0.98), TOPS[-1])


def draw_line(
    canvas: Canvas, rect: Rect, low: NDArray[np.float64], high: NDArray[np.float64], top: float, style: str
) -> None:
    """A curve of dots between least and greatest, two steps a cell, joined to the step before."""
    rows = 4 * rect.height
    down = np.clip((1.0 - low / top) * rows, 0, rows - 1)
    up = np.clip((1.0 - high / top) * rows, 0, rows - 1)
    # a step that begins above the end of the one before reaches down to it, and so on
    down[1:] = np.fmax(down[1:], np.where(np.isfinite(down[1:]), up[:-1], np.nan))
    up[1:] = np.fmin(up[1:], np.where(np.isfinite(up[1:]), down[:-1], np.nan))
    lines = np.arange(rows)[:, None]
    with np.errstate(invalid="ignore"):
        grid = (lines >= np.floor(up)) & (lines <= np.floor(down))
    cells = (grid.reshape(rect.height, 4, rect.width, 2) * _DOTS[None, :, None, :]).sum(axis=(1, 3))
    at = np.nonzero(cells)
    characters = (0x2800 + cells[at]).astype(np.uint32).view("<U1")
    _set(canvas, rect, at, characters, style)


def draw_area(canvas: Canvas, rect: Rect, values: NDArray[np.float64], top: float, style: str) -> None:
    """From zero up to a value a cell: its edge in eighths of a line, dots below."""
    eighths = np.clip(np.nan_to_num(values / top) * rect.height * 8, 0, rect.height * 8)
    lines = np.arange(rect.height, 0, -1)[:, None] - 1
    filled = np.clip(np.round(eighths[None, :] - 8 * lines), 0, 8).astype(np.int64)
    below = (lines < np.floor(eighths / 8)) & (np.vstack((np.zeros_like(filled[:1]), filled[:-1])) > 0)
    at = np.nonzero((filled > 0) & ~below)
    _set(canvas, rect, at, np.array(list(_EIGHTHS))[filled[at]], style)
    at = np.nonzero(below)
    _set(canvas, rect, at, np.full(len(at[0]), FILL), "fill")


def draw_band(
    canvas: Canvas, rect: Rect, low: NDArray[np.float64], high: NDArray[np.float64], top: float, style: str
) -> None:
    """Shade between two values a cell."""
    middle = (np.arange(rect.height, 0, -1)[:, None] - 0.5) / rect.height * top
    half = 0.5 * top / rect.height
    with np.errstate(invalid="ignore"):
        at = np.nonzero((middle >= low - half) & (middle <= high + half))
    _set(canvas, rect, at, np.full(len(at[0]), SHADE), style)


def draw_marks(canvas: Canvas, rect: Rect, values: NDArray[np.float64], top: float, style: str) -> None:
    """A dash a cell."""
    columns = np.flatnonzero(np.isfinite(values))
    lines = line_of(values[columns], top, rect.height)
    _set(canvas, rect, (lines, columns), np.full(len(columns), TRUTH), style)


def line_of(values: NDArray[np.float64], top: float, height: int) -> NDArray[np.int64]:
    """The line of a value, 0 the highest."""
    return np.clip((1.0 - values / top) * height, 0, height - 1).astype(np.int64)


def _set(
    canvas: Canvas, rect: Rect, at: tuple[NDArray[np.int64], ...], characters: NDArray[np.str_], style: str
) -> None:
    lines, columns = at[0] + rect.y, at[1] + rect.x
    canvas.characters[lines, columns] = characters
    canvas.styles[lines, columns] = _PLACES[style]
