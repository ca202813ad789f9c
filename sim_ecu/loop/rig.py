"""The rig with its loop open to the bus: plant, actuators, sensors, driver. No clock and no bus of its own."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from sim_ecu.loop.drive_scenario import WHEELS, DriveScenario
from sim_ecu.loop.rig_messages import BRAKE, COAST, TRACTION, NewestFrame, SilenceRecord, rig_message
from sim_ecu.physics.actuators import AxleActuators, Valve
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Samples, Simulation
from sim_ecu.physics.wheelset import CREEP_AT_PEAK, MU_AVAILABLE, MU_USED, TORQUE, W_L, W_R, FloatArray
from sim_ecu.play.encoder import SAMPLE_US, Channel, Reading, SensorSample, Sent
from sim_ecu.play.faults import SILENT
from sim_ecu.play.inject import at_work, inject
from sim_ecu.play.mapped import Train
from sim_ecu.play.player import Sensing, on_tracks
from sim_ecu.play.train import PACKAGED

MARGIN = 1.2  # over what full effort gives on a rail that carries it; our choice
MORE_M_S2 = 0.3  # beside it: resistance, slope; our choice


class TrainSpeed:
    """Braked wheels are no faster than the train, driven ones no slower: the fastest or the slowest is believed.

    Where all of them slip, the reference follows no faster than the train can brake or accelerate on a good rail. It
    errs then, as such a reference does.
    """

    def __init__(self, scenario: DriveScenario, step_s: float) -> None:
        w, a = scenario.train.wheelset, scenario.actuators
        per_torque = MARGIN / (w.r_0 * w.M_v)
        self._fall = step_s * (a.full_brake_N_m * per_torque + MORE_M_S2)
        self._rise = step_s * (a.drive.max_traction_N_m * per_torque + MORE_M_S2)
        self._m_s: float | None = None

    def step(self, wheel_m_s: FloatArray, share: float) -> float:
        """The reference (m/s) after one step, from the wheels (axles,) and the driver's demand (signed share)."""
        if share < 0.0:
            measured = float(wheel_m_s.max())
            self._m_s = measured if self._m_s is None else max(measured, self._m_s - self._fall)
        elif share > 0.0:
            measured = float(wheel_m_s.min())
            self._m_s = measured if self._m_s is None else min(measured, self._m_s + self._rise)
        else:
            self._m_s = float(wheel_m_s.mean())
        return max(self._m_s, 0.0)


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
        self._next: list[SensorSample] = []
        self._faulted: Iterator[tuple[int, list[Sent]]] | None = None
        faults = scenario.train.faults
        at_work(faults, self._numbers, axles[0].seed, train)  # whether they can be made
        self._silent = [f for f in faults if f.kind in SILENT]
        if faults:  # one sample at a time, each in two halves
            self._faulted = inject(self._one_by_one(), faults, self._numbers, axles[0].seed, truth, train)

    def carries(self, due_us: int) -> bool:
        """Return whether the bus carries frames at a time: not with the link down, the device gone or the bus off."""
        return not self._silent or not any(f.on(due_us) for f in self._silent)

    def frames(self, due_us: int, samples: Samples, wheel_m_s: FloatArray, share: float) -> list[Sent]:
        """The frames of the sample that ends at due_us (us from the start)."""
        true = samples.speed_m_s
        if self._reference is not None:
            measured = TACHOMETER.measure(wheel_m_s, self._wheel_rng)
            true = np.array([self._reference.step(measured, share)])
        speed = self._speed.measure_one(float(true[0]), self._rng)
        rows = [s.reading(samples, k) for k, s in enumerate(self._sensing)]
        sample = SensorSample(
            due_us, speed, tuple(Reading(n, *row) for n, row in zip(self._numbers, rows, strict=True))
        )
        if self._faulted is None:
            return list(self._encoder.frames(sample))
        self._next.append(sample)
        return [f for _ in range(2) for f in next(self._faulted)[1]]

    def _one_by_one(self) -> Iterator[SensorSample]:
        while self._next:
            yield self._next.pop()


WRCD, TRUTH, LOOP = "wrcd", "truth", "loop"  # who receives frames: they are made for nobody else
ALL = (WRCD, TRUTH, LOOP)
BLOCK = 1000  # samples of the driver's course that are made at once
VALVES = {int(v): v for v in Valve}  # another value is none: the brakes must not be lost
PRESSURE = Sensor(0.01, 10.0, 0.0)  # bar


@dataclass(frozen=True, slots=True)
class Step:
    """The train after one sample; arrays (axles,). Torque and adhesion in use are means of the sample, signed."""

    due_us: int
    speed_m_s: float
    distance_m: float
    share: float  # the driver's demand, signed
    wheel_m_s: FloatArray
    torque_N_m: FloatArray
    pressure_bar: FloatArray
    mu_available: FloatArray
    creep_at_peak: FloatArray  # slip over speed at which the rail gives mu_available
    mu_used: FloatArray
    slip_m_s: FloatArray
    slip_energy_J: FloatArray  # dissipated in this sample, both wheels
    frames: list[Sent]


class Rig:
    """Steps a scenario by 5 ms. Demands come by `hear`, as frames, or by `demand`.

    receivers: for whom frames are made. train: the messages of the sensors. Raises InputError for a fault or an axle
    that they leave no way to.
    """

    def __init__(self, scenario: DriveScenario, receivers: Collection[str] = ALL, train: Train = PACKAGED) -> None:
        self.scenario = scenario
        played, axles = scenario.train, scenario.train.axles
        self._dt = SAMPLE_US * 1e-6
        speed = float(played.speed.at(np.zeros(1))[0])
        self._simulation = Simulation(played.wheelset, on_tracks(axles), speed, self._dt, cleaning=scenario.cleaning)
        self._actuators = [AxleActuators(scenario.actuators, self._dt) for _ in axles]
        self._receivers = frozenset(receivers)
        numbers = scenario.axles
        self._place = {n: k for k, n in enumerate(numbers)}
        self._sensed = Sensed(scenario, TRUTH in self._receivers, train)
        self._rngs = [np.random.default_rng([a.seed, 5]) for a in axles]
        self._driver = Channel(rig_message("DriverDemand"))
        self._wheels = [Channel(rig_message(f"WheelSpeed_A{n}")) for n in numbers]
        self._cylinders = [Channel(rig_message(f"BrakePressure_A{n}")) for n in numbers]
        self.demands = {m.message.frame_id: m for m in (NewestFrame(rig_message(f"Demand_A{n}")) for n in numbers)}
        self._by_place = list(self.demands.values())
        self.ids = tuple(self.demands)  # of the messages that it takes
        self._direct: list[tuple[float, Valve] | None] = [None] * len(numbers)
        self.silences = [SilenceRecord(SAMPLE_US, came=True) for _ in numbers]  # one that never comes is a silence, too
        self._radius_m = played.wheelset.r_0
        self._shares: list[float] = []  # the driver's demand, by sample, as far as it is made
        self._torques = np.zeros((2, len(numbers)))
        self.time_us = 0

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus at a time (us from the start); others than Demand are not for the rig."""
        message = self.demands.get(can_id)
        if message is not None and self.carries(stamp_us):
            message.take(data, stamp_us)

    def carries(self, due_us: int) -> bool:
        """Return whether the scenario's faults leave a bus at a time; without one nobody receives anything."""
        return self._sensed.carries(due_us)

    def demand(self, axle: int, torque_N_m: float, valve: Valve = Valve.FILL) -> None:
        """Set an axle's demand without a frame; it holds until it is set again. KeyError for an axle that is not."""
        self._direct[self._place[axle]] = (torque_N_m, valve)

    def step(self) -> Step:
        """One sample of 5 ms on."""
        share = self._share()
        speed = float(self._simulation.train[0])
        traction, brake, wheel = self._torques[0], self._torques[1], self._wheel_m_s()
        for k, a in enumerate(self._actuators):
            self._actuate(k, a, max(-share, 0.0), speed, float(wheel[k]))
            traction[k], brake[k] = max(a.drive_N_m, 0.0), a.friction_N_m + max(-a.drive_N_m, 0.0)
        samples = self._simulation.step(traction, brake)
        self.time_us += SAMPLE_US
        y, speed = samples.outputs[0], float(samples.speed_m_s[0])
        wheel = self._wheel_m_s()
        energy = self._simulation.slip_energy_J(samples)[0]
        pressure = np.array([a.pressure_bar for a in self._actuators])
        frames: list[Sent] = []
        if LOOP in self._receivers and self.carries(self.time_us):
            frames += self._loop_frames(share, wheel, pressure)
        if WRCD in self._receivers or TRUTH in self._receivers:
            frames += self._sensed.frames(self.time_us, samples, wheel, share)
        return Step(
            self.time_us, speed, float(samples.distance_m[0]), share, wheel, y[:, TORQUE].copy(), pressure,
            y[:, MU_AVAILABLE].copy(), y[:, CREEP_AT_PEAK].copy(), y[:, MU_USED].copy(), wheel - speed, energy,
            frames,
        )  # fmt: skip

    def _wheel_m_s(self) -> FloatArray:
        """Each axle's circumferential speed, mean of its wheels."""
        state = self._simulation.axle_states
        return (state[:, W_R] + state[:, W_L]) * (0.5 * self._radius_m)

    def _share(self) -> float:
        """The driver's demand now, signed."""
        k = self.time_us // SAMPLE_US
        if k >= len(self._shares):
            times = np.arange(len(self._shares), k + BLOCK, dtype=np.float64) * (SAMPLE_US * 1e-6)
            self._shares += self.scenario.driver.at(times).tolist()
        return self._shares[k]

    def _actuate(self, k: int, actuators: AxleActuators, brake: float, speed_m_s: float, wheel_m_s: float) -> None:
        """One axle's actuators through the coming sample. A driver who brakes gets no traction, whoever demands it."""
        a = self.scenario.actuators
        direct = self._direct[k]
        if direct is None:
            demand = self._by_place[k]
            silent = not demand.fresh(self.time_us)
            if self.time_us >= demand.timeout_us:  # nothing is late before
                self.silences[k].look(self.time_us, silent)
            if silent:
                actuators.step(0.0, Valve.FILL, a.demand_bar(brake, speed_m_s, electric=False), 0.0)
                return
            direct = float(demand.values["Torque"]), VALVES.get(demand.values["Valve"], Valve.FILL)
        electric = a.electric_N_m(brake, speed_m_s)
        traction = 0.0 if brake > 0.0 else a.drive.traction_N_m(wheel_m_s, self._radius_m)
        actuators.step(*direct, a.demand_bar(brake, speed_m_s), electric, traction)

    def _loop_frames(self, share: float, wheel: FloatArray, pressure: FloatArray) -> list[Sent]:
        now, out = self.time_us, []
        if now % self._driver.every_us == 0:
            mode = COAST if share == 0.0 else TRACTION if share > 0.0 else BRAKE
            out.append(self._driver.encode(now, {"Mode": mode, "Share": abs(share)}))
        for k, (rng, tachometer, cylinder) in enumerate(zip(self._rngs, self._wheels, self._cylinders, strict=True)):
            if now % tachometer.every_us == 0:
                out.append(tachometer.encode(now, {"WheelSpeed": TACHOMETER.measure_one(float(wheel[k]), rng)}))
            if now % cylinder.every_us == 0:
                measured = PRESSURE.measure_one(float(pressure[k]), rng)
                out.append(cylinder.encode(now, {"Pressure": max(measured, 0.0)}))
        return out
