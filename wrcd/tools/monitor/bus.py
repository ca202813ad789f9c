"""How full the bus is, and what its controller reports."""

from dataclasses import dataclass

import numpy as np

from wrcd.bus.frame import EXTENDED
from wrcd.tools.bus_load import bits
from wrcd.tools.monitor.batch import ERROR, FD, REMOTE, Batch
from wrcd.tools.monitor.table import Table
from wrcd.tools.story.records import Times

BIN_US = 100_000
OVER_US = 1_000_000  # load and rate are of the second before


@dataclass(frozen=True, slots=True)
class BusNow:
    """Of the second before a time."""

    frames_per_s: float
    load_pct: float
    errors: int  # error frames


class Bus:
    """Frames and bits by tenths of a second."""

    def __init__(self, bit_rate: int, hold_us: int) -> None:
        self.bit_rate = bit_rate
        self.frames = self.errors = 0  # all of them
        # a tenth that is cut by a batch has a row in each
        rows = hold_us // BIN_US * 3
        self._bins = Table(
            {"time_us": (np.int64, 0), "frames": (np.int32, 0), "bits": (np.float32, 0), "errors": (np.int32, 0)}, rows
        )

    def take(self, batch: Batch, times: Times) -> None:
        """Count frames; times are the monitor's own, which never step back."""
        error = (batch.flags & ERROR) > 0
        bins = times // BIN_US
        first = int(bins[0])
        if int(bins[-1]) == first:
            put, place = np.array([first]), np.zeros(len(bins), dtype=np.int64)
        else:
            put, place = np.unique(bins, return_inverse=True)
        n = len(put)
        self.frames += int(len(batch) - error.sum())
        self.errors += int(error.sum())
        data_bytes = np.where(batch.flags & REMOTE, 0, batch.length)
        taken = np.where(error, 0.0, bits(data_bytes, batch.key & EXTENDED > 0, batch.flags & FD > 0))
        self._bins.append(
            time_us=put * BIN_US, frames=np.bincount(place, weights=~error, minlength=n),
            bits=np.bincount(place, weights=taken, minlength=n),
            errors=np.bincount(place, weights=error, minlength=n),
        )  # fmt: skip

    def at(self, at_us: int) -> BusNow:
        """As it was at a time."""
        end_us = at_us // BIN_US * BIN_US  # the tenth that is not over does not count
        first, end = np.searchsorted(self._bins["time_us"], (end_us - OVER_US, end_us))
        rows = slice(first, end)
        frames, whole = float(self._bins["frames"][rows].sum()), float(self._bins["bits"][rows].sum())
        seconds = OVER_US / 1e6
        load_pct = 100.0 * whole / seconds / self.bit_rate
        return BusNow(frames / seconds, load_pct, int(self._bins["errors"][rows].sum()))
