"""What a real axle box feels and the track's spectrum lacks: vibration, rail joints, a crossing."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

FloatArray = NDArray[np.float64]

SHAPES = ("bipolar", "unipolar")
# A crossing's pulses: metres beyond its place, and each one's share of the largest. The wheel leaves the stock rail,
# strikes the wing rail, then the nose, and settles behind it. This project's own choice.
CROSSING = ((0.0, 0.5), (0.8, -0.8), (1.6, 1.0), (2.4, -0.8), (3.2, 0.5))
SLOWEST_M_S = 1e-3  # a wheel that stands on a joint feels nothing
# Vibration is made in pieces of so many samples, faded into each other, so that a ride may be of any length.
PIECE = 8192
FADE = 512


@dataclass(frozen=True, slots=True)
class AxleBox:
    """Disturbances of the two inertial sensors, none by default.

    The accelerometer's are given; the gyro feels gyro_per_m_s2 of them through rocking: the same pulses, and vibration
    of its own that is independent of the accelerometer's. Pulses keep their duration and size at any speed.
    Raises ValueError for an unknown shape, an empty band or lengths and durations that are not positive.
    """

    vibration_m_s2: float = 0.0  # rms of band-limited vibration on the accelerometer
    band_hz: tuple[float, float] = (20.0, 100.0)  # (0, 100) is white; the upper end is held at the Nyquist frequency
    joint_m_s2: float = 0.0  # peak of the pulse at each rail joint
    joint_every_m: float = 25.0
    joint_s: float = 0.03  # duration of a pulse
    joint_shape: str = "bipolar"  # one sine period, or "unipolar": half a sine
    crossing_m_s2: float = 0.0  # peak of the largest of a crossing's pulses, shaped like the joints'
    crossing_at_m: float = 0.0  # where it begins
    gyro_per_m_s2: float = 0.002  # rad/s that the gyro feels per m/s2

    def __post_init__(self) -> None:
        if self.joint_shape not in SHAPES:
            raise ValueError(f"joint_shape {self.joint_shape!r} is not one of {', '.join(SHAPES)}")
        if not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz {self.band_hz} must rise from 0 or more")
        if self.joint_every_m <= 0 or self.joint_s <= 0:
            raise ValueError("joint_every_m and joint_s must be positive")

    @property
    def quiet(self) -> bool:
        """True if nothing is felt at all."""
        return not (self.vibration_m_s2 or self.joint_m_s2 or self.crossing_m_s2)

    def felt(
        self, distance_m: FloatArray, speed_m_s: FloatArray, tick_s: float, rng: np.random.Generator
    ) -> FloatArray:
        """Return what to add to (yaw rate in rad/s, lateral acceleration in m/s2) before the sensors' noise.

        distance_m and speed_m_s (t,) are those of the axle at the end of each sample of tick_s; returns (t, 2), zeros
        if nothing is on. Draws from rng only for joints (where the first one lies, to which side they push) and for
        vibration.
        """
        return AxleBoxStream(self, tick_s, rng).next(distance_m, speed_m_s)


QUIET = AxleBox()


class AxleBoxStream:
    """The same in blocks: any division of the samples into blocks gives the same values.

    Joints belong to the track: axles that pass the same ones are given generators of the same seed as track_rng
    (default: rng) and their own place along it.
    """

    def __init__(
        self, box: AxleBox, tick_s: float, rng: np.random.Generator, track_rng: np.random.Generator | None = None
    ) -> None:
        self._box, self._tick_s, self._rng = box, tick_s, rng
        self._first_joint_m, self._joint_m_s2 = 0.0, 0.0
        if box.joint_m_s2:
            track = track_rng or rng
            self._first_joint_m = float(track.uniform(0.0, box.joint_every_m))
            self._joint_m_s2 = float(track.choice([-1.0, 1.0])) * box.joint_m_s2
        self._vibration = np.zeros((0, 2))  # made and not yet felt, of rms 1; its last FADE samples fade out

    def next(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return what the next samples feel, (t, 2) as in `AxleBox.felt`."""
        both = np.array([self._box.gyro_per_m_s2, 1.0])
        pulses = self._joints(distance_m, speed_m_s) + self._crossing(distance_m, speed_m_s)
        out: FloatArray = pulses[:, None] * both
        if self._box.vibration_m_s2:
            out += self._vibrate(len(distance_m)) * (self._box.vibration_m_s2 * both)
        return out

    def _vibrate(self, samples: int) -> FloatArray:
        while len(self._vibration) < samples + FADE:
            piece = band_noise(PIECE, 2, self._box.band_hz, self._tick_s, self._rng)
            if len(self._vibration):
                # sine and cosine: the sum of two independent noises keeps its power
                quarter = 0.5 * math.pi * (np.arange(FADE)[:, None] + 0.5) / FADE
                piece[:FADE] = piece[:FADE] * np.sin(quarter) + self._vibration[-FADE:] * np.cos(quarter)
            self._vibration = np.concatenate([self._vibration[:-FADE], piece])
        out, self._vibration = self._vibration[:samples], self._vibration[samples:]
        return out

    def _joints(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        every_m = self._box.joint_every_m
        out = np.zeros(len(distance_m))
        if not self._joint_m_s2:
            return out
        beyond_m = np.mod(distance_m - self._first_joint_m, every_m)
        # the joint just passed, and those before whose pulses are still going on
        reach_m = float(np.max(speed_m_s, initial=0.0)) * (self._box.joint_s + self._tick_s)
        for k in range(math.floor(reach_m / every_m) + 2):
            out += self._joint_m_s2 * self._pulse(beyond_m + k * every_m, speed_m_s)
        return out

    def _crossing(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        out = np.zeros(len(distance_m))
        if self._box.crossing_m_s2:
            for beyond_m, share in CROSSING:
                at_m = self._box.crossing_at_m + beyond_m
                out += share * self._box.crossing_m_s2 * self._pulse(distance_m - at_m, speed_m_s)
        return out

    def _pulse(self, beyond_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """A pulse of size 1 that began beyond_m ago, as its mean over each sample: the anti-alias filter of the
        simulation."""
        ends_s = beyond_m / np.maximum(speed_m_s, SLOWEST_M_S)
        omega = math.pi / self._box.joint_s * (2.0 if self._box.joint_shape == "bipolar" else 1.0)

        def gathered(t: FloatArray) -> FloatArray:
            """Integral of the pulse from its beginning to t seconds."""
            out: FloatArray = (1.0 - np.cos(omega * np.clip(t, 0.0, self._box.joint_s))) / omega
            return out

        return (gathered(ends_s) - gathered(ends_s - self._tick_s)) / self._tick_s


def band_noise(
    samples: int, channels: int, band_hz: tuple[float, float], tick_s: float, rng: np.random.Generator
) -> FloatArray:
    """Gaussian noise (samples, channels) of expected rms 1 with nothing outside the band, which ends at the Nyquist
    frequency. Raises ValueError for a band that lies beyond it."""
    low, high = band_hz[0], min(band_hz[1], 0.5 / tick_s)
    if low >= high:
        raise ValueError(f"a band from {low:g} Hz lies beyond the Nyquist frequency, {0.5 / tick_s:g} Hz")
    # long enough that some frequencies of the transform lie in the band
    n = next_fast_len(max(samples, math.ceil(4.0 / ((high - low) * tick_s))), real=True)
    n += n % 2
    spectrum = rfft(rng.standard_normal((n, channels)), axis=0)
    frequency = rfftfreq(n, tick_s)
    inside = (frequency >= low * (1 - 1e-9)) & (frequency <= high * (1 + 1e-9))
    power = np.full(len(frequency), 2.0)
    power[0] = power[-1] = 1.0  # zero and the Nyquist frequency have no mirror image
    noise: FloatArray = irfft(spectrum * inside[:, None], n, axis=0)[:samples]
    return noise / math.sqrt(power[inside].sum() / n)
