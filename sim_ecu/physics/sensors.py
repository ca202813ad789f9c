"""Sensors: noise, bias, range and quantisation; how the inertial pair samples inside, and how it is mounted.

Without inner sampling the anti-alias filter is the mean over the sample interval, taken by the simulation. Noise is
added after it. `inertial` carries a pair through its samples.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
G = 9.80665  # m/s2, as sensors state their ranges
# m/s2 per (m/s2)2: an offset of 0.1 g at 7.5 g rms is one data sheet's figure.
RECTIFICATION = 0.1 * G / (7.5 * G) ** 2
AXLE_BOX, BOGIE_FRAME = "axle box", "bogie frame"
MOUNTINGS = (AXLE_BOX, BOGIE_FRAME)


@dataclass(frozen=True, slots=True)
class Sensor:
    """One channel, in the unit of its quantity."""

    noise_rms: float  # per sample at 200 Hz
    limit: float  # measures up to ± limit
    step: float  # quantisation; 0 for none
    bias: float = 0.0
    gain: float = 1.0

    def measure(self, truth: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Return what the sensor measures, same shape as the truth. Draws one number per sample from rng."""
        noisy = self.gain * truth + self.bias + self.noise_rms * rng.standard_normal(truth.shape)
        if self.step > 0:
            noisy = np.round(noisy / self.step) * self.step
        clipped: FloatArray = np.clip(noisy, -self.limit, self.limit)
        return clipped

    def measure_one(self, truth: float, rng: np.random.Generator) -> float:
        """Return the measured value of one sample: the same number, from the same draw."""
        noisy = self.gain * truth + self.bias + self.noise_rms * rng.standard_normal()
        if self.step > 0:
            noisy = round(noisy / self.step) * self.step
        return min(max(noisy, -self.limit), self.limit)


@dataclass(frozen=True, slots=True)
class Sampling:
    """How the two inertial sensors sample inside before they give 200 Hz.

    A sample is clipped, low-passed (Butterworth) and every so many are handed on. What vibration leaves as an offset
    by the sensors' own curvature goes through the low-pass too.
    Raises ValueError for a corner that is not below half of the rate, an order below 1 or a range that is not positive.
    """

    rate_hz: float = 4000.0  # a multiple of 200 Hz
    corner_hz: float = 80.0
    order: int = 2
    range_m_s2: float = 16 * G  # the accelerometer clips at ± this
    rectification: float = RECTIFICATION  # of the accelerometer, m/s2 per (m/s2)2 of vibration
    gyro_rectification: float = 0.0  # of the gyro, rad/s per (m/s2)2

    def __post_init__(self) -> None:
        if not 0.0 < self.corner_hz < 0.5 * self.rate_hz:
            raise ValueError(f"corner_hz {self.corner_hz:g} must lie below half of rate_hz, {0.5 * self.rate_hz:g}")
        if self.order < 1 or self.range_m_s2 <= 0:
            raise ValueError("order must be 1 or more and range_m_s2 positive")


@dataclass(frozen=True, slots=True)
class SensorSet:
    """The four channels that the estimator lives on. Torque and speed come from the traction control unit."""

    name: str
    yaw_rate: Sensor  # rad/s
    lat_accel: Sensor  # m/s2
    torque: Sensor = Sensor(50.0, 80_000.0, 0.0)  # N m
    speed: Sensor = Sensor(0.005, 160.0, 0.0)  # m/s
    sampling: Sampling | None = None  # None: both sensors give the mean over the sample
    mounting: str = AXLE_BOX
    g_sensitivity: float = 0.0  # rad/s that the gyro reads per m/s2 to the left
    misalignment_rad: float = 0.0  # of the gyro's axis: the sine of it lets roll rate in
    lateral_lead_s: float = 0.0  # so much earlier than the end of its sample the accelerometer is read
    jitter_s: float = 0.0  # each sensor is read up to so much earlier, at random
    friction_share: float = 0.0  # of a braking torque that friction brakes make
    friction_gain: float = 1.0  # how that part is read; 0: not at all

    def biased(self, yaw_rate: float, lat_accel: float, torque: float) -> "SensorSet":
        """Return the same set with constant biases."""
        return replace(
            self,
            yaw_rate=replace(self.yaw_rate, bias=yaw_rate),
            lat_accel=replace(self.lat_accel, bias=lat_accel),
            torque=replace(self.torque, bias=torque),
        )

    @property
    def plain(self) -> bool:
        """True if the inertial pair is on the axle box and measures each sample by itself."""
        return (
            self.sampling is None and self.mounting == AXLE_BOX
            and not (self.g_sensitivity or self.misalignment_rad or self.lateral_lead_s or self.jitter_s)
        )  # fmt: skip

    def known_torque(self, torque: FloatArray) -> FloatArray:
        """Return what the traction control unit knows of the torque at the axle (N m): friction brakes misread."""
        out: FloatArray = torque - self.friction_share * (1.0 - self.friction_gain) * np.minimum(torque, 0.0)
        return out


def accelerometer(range_m_s2: float) -> Sensor:
    """Return a mems accelerometer of so wide a range. What it gives after its low-pass ends at 80 m/s2."""
    return Sensor(0.01, min(range_m_s2, 80.0), 2.0 * range_m_s2 / 65536)


# Quantisation is a 16-bit converter over the range for mems, 24 bits (none that shows) for tactical.
_TACTICAL = SensorSet("tactical", Sensor(5.0e-5, 8.0, 0.0), Sensor(0.005, 80.0, 0.0))
_MEMS = SensorSet("mems", Sensor(3.0e-4, 2.0, 2.0 * 2 / 65536), Sensor(0.01, 20.0, 2.0 * 20 / 65536))
SENSOR_SETS = {
    s.name: s
    for s in (
        _TACTICAL,
        _MEMS,
        replace(_MEMS, name="mems-axle-box", lat_accel=accelerometer(16 * G), sampling=Sampling()),
        replace(_MEMS, name="mems-8g", lat_accel=accelerometer(8 * G), sampling=Sampling(range_m_s2=8 * G)),
    )
}


def drawn(rng: np.random.Generator, wider: float = 1.0) -> SensorSet:
    """Return mems sensors that sample inside, one in a family. wider 1.5 stretches the ranges by so much.

    Inner rate 1, 2, 4 or 8 kHz, corner 25 to 60 Hz of order 3 to 6, range 2, 8 or 16 g, rectification from none to
    the data sheet's, of the gyro to 0.001 degrees/s per g2, g-sensitivity to 0.1 degrees/s per g of either sign,
    misalignment to 2 degrees, the accelerometer read up to a tick of 5 ms earlier with up to 1 ms of jitter, the speed
    off by 1 to 3 %. The gyro's figures are this project's own choice, of the usual size for such parts. With a lower
    order or a higher corner an axle box's vibration buries the signal.
    """
    range_g = float(rng.choice([2.0, 8.0, 16.0]))
    sampling = Sampling(
        rate_hz=float(rng.choice([1000.0, 2000.0, 4000.0, 8000.0])),
        corner_hz=math.exp(rng.uniform(math.log(25.0 / wider), math.log(60.0 * wider))),
        order=int(rng.integers(3, 7)),
        range_m_s2=range_g * G,
        rectification=float(rng.uniform(0.0, RECTIFICATION * wider)),
        gyro_rectification=float(rng.uniform(0.0, math.radians(0.001) / G**2 * wider)),
    )
    sensitive, askew = math.radians(0.1) / G * wider, math.radians(2.0) * wider
    return replace(
        _MEMS,
        name="drawn",
        lat_accel=accelerometer(range_g * G),
        speed=replace(_MEMS.speed, gain=1.0 + float(rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.03 * wider))),
        sampling=sampling,
        g_sensitivity=float(rng.uniform(-sensitive, sensitive)),
        misalignment_rad=float(rng.uniform(-askew, askew)),
        lateral_lead_s=float(rng.uniform(0.0, 0.005 * wider)),
        jitter_s=float(rng.uniform(0.0, 0.001 * wider)),
    )
