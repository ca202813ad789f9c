"""Curves of adhesion over time, in characters: two by four braille dots a cell, eighths of blocks, shades.

Each kind has a shape of its own, so that they can be told apart without colour.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.tools.monitor.canvas import STYLES, Canvas, Rect

_DOTS = np.array([[1, 8], [2, 16], [4, 32], [64, 128]], dtype=np.int64)  # of a braille cell, by line and column
_EIGHTHS = " ▁▂▃▄▅▆▇█"
SHADE, FILL, TRUTH = "░", "·", "╌"
# tops of the scale, in percent, and the steps that it is told in
STEPS = {5.0: 5, 10.0: 5, 20.0: 4, 30.0: 3, 40.0: 4, 50.0: 5, 60.0: 3, 80.0: 4, 100.0: 5}
TOPS = tuple(STEPS)
MOVES = 50  # of a plot, until all of it is new
SPANS_S = (2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 14400, 43200, 86400)


@dataclass(frozen=True, slots=True)
class Window:
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


def window(end_us: int, span_us: int, cells: int) -> Window:
    """So many cells up to a time. Their edges are fixed: a plot that moves on moves by whole cells, a wide one by
    several at once, for all of it is sent to the terminal then."""
    cell_us = max(span_us // cells, 1000)
    by = max(cells // MOVES, 1)
    end = -(-end_us // (cell_us * by)) * by
    return Window((end - cells) * cell_us, cell_us, cells)


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
    canvas.styles[lines, columns] = STYLES.index(style)
