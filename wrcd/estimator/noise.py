"""How noisy the sensors are just now, measured from their own signals."""

import math

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.recursion import MAX_TICKS, exponential, smoothed

# Fourth differences: what the track does is slow against a tick and leaves next to nothing (1e-4 of its power at
# 10 Hz); white noise of variance 1 leaves 1 + 16 + 36 + 16 + 1.
WEIGHTS = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
GAIN = 70.0
MEMORY_TICKS = 400.0
FIRST_TICKS = 60.0  # the design's noise counts as so many ticks at the start
MAX_POWER_RATIO = 9.0  # one difference counts as no more than this many times the running power: pulses stay out
# Above MAX_FACTOR times the design's noise the signal is no sensor's noise but vibration, most of it above the band
# that counts; from VIBRATION on, what is taken off is the design's own noise.
MIN_FACTOR, MAX_FACTOR, VIBRATION = 0.1, 2.2, 3.0


class NoiseLevel:
    """Running noise power of every channel of every axle, relative to the design's."""

    STATE = {"past_samples": "_past", "ticks_without_gap": "_run", "power": "_power", "count": "_count"}

    def __init__(self, design_rms: FloatArray, axles: int) -> None:
        self._scale = (1.0 / design_rms)[:, None]
        self._past: FloatArray = np.zeros((len(WEIGHTS) - 1, CHANNELS, axles))  # oldest first
        self._run: FloatArray = np.zeros(axles)  # samples without a gap, as far as they count
        self._power: FloatArray = np.ones((CHANNELS, axles))
        self._count: FloatArray = np.full((CHANNELS, axles), FIRST_TICKS)
        self._block = exponential(1.0 / MEMORY_TICKS)
        # rows: the differences of m ticks; columns: the past, then the ticks
        past = len(WEIGHTS) - 1
        self._differences = tuple(
            np.array([[*np.zeros(k), *WEIGHTS[::-1], *np.zeros(m - 1 - k)] for k in range(m)]).reshape(m, m + past)
            / math.sqrt(GAIN)
            for m in range(MAX_TICKS + 1)
        )

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._run[axle] = 0.0
        self._power[:, axle] = 1.0
        self._count[:, axle] = FIRST_TICKS

    def step(self, z: FloatArray, used: BoolArray) -> None:
        """Measurements (2, n), and of which axles (n,) they are used."""
        z = z * self._scale
        past = np.concatenate((self._past, z[None]))
        difference = np.tensordot(WEIGHTS[::-1], past, 1)
        known = used & (self._run >= len(self._past))
        power = np.minimum(difference * difference / GAIN, MAX_POWER_RATIO * self._power)
        self._count = np.minimum(self._count + known, MEMORY_TICKS)
        self._power = self._power + np.where(known, (power - self._power) / self._count, 0.0)
        self._past = past[1:]
        self._run = np.where(used, np.minimum(self._run + 1.0, len(self._past)), 0.0)

    @property
    def settled(self) -> BoolArray:
        """(n,): which axles' power is of the last ticks only, without a gap just before."""
        return np.asarray((self._count == MEMORY_TICKS).all(axis=0) & (self._run == len(self._past)))

    def step_settled(self, z: FloatArray) -> None:
        """m ticks (m, 2, n), all used, of axles that are settled."""
        m = len(z)
        past = np.concatenate((self._past, z * self._scale))
        square = (self._differences[m] @ past.reshape(len(past), -1)).reshape(z.shape)
        square *= square
        power = smoothed(self._block, self._power, square)
        if (square > MAX_POWER_RATIO * power[:-1]).any():
            for k in range(m):
                most = MAX_POWER_RATIO * self._power
                self._power = self._power + (np.minimum(square[k], most) - self._power) / MEMORY_TICKS
        else:
            self._power = power[-1].copy()
        self._past = past[m:]

    @property
    def factor(self) -> FloatArray:
        """(2, n): rms of what is fast in each channel over the design's sensor noise."""
        return np.asarray(np.sqrt(self._power))

    def sensor_factor(self) -> FloatArray:
        """(2, n): the part of it that counts as the sensors' noise, MIN_FACTOR … MAX_FACTOR."""
        f = self.factor
        held = np.minimum(np.maximum(f, MIN_FACTOR), MAX_FACTOR)
        if (f <= MAX_FACTOR).all():
            return held
        vibrates = np.clip((f - MAX_FACTOR) / (VIBRATION - MAX_FACTOR), 0.0, 1.0)
        return np.asarray((1.0 - vibrates) * held + vibrates)
