"""A scenario becomes frames: simulate, measure, encode."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.inertial import InertialStream
from sim_ecu.physics.simulation import Axle, Samples, Simulation
from sim_ecu.physics.track import Track
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, MU_USED, SLIP, TORQUE, YAW_RATE, FloatArray
from sim_ecu.play.encoder import SAMPLE_US, Reading, SensorSample, Sent
from sim_ecu.play.inject import at_work, inject
from sim_ecu.play.mapped import Train
from sim_ecu.play.scenario import AxleScenario, Scenario
from sim_ecu.play.train import PACKAGED

# Samples that are simulated at once: in real time as few as leave no gap before the first; where nobody
# waits, many.
CHUNK, LARGE_CHUNK = 20, 400


class Sensing:
    """The sensors of one axle; each channel has its own stream of noise, and the axle box one of vibration."""

    def __init__(self, a: AxleScenario) -> None:
        self._a = a
        self._rngs = [np.random.default_rng([a.seed, 1, k]) for k in range(3)]
        own, track, jitter = (
            np.random.default_rng([seed, k]) for seed, k in ((a.seed, 3), (a.runs_on, 4), (a.seed, 7))
        )
        self._inertial = InertialStream(a.sensors, a.axlebox, SAMPLE_US * 1e-6, own, track, jitter)
        self._each_by_itself = a.axlebox.quiet and a.sensors.plain and not a.sensors.friction_share

    @property
    def clipped(self) -> int:
        """Inner samples of the accelerometer beyond its range so far."""
        return self._inertial.clipped

    def readings(self, s: Samples, place: int) -> FloatArray:
        """(n, 6): the columns of a Reading."""
        y = s.outputs[:, place]
        sensors = self._a.sensors
        felt = self._inertial.next(y, s.distance_m + self._a.position_m, s.speed_m_s)
        return np.column_stack((
            sensors.yaw_rate.measure(felt[:, 0], self._rngs[0]),
            sensors.lat_accel.measure(felt[:, 1], self._rngs[1]),
            sensors.torque.measure(sensors.known_torque(y[:, TORQUE]), self._rngs[2]),
            100 * y[:, MU_AVAILABLE], np.abs(100 * y[:, MU_USED]), y[:, SLIP],
        ))  # fmt: skip

    def reading(self, s: Samples, place: int) -> list[float]:
        """The same of a single sample, (6,)."""
        if not self._each_by_itself:
            out: list[float] = self.readings(s, place)[0].tolist()
            return out
        y, sensors = s.outputs[0, place].tolist(), self._a.sensors
        yaw, lat, torque = self._rngs
        return [
            sensors.yaw_rate.measure_one(y[YAW_RATE], yaw), sensors.lat_accel.measure_one(y[LAT_ACCEL], lat),
            sensors.torque.measure_one(y[TORQUE], torque), 100 * y[MU_AVAILABLE], abs(100 * y[MU_USED]), y[SLIP],
        ]  # fmt: skip


def on_tracks(axles: Sequence[AxleScenario]) -> list[Axle]:
    """The axles where they run; those of one seed and spectrum on the same track."""
    behind_m = max(0.0, *(-a.position_m for a in axles))
    tracks = {of: Track(*of, behind_m) for of in {(a.track, a.runs_on) for a in axles}}
    return [Axle(a.rail, tracks[a.track, a.runs_on], a.position_m) for a in axles]


class Player:
    """Iterates over the samples of a scenario: (end of the sample in us, its frames).

    Raises InputError for an axle, a fault or the truth that the train's messages have no place for.
    """

    def __init__(self, scenario: Scenario, truth: bool = True, chunk: int = CHUNK, train: Train = PACKAGED) -> None:
        self.scenario = scenario
        numbers = [a.number for a in scenario.axles]
        self._train, self._encoder = train, train.encoder(numbers, truth)
        at_work(scenario.faults, numbers, scenario.axles[0].seed, train)  # whether they can be made
        self._axles = scenario.axles
        self._chunk = chunk
        start = float(scenario.speed.at(np.zeros(1))[0])
        self._simulation = Simulation(scenario.wheelset, on_tracks(self._axles), start, SAMPLE_US * 1e-6)
        self._sensing = [Sensing(a) for a in self._axles]
        self._speed_rng = np.random.default_rng([self._axles[0].seed, 2])
        self._truth = truth
        self.samples = round(scenario.duration_s * 1e6 / SAMPLE_US)

    def __iter__(self) -> Iterator[tuple[int, list[Sent]]]:
        numbers = [a.number for a in self._axles]
        if self.scenario.faults:
            seed = self._axles[0].seed
            faults = self.scenario.faults
            yield from inject(self.measured(), faults, numbers, seed, self._truth, self._train)
            return
        for sample in self.measured():
            yield sample.due_us, list(self._encoder.frames(sample))

    @property
    def clipped(self) -> list[int]:
        """By axle: inner samples of its accelerometer beyond the range so far."""
        return [s.clipped for s in self._sensing]

    def measured(self) -> Iterator[SensorSample]:
        """Yield what the sensors measure, sample by sample, before any fault."""
        for due_us, speed, readings in self.measured_chunks():
            for due, v, of in zip(due_us.tolist(), speed.tolist(), readings.tolist(), strict=True):
                own = tuple(Reading(a.number, *row) for a, row in zip(self._axles, of, strict=True))
                yield SensorSample(due, v, own)

    def measured_chunks(self) -> Iterator[tuple[NDArray[np.int64], FloatArray, FloatArray]]:
        """Yield the same by chunks of samples: their ends (n,), us; speed (n,); columns of a Reading (n, axles, 6)."""
        for first in range(0, self.samples, self._chunk):
            numbers = np.arange(first + 1, min(first + self._chunk, self.samples) + 1)
            t: FloatArray = numbers.astype(np.float64) * (SAMPLE_US * 1e-6)
            s = self._simulation.advance(self.scenario.commands(t), self.scenario.held_speed(t))
            speed = self._axles[0].sensors.speed.measure(s.speed_m_s, self._speed_rng)
            readings = [sensing.readings(s, place) for place, sensing in enumerate(self._sensing)]
            yield numbers * SAMPLE_US, speed, np.stack(readings, axis=1)
