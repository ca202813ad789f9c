"""Windowed RMS of the residuals. Ticks without data stay out: a filter without measurements must not look perfect."""

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, MODELS, FloatArray

SMALLEST = 1e-6  # a residual this far below what the model expects is as good as zero


class Window:
    """The last `ticks` ticks of every axle; slot = tick number modulo length, so the contents follow from the frames.

    Sums are taken afresh whenever they are asked for: nothing drifts.
    """

    def __init__(self, ticks: int, recent: int, axles: int) -> None:
        self._ticks, self._recent = ticks, recent
        self._w: FloatArray = np.zeros((ticks, MODELS, CHANNELS, axles))
        self._good: BoolArray = np.zeros((ticks, axles), dtype=bool)
        self._ratio: FloatArray = np.zeros((ticks, axles))
        self._newest = 0

    def put(self, tick: int, w: FloatArray, good: BoolArray, ratio: FloatArray) -> None:
        """One tick: whitened innovations (4, 2, n), which axles had data (n,), |torque| / (2 N r0) (n,)."""
        slot = tick % self._ticks
        self._newest = tick
        self._good[slot] = good
        self._w[slot] = np.where(good, w, 0.0)
        self._ratio[slot] = np.where(good, ratio, 0.0)

    def reset(self, axle: int) -> None:
        """Empty an axle's window."""
        self._w[..., axle] = 0.0
        self._good[:, axle] = False
        self._ratio[:, axle] = 0.0

    def residuals(self) -> FloatArray:
        """(n, 4): RMS over the window of each model's normalised residual, its mean removed.

        r = sqrt(mean((e - mean e)' S^-1 (e - mean e)) / 2). Removing the mean takes constant sensor bias out.
        NaN for an axle without data.
        """
        count = self._good.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self._w.sum(axis=0) / count
            power = (self._w * self._w).sum(axis=0) / count
            r = np.sqrt(np.maximum((power - mean * mean).sum(axis=1) / CHANNELS, SMALLEST**2))
        out: FloatArray = np.where(count > 0, r, np.nan).T
        return out

    def torque_ratio(self) -> FloatArray:
        """(n,): mean over the window of |torque| / (2 N r0); NaN without data."""
        return self._mean(self._ratio, self._good)

    def recent_torque_ratio(self) -> FloatArray:
        """The same over the newest ticks only."""
        slots = np.arange(self._newest - self._recent + 1, self._newest + 1) % self._ticks
        return self._mean(self._ratio[slots], self._good[slots])

    @staticmethod
    def _mean(values: FloatArray, good: BoolArray) -> FloatArray:
        count = good.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            out: FloatArray = np.where(count > 0, values.sum(axis=0) / count, np.nan)
        return out
