"""The rig with its loop open to the bus: plant, actuators, sensors, driver. No clock and no bus of its own."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.loop.messages import Heard, rig_message
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.sensed import TACHOMETER, Sensed
from sim_ecu.physics.actuators import AxleActuators, Valve
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Simulation
from sim_ecu.physics.wheelset import MU_AVAILABLE, MU_USED, ROLLING_START, SLIP, TORQUE, W_L, W_R, FloatArray
from sim_ecu.play.encoder import SAMPLE_US, Channel, Sent
from sim_ecu.play.faults import Fault
from sim_ecu.play.player import on_tracks
from sim_ecu.play.train import PACKAGED, Train

WRCD, TRUTH, LOOP = "wrcd", "truth", "loop"  # who hears frames: they are made for nobody else
ALL = (WRCD, TRUTH, LOOP)
COAST, TRACTION, BRAKE = range(3)
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
        self._simulation = Simulation(played.wheelset, on_tracks(axles), speed, self._dt)
        self._actuators = [AxleActuators(scenario.actuators, self._dt) for _ in axles]
        self._heard = frozenset(heard)
        numbers = scenario.axles
        self._place = {n: k for k, n in enumerate(numbers)}
        self._sensed = Sensed(scenario, TRUTH in self._heard, train)
        self._rngs = [np.random.default_rng([a.seed, 5]) for a in axles]
        self._driver = Channel(rig_message("DriverDemand"))
        self._wheel = [Channel(rig_message(f"WheelSpeed_A{n}")) for n in numbers]
        self._pressure = [Channel(rig_message(f"BrakePressure_A{n}")) for n in numbers]
        self.demands = {m.message.frame_id: m for m in (Heard(rig_message(f"Demand_A{n}")) for n in numbers)}
        self._by_place = list(self.demands.values())
        self._direct: list[tuple[float, Valve] | None] = [None] * len(numbers)
        self.silences = [0] * len(numbers)  # how often an axle's demand fell silent
        self.silent_us = [0] * len(numbers)
        self._was_silent = [False] * len(numbers)
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
        n = len(self._actuators)
        share = float(self.scenario.driver.at(np.array([self.time_us * 1e-6]))[0])
        speed = float(self._simulation.train[0])
        asked = np.array([self._torque(k, share, speed) for k in range(n)])
        samples = self._simulation.step(np.maximum(asked, 0.0), np.maximum(-asked, 0.0))
        self.time_us += SAMPLE_US
        y, speed = samples.outputs[0], float(samples.speed_m_s[0])
        w = self.scenario.train.wheelset
        state = self._simulation.state
        wheel = (state[:, W_R] + state[:, W_L]) / 2 * w.r_0
        sliding = y[:, SLIP] * max(speed, ROLLING_START)  # m/s, mean of the sample
        energy = np.abs(y[:, MU_USED] * 2 * w.normal_N * sliding) * self._dt
        pressure = np.array([a.pressure_bar for a in self._actuators])
        frames: list[Sent] = []
        if LOOP in self._heard and self.carries(self.time_us):
            frames += self._loop_frames(share, wheel, pressure)
        if WRCD in self._heard or TRUTH in self._heard:
            frames += self._sensed.frames(self.time_us, samples, wheel, share)
        return Step(
            self.time_us, speed, float(samples.distance_m[0]), share, wheel, y[:, TORQUE].copy(), pressure,
            y[:, MU_AVAILABLE].copy(), y[:, MU_USED].copy(), wheel - speed, energy, frames,
        )  # fmt: skip

    def _torque(self, k: int, share: float, speed_m_s: float) -> float:
        """Torque of one axle's actuators in the coming sample."""
        a = self.scenario.actuators
        brake = max(-share, 0.0)
        direct = self._direct[k]
        if direct is None:
            heard = self._by_place[k]
            silent = not heard.fresh(self.time_us)
            if self.time_us >= heard.timeout_us:  # nothing is late before
                self.silences[k] += silent and not self._was_silent[k]
                self.silent_us[k] += SAMPLE_US * silent
                self._was_silent[k] = silent
            if silent:
                return self._actuators[k].step(0.0, Valve.FILL, a.asked_bar(brake, speed_m_s, electric=False), 0.0)
            direct = float(heard.values["Torque"]), Valve(int(heard.values["Valve"]))
        electric = a.electric_N_m(brake, speed_m_s)
        return self._actuators[k].step(*direct, a.asked_bar(brake, speed_m_s), electric)

    def _loop_frames(self, share: float, wheel: FloatArray, pressure: FloatArray) -> list[Sent]:
        out = []
        if self.time_us % self._driver.every_us == 0:
            mode = COAST if share == 0.0 else TRACTION if share > 0.0 else BRAKE
            out.append(self._driver.encode_quick(self.time_us, {"Mode": mode, "Share": abs(share)}))
        for k, rng in enumerate(self._rngs):
            if self.time_us % self._wheel[k].every_us == 0:
                told = TACHOMETER.measure_one(float(wheel[k]), rng)
                out.append(self._wheel[k].encode_quick(self.time_us, {"WheelSpeed": told}))
            if self.time_us % self._pressure[k].every_us == 0:
                told = PRESSURE.measure_one(float(pressure[k]), rng)
                out.append(self._pressure[k].encode_quick(self.time_us, {"Pressure": max(told, 0.0)}))
        return out
