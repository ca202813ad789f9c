"""What a real axle box feels and the track's spectrum lacks: vibration, joints, a crossing, corrugation, a flat."""

import math
from dataclasses import dataclass, replace

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
# Corrugation of one depth shakes with the square of the speed; it is given at this one (m/s).
CORRUGATION_M_S = 25.0
# How long a wheel flat's blow lasts. This project's own choice: a flat of 50 mm is passed in 2 ms at 25 m/s.
FLAT_S = 0.004
# Share of an axle box's vibration that the bogie frame feels above the primary suspension. This project's own choice:
# near the middle of a tenth to a thirtieth.
FRAME_SHARE = 1 / 15


@dataclass(frozen=True, slots=True)
class AxleBox:
    """Disturbances of the two inertial sensors, none by default.

    The accelerometer's are given; the gyro feels gyro_per_m_s2 of them through rocking: the same pulses, and vibration
    of its own that is independent of the accelerometer's. Pulses keep their duration and size at any speed. All are
    means over the interval in which they are sampled, the simulation's at 200 Hz or the sensor's own.
    Raises ValueError for an unknown shape, an empty band or lengths and durations that are not positive.
    """

    vibration_m_s2: float = 0.0  # rms of band-limited vibration on the accelerometer
    # (0, 100) is white. The upper end is held at the Nyquist frequency of the sampling, and the rms is what lies below.
    band_hz: tuple[float, float] = (20.0, 100.0)
    vibration_power: float = 0.0  # its density goes with frequency to this power; 0 is flat
    joint_m_s2: float = 0.0  # peak of the pulse at each rail joint
    joint_every_m: float = 25.0
    joint_s: float = 0.03  # duration of a pulse
    joint_shape: str = "bipolar"  # one sine period, or "unipolar": half a sine
    crossing_m_s2: float = 0.0  # peak of the largest of a crossing's pulses, shaped like the joints'
    crossing_at_m: float = 0.0  # where it begins
    corrugation_m_s2: float = 0.0  # amplitude at CORRUGATION_M_S; it goes with the speed's square
    corrugation_wavelength_m: float = 0.05
    corrugation_m: tuple[float, float] = (-1e7, 1e7)  # from where to where; everywhere
    flat_m_s2: float = 0.0  # peak of a wheel flat's blow, one sine period of FLAT_S
    flat_every_m: float = math.pi  # a turn of the wheel, which rolls: its creep is left out
    gyro_per_m_s2: float = 0.002  # rad/s that the gyro feels per m/s2

    def __post_init__(self) -> None:
        if self.joint_shape not in SHAPES:
            raise ValueError(f"joint_shape {self.joint_shape!r} is not one of {', '.join(SHAPES)}")
        if not 0 <= self.band_hz[0] < self.band_hz[1]:
            raise ValueError(f"band_hz {self.band_hz} must rise from 0 or more")
        if self.joint_every_m <= 0 or self.joint_s <= 0:
            raise ValueError("joint_every_m and joint_s must be positive")
        if self.corrugation_wavelength_m <= 0 or self.flat_every_m <= 0:
            raise ValueError("corrugation_wavelength_m and flat_every_m must be positive")
        if self.vibration_power < 0:
            raise ValueError(f"vibration_power {self.vibration_power} must not be negative")

    @property
    def quiet(self) -> bool:
        """True if nothing is felt at all."""
        pulses = self.joint_m_s2 or self.crossing_m_s2 or self.flat_m_s2
        return not (self.vibration_m_s2 or self.corrugation_m_s2 or pulses)

    def times(self, share: float) -> "AxleBox":
        """Return the same disturbances, so much stronger or weaker."""
        return replace(self, **{name: share * getattr(self, name) for name in SIZES})

    def felt(
        self, distance_m: FloatArray, speed_m_s: FloatArray, tick_s: float, rng: np.random.Generator
    ) -> FloatArray:
        """Return what to add to (yaw rate in rad/s, lateral acceleration in m/s2) before the sensors' noise.

        distance_m and speed_m_s (t,) are those of the axle at the end of each sample of tick_s; returns (t, 2), zeros
        if nothing is on. Draws from rng only for joints (where the first one lies, to which side they push), a flat
        (where it begins) and for vibration.
        """
        return AxleBoxStream(self, tick_s, rng).next(distance_m, speed_m_s)


SIZES = ("vibration_m_s2", "joint_m_s2", "crossing_m_s2", "corrugation_m_s2", "flat_m_s2")  # fields of an AxleBox
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
        self._first_flat_m = float(rng.uniform(0.0, box.flat_every_m)) if box.flat_m_s2 else 0.0
        self._vibration = np.zeros((0, 2))  # made and not yet felt, of rms 1; its last FADE samples fade out

    def next(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return what the next samples feel, (t, 2) as in `AxleBox.felt`."""
        both = np.array([self._box.gyro_per_m_s2, 1.0])
        box = self._box
        pulses = self._joints(distance_m, speed_m_s) + self._crossing(distance_m, speed_m_s)
        if box.corrugation_m_s2:
            pulses += self._corrugation(distance_m, speed_m_s)
        if box.flat_m_s2:
            pulses += self._repeated(
                distance_m - self._first_flat_m, speed_m_s, box.flat_every_m, box.flat_m_s2, FLAT_S, True
            )
        out: FloatArray = pulses[:, None] * both
        if box.vibration_m_s2:
            out += self._vibrate(len(distance_m)) * (box.vibration_m_s2 * both)
        return out

    def _vibrate(self, samples: int) -> FloatArray:
        while len(self._vibration) < samples + FADE:
            piece = band_noise(PIECE, 2, self._box.band_hz, self._tick_s, self._rng, self._box.vibration_power)
            if len(self._vibration):
                # sine and cosine: the sum of two independent noises keeps its power
                quarter = 0.5 * math.pi * (np.arange(FADE)[:, None] + 0.5) / FADE
                piece[:FADE] = piece[:FADE] * np.sin(quarter) + self._vibration[-FADE:] * np.cos(quarter)
            self._vibration = np.concatenate([self._vibration[:-FADE], piece])
        out, self._vibration = self._vibration[:samples], self._vibration[samples:]
        return out

    def _joints(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        if not self._joint_m_s2:
            return np.zeros(len(distance_m))
        box, beyond_m = self._box, distance_m - self._first_joint_m
        bipolar = box.joint_shape == "bipolar"
        return self._repeated(beyond_m, speed_m_s, box.joint_every_m, self._joint_m_s2, box.joint_s, bipolar)

    def _crossing(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        out, box = np.zeros(len(distance_m)), self._box
        if box.crossing_m_s2:
            for beyond_m, share in CROSSING:
                ends_s = _since(distance_m - (box.crossing_at_m + beyond_m), speed_m_s)
                out += share * box.crossing_m_s2 * self._pulse(ends_s, box.joint_s, box.joint_shape == "bipolar")
        return out

    def _repeated(
        self, distance_m: FloatArray, speed_m_s: FloatArray, every_m: float, size: float, lasts_s: float, bipolar: bool
    ) -> FloatArray:
        """Pulses at 0, every_m, 2 every_m …"""
        beyond_m = np.mod(distance_m, every_m)
        out = np.zeros(len(distance_m))
        # the one just passed, and those before whose pulses are still going on
        reach_m = float(np.max(speed_m_s, initial=0.0)) * (lasts_s + self._tick_s)
        for k in range(math.floor(reach_m / every_m) + 2):
            out += size * self._pulse(_since(beyond_m + k * every_m, speed_m_s), lasts_s, bipolar)
        return out

    def _corrugation(self, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """A sine over the distance; where it goes by faster than samples follow it is the mean of each."""
        box = self._box
        turns = speed_m_s * self._tick_s / box.corrugation_wavelength_m  # in a sample
        middle = np.sin(2.0 * math.pi * (distance_m / box.corrugation_wavelength_m - 0.5 * turns))
        size = box.corrugation_m_s2 * (speed_m_s / CORRUGATION_M_S) ** 2
        there = (distance_m > box.corrugation_m[0]) & (distance_m <= box.corrugation_m[1])
        out: FloatArray = size * middle * np.sinc(turns) * there
        return out

    def _pulse(self, ends_s: FloatArray, lasts_s: float, bipolar: bool) -> FloatArray:
        """A pulse of size 1 that began ends_s ago, as its mean over each sample: the anti-alias filter of the
        simulation."""
        omega = math.pi / lasts_s * (2.0 if bipolar else 1.0)

        def gathered(t: FloatArray) -> FloatArray:
            """Integral of the pulse from its beginning to t seconds."""
            return np.asarray((1.0 - np.cos(omega * np.clip(t, 0.0, lasts_s))) / omega)

        out = np.zeros(len(ends_s))
        felt = (ends_s > 0.0) & (ends_s < lasts_s + self._tick_s)
        if felt.any():
            t = ends_s[felt]
            out[felt] = (gathered(t) - gathered(t - self._tick_s)) / self._tick_s
        return out


def _since(beyond_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Seconds since a place was passed."""
    out: FloatArray = beyond_m / np.maximum(speed_m_s, SLOWEST_M_S)
    return out


def band_noise(
    samples: int, channels: int, band_hz: tuple[float, float], tick_s: float, rng: np.random.Generator,
    power_law: float = 0.0,
) -> FloatArray:  # fmt: skip
    """Gaussian noise (samples, channels) of expected rms 1 with nothing outside the band, which ends at the Nyquist
    frequency; inside, its density goes with frequency to the power_law. Raises ValueError for a band beyond it."""
    low, high = band_hz[0], min(band_hz[1], 0.5 / tick_s)
    if low >= high:
        raise ValueError(f"a band from {low:g} Hz lies beyond the Nyquist frequency, {0.5 / tick_s:g} Hz")
    # long enough that some frequencies of the transform lie in the band
    n = next_fast_len(max(samples, math.ceil(4.0 / ((high - low) * tick_s))), real=True)
    n += n % 2
    spectrum = rfft(rng.standard_normal((n, channels)), axis=0)
    frequency = rfftfreq(n, tick_s)
    inside = (frequency >= low * (1 - 1e-9)) & (frequency <= high * (1 + 1e-9))
    density = np.where(inside, frequency**power_law, 0.0)
    power = np.full(len(frequency), 2.0)
    power[0] = power[-1] = 1.0  # zero and the Nyquist frequency have no mirror image
    noise: FloatArray = irfft(spectrum * np.sqrt(density)[:, None], n, axis=0)[:samples]
    return noise / math.sqrt((power * density)[inside].sum() / n)


def drawn_box(rng: np.random.Generator, wider: float = 1.0) -> AxleBox:
    """Return an axle box's vibration for sensors with inner sampling. wider 1.5 stretches the ranges by so much.

    Vibration of 2 to 20 m/s2 rms between 20 and 1000 Hz, its density rising with frequency to a power of 1 to 2: track
    whose displacement falls with its second to third power. In two fifths joints of 5 to 50 m/s2, in a quarter
    corrugation of 5 to 50 m/s2 and 25 to 80 mm. No wheel flats: judging has them. The gyro feels less per m/s2 than
    below 100 Hz: an angle's rate falls with frequency for one acceleration. All are this project's own choice.
    """

    def between(low: float, high: float) -> float:
        """From low / wider to high wider, evenly in the log."""
        return math.exp(rng.uniform(math.log(low / wider), math.log(high * wider)))

    def some(share: float, low: float, high: float) -> float:
        return between(low, high) if rng.random() < share else 0.0

    return AxleBox(
        vibration_m_s2=between(2.0, 20.0),
        band_hz=(20.0, 1000.0),
        vibration_power=float(rng.uniform(max(1.5 - 0.5 * wider, 0.0), 1.5 + 0.5 * wider)),
        joint_m_s2=some(0.4, 5.0, 50.0),
        joint_shape=str(rng.choice(SHAPES)),
        joint_s=between(0.02, 0.04),
        corrugation_m_s2=some(0.25, 5.0, 50.0),
        corrugation_wavelength_m=between(0.025, 0.08),
        gyro_per_m_s2=between(1e-4, 5e-4),
    )
