"""The sensors' offset, which a running mean takes off, and their noise, which fourth differences measure."""

import numpy as np

from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.paper.bank import BoolArray


class Offset:
    """Subtracts a running mean from every channel of every axle, before the filters.

    Left to the Kalman filters, a sensor's bias takes seconds to converge and until then looks like another contact
    condition. The mean of all that came so far, then of the last `ticks` (exponentially), is there from the first tick
    on.
    """

    _mean: FloatArray
    _count: FloatArray

    def __init__(self, ticks: int, axles: int) -> None:
        self._ticks = float(ticks)
        self._mean = np.zeros((CHANNELS, axles))
        self._count = np.zeros((CHANNELS, axles))

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._mean[:, axle] = 0.0
        self._count[:, axle] = 0.0

    def deviation(self, z: FloatArray) -> FloatArray:
        """z (2, n) less its offset as known so far."""
        return z - self._mean

    def step(self, z: FloatArray, present: BoolArray) -> FloatArray:
        """Return z (2, n) less its offset. A channel that is not present teaches nothing."""
        self._count = np.minimum(self._count + present, self._ticks)
        gain = np.where(present, 1.0 / np.maximum(self._count, 1.0), 0.0)
        self._mean = self._mean + gain * np.where(present, z - self._mean, 0.0)
        return z - self._mean


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

    _past: FloatArray  # oldest first
    _run: FloatArray  # samples without a gap, as far as they count
    _power: FloatArray
    _count: FloatArray

    def __init__(self, design_rms: FloatArray, axles: int) -> None:
        self._scale = (1.0 / design_rms)[:, None]
        self._past = np.zeros((len(WEIGHTS) - 1, CHANNELS, axles))
        self._run = np.zeros(axles)
        self._power = np.ones((CHANNELS, axles))
        self._count = np.full((CHANNELS, axles), FIRST_TICKS)

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
