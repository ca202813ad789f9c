"""Gyro and accelerometer of an axle from what the simulation gives to what their noise is added to.

With inner sampling a sample of the simulation, a mean over 5 ms, is held for the inner samples of its own interval.
Held, not joined by lines: that needs no sample of the future, delays nothing, and with a corner far above 100 Hz the
pair gives the simulation's means. What follows is linear and read once a sample, so the steps of the hold fold into
nothing; only what clips and rectifies and what is made at the inner rate does, the axle box's vibration.
"""

import numpy as np

from sim_ecu.physics.axlebox import FRAME_SHARE, AxleBox, AxleBoxStream
from sim_ecu.physics.sensors import BOGIE_FRAME, FloatArray, Sampling, SensorSet
from sim_ecu.physics.wheelset import FRAME_LAT_ACCEL, FRAME_YAW_RATE, LAT_ACCEL, ROLL_RATE, YAW_RATE

PAST = 2  # samples that are kept to read a sensor earlier


class InertialStream:
    """The pair in blocks: any division of the samples into blocks gives the same values.

    rng: of vibration; track_rng: of joints (see `AxleBoxStream`); jitter_rng: of the times of reading.
    Raises ValueError for an inner rate that is no multiple of the samples' and for readings PAST samples old.
    """

    clipped = 0  # inner samples of the accelerometer beyond its range so far

    def __init__(
        self, sensors: SensorSet, box: AxleBox, tick_s: float, rng: np.random.Generator,
        track_rng: np.random.Generator | None = None, jitter_rng: np.random.Generator | None = None,
    ) -> None:  # fmt: skip
        self._sensors, self._jitter_rng = sensors, jitter_rng or rng
        on_frame = sensors.mounting == BOGIE_FRAME
        self._columns = [FRAME_YAW_RATE, FRAME_LAT_ACCEL] if on_frame else [YAW_RATE, LAT_ACCEL]
        rate_hz = 1.0 / tick_s if sensors.sampling is None else sensors.sampling.rate_hz
        self._per_sample = round(rate_hz * tick_s)
        if abs(rate_hz * tick_s - self._per_sample) > 1e-6 or self._per_sample < 1:
            raise ValueError(f"an inner rate of {rate_hz:g} Hz is no multiple of {1 / tick_s:g} Hz")
        if sensors.lateral_lead_s + sensors.jitter_s > PAST * tick_s * (1 + 1e-9):
            raise ValueError(f"lateral_lead_s and jitter_s must not exceed {PAST} samples, {PAST * tick_s:g} s")
        self._inner_s = tick_s / self._per_sample
        self._box = AxleBoxStream(box.times(FRAME_SHARE) if on_frame else box, self._inner_s, rng, track_rng)
        self._sos: FloatArray | None = None
        if sensors.sampling is not None:
            from scipy.signal import butter  # half a second, and needed by sensors with a sampling of their own alone

            self._sos = butter(sensors.sampling.order, sensors.sampling.corner_hz, fs=rate_hz, output="sos")
        self._state: FloatArray | None = None  # of the low-pass (sections, 2, 2)
        self._past: FloatArray | None = None  # the newest PAST samples at the inner rate

    def next(self, outputs: FloatArray, distance_m: FloatArray, speed_m_s: FloatArray) -> FloatArray:
        """Return (yaw rate in rad/s, lateral acceleration in m/s2) of the next samples before noise, (t, 2).

        outputs (t, OUTPUTS) are the axle's from the simulation; distance_m and speed_m_s (t,) its own, at the end of
        each sample.
        """
        s = self._sensors
        true = outputs[:, self._columns]
        if s.plain:
            return np.asarray(true + self._box.next(distance_m, speed_m_s))
        true[:, 0] = np.cos(s.misalignment_rad) * true[:, 0] + np.sin(s.misalignment_rad) * outputs[:, ROLL_RATE]
        back_s = self._inner_s * np.arange(self._per_sample - 1, -1, -1)
        inner_m = (distance_m[:, None] - speed_m_s[:, None] * back_s).ravel()
        vibration = self._box.next(inner_m, np.repeat(speed_m_s, self._per_sample))
        felt = np.repeat(true, self._per_sample, axis=0) + vibration
        felt[:, 0] += s.g_sensitivity * felt[:, 1]
        if s.sampling is not None:
            felt = self._sampled(felt, vibration[:, 1], true[0], s.sampling)
        return self._read(felt)

    def _sampled(self, felt: FloatArray, vibration: FloatArray, first: FloatArray, sampling: Sampling) -> FloatArray:
        """Clip, rectify and low-pass the inner samples; the low-pass begins as if the first had always been."""
        from scipy.signal import sosfilt, sosfilt_zi

        limit = sampling.range_m_s2
        self.clipped += int(np.count_nonzero(np.abs(felt[:, 1]) > limit))
        felt[:, 1] = np.clip(felt[:, 1], -limit, limit)
        squares = vibration * vibration
        felt[:, 0] += sampling.gyro_rectification * squares
        felt[:, 1] += sampling.rectification * squares
        if self._state is None:
            self._state = sosfilt_zi(self._sos)[:, :, None] * first
        out, self._state = sosfilt(self._sos, felt, axis=0, zi=self._state)
        return np.asarray(out)

    def _read(self, felt: FloatArray) -> FloatArray:
        """Take each sensor's value at its time of reading, between inner samples by a straight line."""
        n, s = self._per_sample, self._sensors
        samples = len(felt) // n
        past = np.repeat(felt[:1], PAST * n, axis=0) if self._past is None else self._past
        known = np.concatenate([past, felt])
        self._past = known[len(known) - PAST * n :]
        ends = n * (PAST + np.arange(1, samples + 1)) - 1  # places in known
        if not (s.lateral_lead_s or s.jitter_s):
            return known[ends]
        early_s = np.tile([0.0, s.lateral_lead_s], (samples, 1))
        if s.jitter_s:
            early_s += self._jitter_rng.uniform(0.0, s.jitter_s, (samples, 2))
        early = np.minimum(early_s / self._inner_s, PAST * n)
        whole = np.floor(early).astype(np.int64)
        at, part, channel = ends[:, None] - whole, early - whole, np.arange(2)
        out: FloatArray = (1.0 - part) * known[at, channel] + part * known[np.maximum(at - 1, 0), channel]
        return out
