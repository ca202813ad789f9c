"""The rig with its loop open to the bus: plant, actuators, sensors, driver. No clock and no bus of its own."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.loop.messages import BRAKE, COAST, TRACTION, Heard, rig_message
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.sensed import TACHOMETER, Sensed
from sim_ecu.loop.silence import Silence
from sim_ecu.physics.actuators import AxleActuators, Valve
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Simulation
from sim_ecu.physics.wheelset import CREEP_AT_PEAK, MU_AVAILABLE, MU_USED, TORQUE, W_L, W_R, FloatArray
from sim_ecu.play.encoder import SAMPLE_US, Channel, Sent
from sim_ecu.play.faults import Fault
from sim_ecu.play.player import on_tracks
from sim_ecu.play.train import PACKAGED, Train

WRCD, TRUTH, LOOP = "wrcd", "truth", "loop"  # who hears frames: they are made for nobody else
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
    share: float  # what the driver asks, signed
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

    heard: which frames are made. train: the messages of the sensors. Raises InputError for a fault or an axle that they
    leave no way to.
    """

    def __init__(self, scenario: DriveScenario, heard: Collection[str] = ALL, train: Train = PACKAGED) -> None:
        self.scenario = scenario
        played, axles = scenario.train, scenario.train.axles
        self._dt = SAMPLE_US * 1e-6
        speed = float(played.speed.at(np.zeros(1))[0])
        self._simulation = Simulation(played.wheelset, on_tracks(axles), speed, self._dt, cleaning=scenario.cleaning)
        self._actuators = [AxleActuators(scenario.actuators, self._dt) for _ in axles]
        self._heard = frozenset(heard)
        numbers = scenario.axles
        self._place = {n: k for k, n in enumerate(numbers)}
        self._sensed = Sensed(scenario, TRUTH in self._heard, train)
        self._rngs = [np.random.default_rng([a.seed, 5]) for a in axles]
        self._driver = Channel(rig_message("DriverDemand"))
        self._wheels = [Channel(rig_message(f"WheelSpeed_A{n}")) for n in numbers]
        self._cylinders = [Channel(rig_message(f"BrakePressure_A{n}")) for n in numbers]
        self.demands = {m.message.frame_id: m for m in (Heard(rig_message(f"Demand_A{n}")) for n in numbers)}
        self._by_place = list(self.demands.values())
        self._direct: list[tuple[float, Valve] | None] = [None] * len(numbers)
        self._silences = [Silence(SAMPLE_US, heard=True) for _ in numbers]  # one that never comes is a silence, too
        self._radius_m = played.wheelset.r_0
        self._shares: list[float] = []  # what the driver asks, by sample, as far as it is made
        self._torques = np.zeros((2, len(numbers)))
        self.time_us = 0

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus at a time (us from the start); others than demands are not for the rig."""
        heard = self.demands.get(can_id)
        if heard is not None and self.carries(stamp_us):
            heard.take(data, stamp_us)

    def carries(self, due_us: int) -> bool:
        """Whether the scenario's faults leave a bus at a time; without one nobody hears anybody."""
        return self._sensed.carries(due_us)

    def take_faults(self, faults: Sequence[Fault]) -> None:
        """These faults of the scenario's inputs act from now on, and no others."""
        self._sensed.take_faults(faults)

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
        if LOOP in self._heard and self.carries(self.time_us):
            frames += self._loop_frames(share, wheel, pressure)
        if WRCD in self._heard or TRUTH in self._heard:
            frames += self._sensed.frames(self.time_us, samples, wheel, share)
        return Step(
            self.time_us, speed, float(samples.distance_m[0]), share, wheel, y[:, TORQUE].copy(), pressure,
            y[:, MU_AVAILABLE].copy(), y[:, CREEP_AT_PEAK].copy(), y[:, MU_USED].copy(), wheel - speed, energy, frames,
        )  # fmt: skip

    @property
    def silences(self) -> list[int]:
        """How often each axle's demand fell silent."""
        return [s.silences for s in self._silences]

    @property
    def silent_us(self) -> list[int]:
        """For how long in all."""
        return [s.silent_us for s in self._silences]

    def _wheel_m_s(self) -> FloatArray:
        """Each axle's circumferential speed, mean of its wheels."""
        state = self._simulation.state
        return (state[:, W_R] + state[:, W_L]) * (0.5 * self._radius_m)

    def _share(self) -> float:
        """What the driver asks now, signed."""
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
            heard = self._by_place[k]
            silent = not heard.fresh(self.time_us)
            if self.time_us >= heard.timeout_us:  # nothing is late before
                self._silences[k].look(self.time_us, silent)
            if silent:
                actuators.step(0.0, Valve.FILL, a.asked_bar(brake, speed_m_s, electric=False), 0.0)
                return
            direct = float(heard.values["Torque"]), VALVES.get(heard.values["Valve"], Valve.FILL)
        electric = a.electric_N_m(brake, speed_m_s)
        traction = 0.0 if brake > 0.0 else a.drive.traction_N_m(wheel_m_s, self._radius_m)
        actuators.step(*direct, a.asked_bar(brake, speed_m_s), electric, traction)

    def _loop_frames(self, share: float, wheel: FloatArray, pressure: FloatArray) -> list[Sent]:
        now, out = self.time_us, []
        if now % self._driver.every_us == 0:
            mode = COAST if share == 0.0 else TRACTION if share > 0.0 else BRAKE
            out.append(self._driver.encode_quick(now, {"Mode": mode, "Share": abs(share)}))
        for k, (rng, tachometer, cylinder) in enumerate(zip(self._rngs, self._wheels, self._cylinders, strict=True)):
            if now % tachometer.every_us == 0:
                out.append(tachometer.encode_quick(now, {"WheelSpeed": TACHOMETER.measure_one(float(wheel[k]), rng)}))
            if now % cylinder.every_us == 0:
                told = PRESSURE.measure_one(float(pressure[k]), rng)
                out.append(cylinder.encode_quick(now, {"Pressure": max(told, 0.0)}))
        return out
