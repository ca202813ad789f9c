"""Which gyro feels what which accelerometer feels: wires that are swapped between axles show in all axles' signals."""

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray, IntArray
from wrcd.estimator.doubts import LAT, YAW

SECONDS = 10  # that are judged
MIN_SECONDS = 9  # before which nothing is
MIN_SHARE = 0.5  # of a second's ticks that an axle must have data in
# By so much two pairs' correlations in 3 to 10 Hz must grow if their accelerometers changed places, both together. Of
# 5 700 sound pairs in fours (nominal, robust, rough, harsh, slow, coasting, in slip cycles, after drops; on tracks of
# their own and on a train's) none is above 0.3; of 120 swapped ones on one track 96 % are above 0.4, saturated or not.
CROSSED = 0.4


class Wiring:
    """Correlations of every axle's yaw rate with every axle's lateral acceleration, second by second.

    A pair's own correlation alone tells less: a saturated wheelset swings by itself, and goes with no other's sensor
    either.
    """

    STATE = {"cross": "_cross", "power": "_power", "used": "_used", "ticks": "_ticks", "seconds": "_seconds"}

    def __init__(self, tick_s: float, axles: int) -> None:
        self._second_ticks = round(1.0 / tick_s)
        self._cross: FloatArray = np.zeros((axles, axles))  # of the second that is not full yet: gyro, accelerometer
        self._power: FloatArray = np.zeros((CHANNELS, axles))
        self._used: FloatArray = np.zeros(axles)  # ticks with data
        self._ticks = 0
        self._seconds: FloatArray = np.full((SECONDS, axles, axles), np.nan)  # the newest first

    def reset(self, axle: int) -> None:
        """Nothing of an axle's second counts that a gap breaks."""
        self._cross[axle] = self._cross[:, axle] = self._power[:, axle] = 0.0
        self._used[axle] = -self._second_ticks
        if (self._used <= 0.0).all():
            self._used[:] = 0.0
            self._ticks = 0

    @property
    def left(self) -> int:
        """Ticks until a second is full."""
        return self._second_ticks - self._ticks

    def add(self, y: FloatArray, power: FloatArray, used: BoolArray | None) -> None:
        """m ticks of both signals in 3 to 10 Hz (m, 2, n) that no second ends within, and the sums of their squares
        (2, n); used (n,) where not all axles have data."""
        if used is not None and not used.any():
            return
        m = len(y)
        known = y if used is None else y * used
        self._cross = self._cross + known[:, YAW].T @ known[:, LAT]
        self._power = self._power + (power if used is None else power * used)
        self._used = self._used + (float(m) if used is None else float(m) * used)
        self._ticks += m
        if self._ticks >= self._second_ticks:
            self._close()

    def _close(self) -> None:
        """A second is full."""
        known = self._used >= MIN_SHARE * self._second_ticks
        with np.errstate(invalid="ignore", divide="ignore"):
            r = self._cross / np.sqrt(self._power[YAW][:, None] * self._power[LAT])
        r[~(known[:, None] & known)] = np.nan
        self._seconds = np.concatenate((r[None], self._seconds[:-1]))
        self._cross, self._power, self._used = (np.zeros_like(a) for a in (self._cross, self._power, self._used))
        self._ticks = 0

    def partners(self) -> IntArray:
        """(n,): the axle with which each would go together better if they changed accelerometers; -1 none."""
        known = np.isfinite(self._seconds)
        count = known.sum(axis=0)
        mean = np.where(known, self._seconds, 0.0).sum(axis=0) / np.maximum(count, 1)
        mean[count < MIN_SECONDS] = np.nan
        own = np.diagonal(mean)
        gain = mean + mean.T - own[:, None] - own
        gain[np.isnan(gain)] = 0.0
        best = gain.argmax(axis=1)
        return np.where(gain[np.arange(len(best)), best] > CROSSED, best, -1)
