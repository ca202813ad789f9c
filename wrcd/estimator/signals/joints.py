"""Rail joints and crossings: short pulses of the axle box that tell nothing of the contact."""

import numpy as np

from wrcd.estimator.design import FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.recursion import Sections

# A pulse is so many times the running rms of the accelerometer above the band; the rms is never taken as less than
# FLOOR of the design's sensor noise, and forgets within 1 / GAIN ticks. A square counts as no more than CLIP of it.
PULSE_SIGMA = 5.0
FLOOR = 0.8
GAIN, CLIP = 0.005, 9.0
MEMORY_TICKS = 1.0 / GAIN
HOLD_TICKS = 4  # before and behind a pulse
RECOVERY_TICKS = 80  # the filters swing as long as this after a pulse: their innovations are large, but no outliers
LONG_AGO = RECOVERY_TICKS + 1.0
FIRST_TICKS = 20  # the design's noise counts as so many ticks at the start
NEAR_GAIN = 0.2  # share of the gain with which ticks about a pulse count in the rms
# A pulse this long is no joint. Larger than this (rad/s, m/s2) it is no joint either, but a wrong sample.
MAX_TICKS = 24
MAX_PULSE = np.array([0.02, 6.0])


class Joints:
    """Flags the ticks of pulses, HOLD_TICKS late, so that those before a pulse are flagged, too."""

    _highpass: Sections
    _power: FloatArray
    _ticks: FloatArray  # with a measurement, up to MEMORY_TICKS
    _left: FloatArray  # ticks for which the newest large one still counts
    _length: FloatArray  # large ticks since it was quiet for HOLD_TICKS
    _since: FloatArray  # ticks since the newest pulse
    _first: FloatArray
    _newest: FloatArray

    def __init__(self, highpass: FloatArray, noise_rms: float, axles: int) -> None:
        self._highpass = Sections(highpass, 1, axles)
        self._floor = (FLOOR * noise_rms) ** 2
        self._power = np.full(axles, noise_rms**2)
        self._ticks = np.zeros(axles)
        self._left = np.zeros(axles)
        self._length = np.zeros(axles)
        self._since = np.full(axles, LONG_AGO)
        # An offset is no step, neither when it comes nor when a measurement is missing: the high-pass is given
        # differences to the first sample, and the newest again where there is none.
        self._first = np.zeros(axles)
        self._newest = np.zeros(axles)

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._highpass.reset(axle)
        self._power[axle] = self._floor / FLOOR**2
        self._ticks[axle] = self._left[axle] = self._length[axle] = 0.0
        self._since[axle] = LONG_AGO
        self._first[axle] = self._newest[axle] = 0.0

    def step(self, lat_accel: FloatArray, present: BoolArray) -> tuple[BoolArray, BoolArray]:
        """One tick's lateral accelerations (n,). Returns where it is a pulse, and where it is one or just after."""
        self._first = np.where(present & (self._ticks == 0.0), lat_accel, self._first)
        self._newest = np.where(present, lat_accel - self._first, self._newest)
        high = self._highpass.step(self._newest[None])[0]
        square = high * high
        usual = np.maximum(self._power, self._floor)
        large: BoolArray = present & (square > PULSE_SIGMA**2 * usual)
        self._length = np.where(large, self._length + 1.0, np.where(self._left > 0, self._length, 0.0))
        before = self._left > 0
        self._left = np.where(large, HOLD_TICKS + 1.0, np.maximum(self._left - 1.0, 0.0))
        joint = self._length <= MAX_TICKS
        pulse, near = large & joint, (self._left > 0) & joint
        self._ticks = np.minimum(self._ticks + present, MEMORY_TICKS)
        gain = np.where(present, np.maximum(GAIN, 1.0 / (self._ticks + FIRST_TICKS)), 0.0)
        gain *= np.where(pulse | (before & joint), NEAR_GAIN, 1.0)
        self._power = self._power + gain * (np.minimum(square, CLIP * usual) - self._power)
        self._since = np.where(pulse, 0.0, np.minimum(self._since + 1.0, LONG_AGO))
        return pulse, near

    @property
    def recovering(self) -> BoolArray:
        """(n,): whether a pulse is so recent that the filters still swing."""
        return np.asarray(self._since <= RECOVERY_TICKS)
