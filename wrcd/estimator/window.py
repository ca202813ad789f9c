"""Windowed RMS of the residuals. Ticks without data stay out: a filter without measurements must not look perfect."""

from dataclasses import dataclass

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, MODELS, FloatArray

SMALLEST = 1e-6  # a residual this far below what the model expects is as good as zero


@dataclass(frozen=True, slots=True)
class Sums:
    """Sums over the ticks with data of a part of the window: of 1, the age t and its square (n,), and of the whitened
    innovations w, t w and their squares (4, 2, n). Those of two parts add up to those of both."""

    count: FloatArray
    t: FloatArray
    tt: FloatArray
    w: FloatArray
    tw: FloatArray
    ww: FloatArray

    def __add__(self, other: "Sums") -> "Sums":
        """Both parts together."""
        return Sums(
            self.count + other.count, self.t + other.t, self.tt + other.tt,
            self.w + other.w, self.tw + other.tw, self.ww + other.ww,
        )  # fmt: skip

    def rms(self, least: float) -> FloatArray:
        """RMS about the straight line through the innovations, per model (n, 4). NaN with less than `least` ticks."""
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = self.w / self.count
            about = self.tw - self.t * mean  # sum of (t - its mean) w
            spread = np.maximum(self.tt - self.t * self.t / self.count, 1e-9)
            power = (self.ww - about * about / spread) / self.count - mean * mean
            r = np.sqrt(np.maximum(power.sum(axis=1) / CHANNELS, SMALLEST**2))
        out: FloatArray = np.where(self.count >= least, r, np.nan).T
        return out


class Window:
    """The last `ticks` ticks of every axle; slot = tick number modulo length, so the contents follow from the frames.

    Sums are taken afresh whenever they are asked for: nothing drifts. Where the rail has changed, what is older than
    the newest part (`recent` ticks) is forgotten, and the window grows again.
    """

    STATE = ("_w", "_good", "_ratio", "_newest")

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
        self._clear(slice(None), axle)

    def differences(self) -> FloatArray:
        """(n, 4): by how much a residual of the newest part differs from that of the rest, in decades. NaN where
        either holds less than half of `recent` ticks of data."""
        new, rest = self._sums()
        least = 0.5 * self._recent
        out: FloatArray = np.log10(new.rms(least)) - np.log10(rest.rms(least))
        return out

    def forget_old(self, limits: FloatArray) -> BoolArray:
        """Where a residual differs by more than its limit (4,), the rest is forgotten. Returns where (n,)."""
        with np.errstate(invalid="ignore"):
            changed: BoolArray = np.any(np.abs(self.differences()) > limits, axis=1)
        for axle in np.flatnonzero(changed):
            self._clear(~self._newest_part(), int(axle))
        return changed

    def residuals(self) -> FloatArray:
        """(n, 4): RMS over the window of each model's normalised residual, its mean and trend removed.

        r = sqrt(mean((w - l)' (w - l)) / 2), l the straight line through w. Removing it takes sensor bias out,
        and what a filter still has to learn of it. NaN where less than half of `recent` ticks brought data.
        """
        new, rest = self._sums()
        return (new + rest).rms(0.5 * self._recent)

    def recent_residuals(self) -> FloatArray:
        """The same over the newest ticks only."""
        return self._sums()[0].rms(0.5 * self._recent)

    def torque_ratio(self) -> FloatArray:
        """(n,): mean over the window of |torque| / (2 N r0); NaN without data."""
        return self._mean(self._ratio, self._good)

    def recent_torque_ratio(self) -> FloatArray:
        """The same over the newest ticks only."""
        new = self._newest_part()
        return self._mean(self._ratio[new], self._good[new])

    def share(self) -> FloatArray:
        """(n,): how much of the window is there, from the newest part alone (0) to all of it (1)."""
        count = self._good.sum(axis=0)
        out: FloatArray = np.clip((count - self._recent) / max(self._ticks - self._recent, 1), 0.0, 1.0)
        return out

    def _newest_part(self) -> BoolArray:
        new = np.zeros(self._ticks, dtype=bool)
        new[np.arange(self._newest - self._recent + 1, self._newest + 1) % self._ticks] = True
        return new

    def _clear(self, slots: slice | BoolArray, axle: int) -> None:
        self._w[slots, :, :, axle] = 0.0
        self._good[slots, axle] = False
        self._ratio[slots, axle] = 0.0

    def _sums(self) -> tuple[Sums, Sums]:
        """Of the newest part and of the rest, taken in one go: as products of weights (., ticks) with what is there."""
        newest = self._newest_part()
        # about the middle of the window, so that little is lost where large sums are subtracted
        age = (self._newest - np.arange(self._ticks)) % self._ticks - 0.5 * self._ticks
        parts = np.stack((newest, ~newest)).astype(np.float64)
        weights = np.concatenate((parts, parts * age, parts * age * age))
        counts = (weights @ self._good).reshape(3, 2, -1)
        w = self._w.reshape(self._ticks, -1)
        shape = (-1, 2, *self._w.shape[1:])
        sums = (weights[:4] @ w).reshape(shape)
        squares = (parts @ (w * w)).reshape(shape)
        new, rest = (
            Sums(count=counts[0, k], t=counts[1, k], tt=counts[2, k], w=sums[0, k], tw=sums[1, k], ww=squares[0, k])
            for k in (0, 1)
        )
        return new, rest

    @staticmethod
    def _mean(values: FloatArray, good: BoolArray) -> FloatArray:
        count = good.sum(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            out: FloatArray = np.where(count > 0, values.sum(axis=0) / count, np.nan)
        return out
