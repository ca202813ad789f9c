"""What the rig's sensors tell wrcd: measured, made frames, and with the scenario's faults on the way."""

from collections.abc import Iterator, Sequence

import numpy as np

from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.scenario_keys import WHEELS
from sim_ecu.loop.train_speed import TrainSpeed
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Samples
from sim_ecu.physics.wheelset import FloatArray
from sim_ecu.play.encoder import SAMPLE_US, Encoder, Reading, Sample, Sent
from sim_ecu.play.faults import SILENT, Fault
from sim_ecu.play.inject import at_work, inject
from sim_ecu.play.player import Sensing
from sim_ecu.play.train import PACKAGED, Train

TACHOMETER = Sensor(0.01, 160.0, 0.0)  # m/s; this project's own choice


class Sensed:
    """The frames of a train's sensors, sample by sample, the same for the same scenario and demands.

    train: its messages. Raises InputError for a fault or an axle that they leave no way to.
    """

    def __init__(self, scenario: DriveScenario, truth: bool, train: Train = PACKAGED) -> None:
        axles = scenario.train.axles
        self._numbers = scenario.axles
        self._sensing = [Sensing(a) for a in axles]
        self._speed = axles[0].sensors.speed
        self._rng = np.random.default_rng([axles[0].seed, 2])
        self._reference: TrainSpeed | None = None
        if scenario.speed_of_wrcd == WHEELS:
            self._reference = TrainSpeed(scenario, SAMPLE_US * 1e-6)
            self._wheel_rng = np.random.default_rng([axles[0].seed, 6])
        self._encoder = train.encoder(self._numbers, truth)
        if isinstance(self._encoder, Encoder):
            self._encoder.quick = True
        self._next: list[Sample] = []
        self._seed, self._truth, self._train = axles[0].seed, truth, train
        self._faulted: Iterator[tuple[int, list[Sent]]] | None = None
        self.take_faults(scenario.train.faults)

    def take_faults(self, faults: Sequence[Fault]) -> None:
        """These faults act from now on, and no others. What was before the sample that comes is not known to them."""
        at_work(faults, self._numbers, self._seed, self._train)  # whether they can be made
        self._silent = [f for f in faults if f.kind in SILENT]
        # one sample at a time, each in two halves
        self._faulted = (
            inject(self._one_by_one(), faults, self._numbers, self._seed, self._truth, 1, self._train)
            if faults else None
        )  # fmt: skip

    def carries(self, due_us: int) -> bool:
        """Whether the bus carries frames at a time: not while the link is down, the device gone or the bus off."""
        return not self._silent or not any(f.on(due_us) for f in self._silent)

    def frames(self, due_us: int, samples: Samples, wheel_m_s: FloatArray, share: float) -> list[Sent]:
        """The frames of the sample that ends at due_us (us from the start)."""
        true = samples.speed_m_s
        if self._reference is not None:
            told = TACHOMETER.measure(wheel_m_s, self._wheel_rng)
            true = np.array([self._reference.step(told, share)])
        speed = self._speed.measure_one(float(true[0]), self._rng)
        rows = [s.reading(samples, k) for k, s in enumerate(self._sensing)]
        sample = Sample(due_us, speed, tuple(Reading(n, *row) for n, row in zip(self._numbers, rows, strict=True)))
        if self._faulted is None:
            return list(self._encoder.frames(sample))
        self._next.append(sample)
        return [f for _ in range(2) for f in next(self._faulted)[1]]

    def _one_by_one(self) -> Iterator[Sample]:
        while self._next:
            yield self._next.pop()
