"""Innovation gate: skip single outliers; reset the axle when outliers exceed accepted samples by too many."""

import math
from typing import NamedTuple

import numpy as np

from wrcd.estimator.design import CHANNELS, MODELS, FloatArray
from wrcd.estimator.paper.bank import BoolArray

# An innovation is an outlier if it is this many times its usual size for every model: yaw rate, lateral acceleration.
# On 384 tracks of lone wheelsets, other worlds and changes of rail included, yaw rates stay below 3.2 (with joints and
# vibration one of 384 above 4.5), lateral accelerations below 6.3. In a bogie a flange that meets the rail gives more,
# and after a sample that is left out the next is larger still: with 6 and no more than two outliers for these, too,
# sound axles were being started anew 2 % of the time, shaken ones 11 %; so 0.0 and 0.1 % (16 axles each).
GATE_SIGMA = np.array([[4.5], [12.0]])
MEMORY_TICKS = 100.0  # over which the usual size is taken
MIN_TICKS = 20.0  # before it is known well enough to judge by
# If one of the first MIN_TICKS samples holds more than this share of their total power for every model, it was an
# outlier that widened the gate: reset the axle. Of 177 clean starts the largest was 0.22 for the yaw rate, 0.36 for the
# lateral acceleration.
MAX_PEAK_SHARE = 0.3
MAX_NET_OUTLIERS = np.array([[2.0], [8.0]])  # outliers less accepted samples
# Whatever the innovations say: no wheelset's yaw rate (rad/s) changes by so much within a tick; 0.061 is the most in
# 3000 runs, at a drop from dry to leaf film. The sample that it is compared with may be a few ticks old, not more.
MAX_JUMP, COMPARED_TICKS = 0.08, 3
_SQUARES = GATE_SIGMA**2


class Outliers(NamedTuple):
    """What an axle is reset for: by how often its usual size each channel's innovation is off, of the model that it
    fits best, with the limits; and by how much the yaw rate differs from the newest that was used."""

    times_usual: list[float]
    limits: list[float]
    jump_rad_s: float


class Gate:
    """Judges innovations by their running mean square, per model, channel and axle."""

    _power: FloatArray
    _peak: FloatArray  # of the first MIN_TICKS
    _count: FloatArray
    _net_outliers: FloatArray  # outliers less the accepted samples after them
    _last: FloatArray  # yaw rate that was used last
    _age: FloatArray  # ticks since

    def __init__(self, axles: int) -> None:
        self._power = np.zeros((MODELS, CHANNELS, axles))
        self._peak = np.zeros((MODELS, CHANNELS, axles))
        self._count = np.zeros((CHANNELS, axles))
        self._net_outliers = np.zeros((CHANNELS, axles))
        self._last = np.zeros(axles)
        self._age = np.full(axles, math.inf)

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._power[:, :, axle] = 0.0
        self._peak[:, :, axle] = 0.0
        self._count[:, axle] = 0.0
        self._net_outliers[:, axle] = 0.0
        self._age[axle] = math.inf

    def outliers(self, e: FloatArray, yaw_rate: FloatArray, there: BoolArray) -> BoolArray:
        """Return the outlier mask (2, n) of the axles that have samples (n,), by their innovations e (4, 2, n) and by
        the yaw rate (n,) itself. An innovation that is not finite is an outlier."""
        with np.errstate(over="ignore", invalid="ignore"):
            usual: BoolArray = np.any(e * e <= _SQUARES * self._power, axis=0)
        known = (self._count >= MIN_TICKS) | ~np.isfinite(e).all(axis=0)
        out: BoolArray = there & known & ~usual
        with np.errstate(invalid="ignore"):
            out[0] |= there & (self._age <= COMPARED_TICKS) & (np.abs(yaw_rate - self._last) > MAX_JUMP)
        return out

    def why_reset(self, e: FloatArray, yaw_rate: float, axle: int) -> Outliers:
        """The figures of an axle that is to be reset, by its newest innovations (4, 2) and yaw rate."""
        with np.errstate(all="ignore"):
            times = np.abs(e) / np.sqrt(self._power[:, :, axle])
        times = np.where(np.isfinite(times), times, np.inf).min(axis=0)
        jump = abs(yaw_rate - float(self._last[axle])) if math.isfinite(self._age[axle]) else math.nan
        return Outliers(times.tolist(), GATE_SIGMA[:, 0].tolist(), jump)

    def learn(self, e: FloatArray, yaw_rate: FloatArray, used: BoolArray, outliers: BoolArray) -> BoolArray:
        """Learn from the axles (n,) whose samples were accepted. Return those to reset: too many samples were outliers,
        or one among the first was."""
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
