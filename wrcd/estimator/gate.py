"""One absurd sample is left out; many within a few are no accident, and what was known before them does not hold."""

import math

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, MODELS, FloatArray

# An innovation is absurd if it is this many times its usual size for every model: yaw rate, lateral acceleration. On
# 384 tracks, other worlds and changes of rail included, yaw rates stay below 3.2 (with joints and vibration one of 384
# above 4.5), lateral accelerations below 6.3. (With 4.5 for these a change of rail started axles anew: after a sample
# that is left out the next is larger still.)
GATE_SIGMA = np.array([[4.5], [6.0]])
MEMORY_TICKS = 100.0  # over which the usual size is taken
MIN_TICKS = 20.0  # before it is known well enough to judge by
# By then no single sample may have this share of all their power: it would be an outlier, and have made everything
# after it look usual. Of 177 clean starts the largest was 0.22 for the yaw rate, 0.36 for the lateral acceleration.
MAX_PEAK_SHARE = 0.3
MAX_NET_OUTLIERS = 2  # absurd samples more than usual ones
# Whatever the innovations say: no wheelset's yaw rate (rad/s) changes by so much within a tick; 0.061 is the most in
# 3000 runs, at a drop from dry to leaf film. The sample that it is compared with may be a few ticks old, not more.
MAX_JUMP, COMPARED_TICKS = 0.08, MAX_NET_OUTLIERS + 1


class Gate:
    """Judges innovations by their running mean square, per model, channel and axle."""

    STATE = ("_power", "_peak", "_count", "_net_outliers", "_last", "_age")

    def __init__(self, axles: int) -> None:
        self._power: FloatArray = np.zeros((MODELS, CHANNELS, axles))
        self._peak: FloatArray = np.zeros((MODELS, CHANNELS, axles))  # of the first MIN_TICKS
        self._count: FloatArray = np.zeros((CHANNELS, axles))
        self._net_outliers: FloatArray = np.zeros(
            (CHANNELS, axles)
        )  # samples that were, less those after them that were not
        self._last: FloatArray = np.zeros(axles)  # yaw rate that was used last
        self._age: FloatArray = np.full(axles, math.inf)  # ticks since

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._power[:, :, axle] = 0.0
        self._peak[:, :, axle] = 0.0
        self._count[:, axle] = 0.0
        self._net_outliers[:, axle] = 0.0
        self._age[axle] = math.inf

    def outliers(self, e: FloatArray, yaw_rate: FloatArray, there: BoolArray) -> BoolArray:
        """Which samples (2, n) of the axles that have any (n,) are not to be believed, by their innovations e
        (4, 2, n), and by the yaw rate (n,) itself. Not finite is outliers, too."""
        with np.errstate(over="ignore", invalid="ignore"):
            usual: BoolArray = np.any(e * e <= GATE_SIGMA**2 * self._power, axis=0)
        known = (self._count >= MIN_TICKS) | ~np.isfinite(e).all(axis=0)
        out: BoolArray = there & known & ~usual
        with np.errstate(invalid="ignore"):
            out[0] |= there & (self._age <= COMPARED_TICKS) & (np.abs(yaw_rate - self._last) > MAX_JUMP)
        return out

    def learn(self, e: FloatArray, yaw_rate: FloatArray, used: BoolArray, outliers: BoolArray) -> BoolArray:
        """Learn from the axles (n,) that were used. Returns those to start anew: too many samples were outliers, or one
        among the first was."""
        self._last, self._age = np.where(used, yaw_rate, self._last), np.where(used, 1.0, self._age + 1.0)
        self._net_outliers = np.maximum(self._net_outliers + outliers - used, 0.0)
        self._count = np.minimum(self._count + used, MEMORY_TICKS)
        gain = np.where(used, 1.0 / np.maximum(self._count, 1.0), 0.0)
        power = e * e
        self._power = self._power + gain * (power - self._power)
        out: BoolArray = np.any(self._net_outliers > MAX_NET_OUTLIERS, axis=0)
        if self._count.min() <= MIN_TICKS + 1.0:
            early = self._count <= MIN_TICKS
            self._peak = np.where(early, np.maximum(self._peak, np.where(used, power, 0.0)), 0.0)
            alone = np.all(self._peak > MAX_PEAK_SHARE * MIN_TICKS * self._power, axis=0)
            out |= np.any(alone & (self._count == MIN_TICKS) & used, axis=0)
        return out
