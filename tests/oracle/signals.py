"""The oracle of what the sensors bring beside the track: offsets, noise, joints, absurd values."""

import math

import numpy as np

from tests.support.stepped import Outliers
from wrcd.core.design import BoolArray, FloatArray
from wrcd.core.terms import CHANNELS, MODELS


def state_space(sos: FloatArray) -> FloatArray:
    """[A B; C D] (2 k + 1, 2 k + 1) of k sections in cascade; rows of sos: b0 b1 b2 1 a1 a2 (transposed form II)."""
    k = len(sos)
    M = np.zeros((2 * k + 1, 2 * k + 1))
    row = np.zeros(2 * k + 1)  # the signal between the sections, as a function of [state; input]
    row[-1] = 1.0
    for i, (b0, b1, b2, _, a1, a2) in enumerate(sos):
        out = b0 * row
        out[2 * i] += 1.0
        M[2 * i] = b1 * row - a1 * out
        M[2 * i, 2 * i + 1] += 1.0
        M[2 * i + 1] = b2 * row - a2 * out
        row = out
    M[-1] = row
    return M


class Sections:
    """A recursive filter over `channels` signals of every axle."""

    _x: FloatArray

    def __init__(self, sos: FloatArray, channels: int, axles: int) -> None:
        self._M = state_space(sos)
        self._x = np.zeros((2 * len(sos), channels, axles))

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._x[:, :, axle] = 0.0

    def step(self, u: FloatArray) -> FloatArray:
        """Filter one tick: u (channels, n). Returns the same shape."""
        x = np.concatenate((self._x, u[None]))
        out = (self._M @ x.reshape(len(x), -1)).reshape(x.shape)
        self._x = out[:-1]
        y: FloatArray = out[-1]
        return y


# An innovation is an outlier if it is this many times its usual size for every model: yaw rate, lateral acceleration.
GATE_SIGMA = np.array([[4.5], [12.0]])
GATE_MEMORY_TICKS = 100.0  # over which the usual size is taken
GATE_MIN_TICKS = 20.0  # before it is known well enough to judge by
# If one of the first GATE_MIN_TICKS samples holds more than this share of their total power for every model, it was an
# outlier that widened the gate: reset the axle.
MAX_PEAK_SHARE = 0.3
MAX_NET_OUTLIERS = np.array([[2.0], [8.0]])  # outliers less accepted samples
# Whatever the innovations say: no wheelset's yaw rate (rad/s) changes by so much within a tick.
MAX_JUMP, COMPARED_TICKS = 0.08, 3
_SQUARES = GATE_SIGMA**2


class Gate:
    """Judges innovations by their running mean square, per model, channel and axle."""

    _power: FloatArray
    _peak: FloatArray  # of the first GATE_MIN_TICKS
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
        known = (self._count >= GATE_MIN_TICKS) | ~np.isfinite(e).all(axis=0)
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
        self._count = np.minimum(self._count + used, GATE_MEMORY_TICKS)
        gain = np.where(used, 1.0 / np.maximum(self._count, 1.0), 0.0)
        power = e * e
        self._power = self._power + gain * (power - self._power)
        out: BoolArray = np.any(self._net_outliers > MAX_NET_OUTLIERS, axis=0)
        if self._count.min() <= GATE_MIN_TICKS + 1.0:
            early = self._count <= GATE_MIN_TICKS
            self._peak = np.where(early, np.maximum(self._peak, np.where(used, power, 0.0)), 0.0)
            alone = np.all(self._peak > MAX_PEAK_SHARE * GATE_MIN_TICKS * self._power, axis=0)
            out |= np.any(alone & (self._count == GATE_MIN_TICKS) & used, axis=0)
        return out


# A pulse is so many times the running rms of the accelerometer above the band; the rms is never taken as less than
# FLOOR of the design's sensor noise, and forgets within 1 / JOINTS_GAIN ticks. A square counts as no more than CLIP.
PULSE_SIGMA = 5.0
FLOOR = 0.8
JOINTS_GAIN, CLIP = 0.005, 9.0
JOINTS_MEMORY_TICKS = 1.0 / JOINTS_GAIN
HOLD_TICKS = 4  # before and behind a pulse
RECOVERY_TICKS = 80  # the filters swing as long as this after a pulse: their innovations are large, but no outliers
LONG_AGO = RECOVERY_TICKS + 1.0
JOINTS_FIRST_TICKS = 20  # the design's noise counts as so many ticks at the start
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
        self._ticks = np.minimum(self._ticks + present, JOINTS_MEMORY_TICKS)
        gain = np.where(present, np.maximum(JOINTS_GAIN, 1.0 / (self._ticks + JOINTS_FIRST_TICKS)), 0.0)
        gain *= np.where(pulse | (before & joint), NEAR_GAIN, 1.0)
        self._power = self._power + gain * (np.minimum(square, CLIP * usual) - self._power)
        self._since = np.where(pulse, 0.0, np.minimum(self._since + 1.0, LONG_AGO))
        return pulse, near

    @property
    def recovering(self) -> BoolArray:
        """(n,): whether a pulse is so recent that the filters still swing."""
        return np.asarray(self._since <= RECOVERY_TICKS)


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
NOISE_GAIN = 70.0
NOISE_MEMORY_TICKS = 400.0
NOISE_FIRST_TICKS = 60.0  # the design's noise counts as so many ticks at the start
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
        self._count = np.full((CHANNELS, axles), NOISE_FIRST_TICKS)

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._run[axle] = 0.0
        self._power[:, axle] = 1.0
        self._count[:, axle] = NOISE_FIRST_TICKS

    def step(self, z: FloatArray, used: BoolArray) -> None:
        """Measurements (2, n), and of which axles (n,) they are used."""
        z = z * self._scale
        past = np.concatenate((self._past, z[None]))
        difference = np.tensordot(WEIGHTS[::-1], past, 1)
        known = used & (self._run >= len(self._past))
        power = np.minimum(difference * difference / NOISE_GAIN, MAX_POWER_RATIO * self._power)
        self._count = np.minimum(self._count + known, NOISE_MEMORY_TICKS)
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
