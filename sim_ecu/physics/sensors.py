"""Sensors: noise, bias, range and quantisation. Their anti-alias filter is the mean over the sample interval, taken
by the simulation; noise is added after it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
class SensorSet:
    """The four channels that the estimator lives on. Torque and speed come from the traction control unit."""

    name: str
    yaw_rate: Sensor  # rad/s
    lat_accel: Sensor  # m/s2
    torque: Sensor = Sensor(50.0, 80_000.0, 0.0)  # N m
    speed: Sensor = Sensor(0.005, 160.0, 0.0)  # m/s

    def biased(self, yaw_rate: float, lat_accel: float, torque: float) -> "SensorSet":
        """Return the same set with constant biases."""
        return replace(
            self,
            yaw_rate=replace(self.yaw_rate, bias=yaw_rate),
            lat_accel=replace(self.lat_accel, bias=lat_accel),
            torque=replace(self.torque, bias=torque),
        )


# Quantisation is a 16-bit converter over the range for mems, 24 bits (none that shows) for tactical.
SENSOR_SETS = {
    s.name: s
    for s in (
        SensorSet("tactical", Sensor(5.0e-5, 8.0, 0.0), Sensor(0.005, 80.0, 0.0)),
        SensorSet("mems", Sensor(3.0e-4, 2.0, 2.0 * 2 / 65536), Sensor(0.01, 20.0, 2.0 * 20 / 65536)),
    )
}
