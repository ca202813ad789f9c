"""Where frames are missing, and fewer of them where there are too many for a page."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.tools.report.columns import CODE, TIME, Column

MAX_ROWS = 200_000  # of a table; an hour of Adhesion has 180 000
GAP_CYCLES = 3.5  # a consumer calls it stale after three
MIN_GAP_US = 30_000
MIN_ROWS = 4  # whose median tells how often they come


def gaps(
    time_us: NDArray[np.int64], cycles: float = GAP_CYCLES, usual_us: int | None = None
) -> tuple[NDArray[np.intp], int]:
    """Rows before which frames are missing, and the time between two, microseconds: the usual one if none is given."""
    between = np.diff(time_us)
    if usual_us is None:
        usual_us = int(np.median(between)) if len(between) else 0
    return np.flatnonzero(between > max(cycles * usual_us, MIN_GAP_US)) + 1, usual_us


def with_gaps(table: Mapping[str, Column], time_us: NDArray[np.int64], cycle_us: int) -> dict[str, Column]:
    """Columns with a row of nothing where frames are missing, and behind the last: a curve breaks there, and the cursor
    finds none. cycle_us: between two rows where they are too few to tell."""
    if not len(time_us):
        return dict(table)
    at, usual = gaps(time_us, usual_us=cycle_us if len(time_us) < MIN_ROWS else None)
    return {name: _inserted(c, np.append(at, len(time_us)), usual) for name, c in table.items()}


def _inserted(c: Column, at: NDArray[np.intp], usual_us: int) -> Column:
    if c.kind == TIME:
        return Column(np.insert(c.values, at, c.values[at - 1] + 3.0 * usual_us / 1e6), c.step, TIME)
    nothing = -1 if c.kind == CODE else np.nan
    return Column(np.insert(c.values, at, nothing), c.step, c.kind, c.base, c.sign)


def thin(
    values: NDArray[np.float32], codes: tuple[NDArray[np.int8], ...] = (), most: int = MAX_ROWS
) -> NDArray[np.intp] | None:
    """Rows that a page keeps of more than `most`: lowest and highest of each run, and changes of codes; else None."""
    n = len(values)
    if n <= most:
        return None
    run = math.ceil(2 * n / most)
    starts = np.arange(0, n, run)
    padded = np.full(len(starts) * run, np.nan, dtype=np.float32)
    padded[:n] = values
    runs = padded.reshape(-1, run)
    low = starts + np.where(np.isnan(runs), np.inf, runs).argmin(axis=1)
    high = starts + np.where(np.isnan(runs), -np.inf, runs).argmax(axis=1)
    changes = [np.flatnonzero(np.diff(c)) + 1 for c in codes]
    return np.unique(np.concatenate([low, high, *changes, [n - 1]]))
