"""What the FMU does, without FMI: a rig behind named values, stepped by multiples of 5 ms."""

import hashlib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.loop.drive_scenario import SPEED, DriveScenario
from sim_ecu.loop.rig import LOOP, WRCD, Rig, Step
from sim_ecu.loop.rig_messages import NewestFrame
from sim_ecu.physics.actuators import Valve
from sim_ecu.play.encoder import SAMPLE_US, Sent, databases
from sim_ecu.play.scenario import Course
from sim_ecu.play.train import USABLE_STATUS, end_of_field
from wrcd.errors import InputError

PARAMETER, INPUT, OUTPUT, LOCAL = "parameter", "input", "output", "local"
VALID = "_valid"  # a sensor's name and this: whether its value may be used
# by unit: factor to SI and the exponents of the base units
UNITS: Mapping[str, Mapping[str, float]] = {
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s2": {"m": 1, "s": -2},
    "rad/s": {"rad": 1, "s": -1},
    "N.m": {"kg": 1, "m": 2, "s": -2},
    "bar": {"factor": 1e5, "kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
}


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar variable. kind: Real, Integer, Boolean or String. signal: the frame's that carries it, of a sensor."""

    name: str
    kind: str
    causality: str
    what: str
    unit: str = ""
    signal: tuple[str, str] | None = None  # message, signal

    @property
    def variability(self) -> str:
        """As FMI names it. What sensors report changes when their frame comes."""
        if self.causality == PARAMETER:
            return "fixed"
        return "continuous" if self.kind == "Real" and self.signal is None else "discrete"


def _parameter(name: str, kind: str, what: str, unit: str = "") -> Variable:
    return Variable(name, kind, PARAMETER, what, unit)


def _truth(name: str, what: str, unit: str = "") -> Variable:
    return Variable(name, "Real", OUTPUT, what, unit)


def _sensor(name: str, message: str, signal: str, what: str, unit: str) -> tuple[Variable, Variable]:
    valid = "whether its newest frame is in time and usable; else the value is an old one"
    return (
        Variable(name, "Real", OUTPUT, what, unit, (message, signal)),
        Variable(name + VALID, "Boolean", OUTPUT, valid),
    )


SEED = _parameter("seed", "Integer", "of track, noise and vibration; as the scenario's key seed")
START_SPEED = _parameter("start_speed", "Real", "the train's speed at the start", "m/s")
DRIVER_IS_INPUT = _parameter("driver.is_input", "Boolean", "the driver asks what driver.input says, not the scenario")
DRIVER_INPUT = Variable(
    "driver.input", "Real", INPUT, "share of the full effort, -1 ... 1: traction positive, braking negative"
)
DRIVER_SHARE = _truth("driver.share", "what the driver asked for in the last sample")
REFUSED = Variable("refused", "String", LOCAL, "why the newest step was not done; empty if it was")

TRAIN = (
    SEED, START_SPEED, DRIVER_IS_INPUT, DRIVER_INPUT, DRIVER_SHARE,
    *_sensor("sensor.speed", "VehicleSpeed", "Speed", "ground speed as measured, for wrcd alone", "m/s"),
    _truth("truth.speed", "ground speed", "m/s"),
    _truth("truth.distance", "distance since the start", "m"),
    REFUSED,
)  # fmt: skip


def of_axle(n: int) -> tuple[Variable, ...]:
    """Those of an axle, its demands first."""
    a, together = f"axle{n}", "at the wheelset, drive and brakes together"
    return (
        Variable(f"{a}.torque", "Real", INPUT, "demand to traction and electric brake, braking negative", "N.m"),
        Variable(f"{a}.valve", "Integer", INPUT, "of the brake cylinder: 0 fill, 1 hold, 2 vent"),
        *_sensor(f"{a}.sensor.wheel_speed", f"WheelSpeed_A{n}", "WheelSpeed", "circumferential, as measured", "m/s"),
        *_sensor(f"{a}.sensor.pressure", f"BrakePressure_A{n}", "Pressure", "brake cylinder, as measured", "bar"),
        *_sensor(f"{a}.sensor.yaw_rate", f"YawRate_A{n}", "YawRate", "of the wheelset, as measured", "rad/s"),
        *_sensor(f"{a}.sensor.lateral_acceleration", f"LatAccel_A{n}", "LatAccel", "as measured", "m/s2"),
        *_sensor(f"{a}.sensor.torque", f"Torque_A{n}", "Torque", f"{together}, as measured", "N.m"),
        _truth(f"{a}.truth.wheel_speed", "circumferential", "m/s"),
        _truth(f"{a}.truth.pressure", "brake cylinder", "bar"),
        _truth(f"{a}.truth.torque", f"{together}, in the last sample", "N.m"),
        _truth(f"{a}.truth.adhesion_available", "mean of the last sample"),
        _truth(f"{a}.truth.adhesion_used", "mean of the last sample, braking negative"),
        _truth(f"{a}.truth.slip", "circumferential speed less ground speed", "m/s"),
        _truth(f"{a}.truth.slip_energy", "dissipated at both wheels since the start", "J"),
    )


def variables(axles: Iterable[int]) -> tuple[Variable, ...]:
    """All of an FMU, in the order of their value references."""
    return (*TRAIN, *(v for n in axles for v in of_axle(n)))


def digest(of: Iterable[Variable]) -> str:
    """Return what distinguishes variables from others: an FMU's are those of the version that made it."""
    return hashlib.sha256(repr(tuple(of)).encode()).hexdigest()


class SensorOutputs:
    """Those of an FMU's variables that have a signal: each value until the next usable frame."""

    def __init__(self, among: Iterable[Variable]) -> None:
        messages = {m.name: m for db in databases() for m in db.messages}
        sensors = [(v.name, messages[v.signal[0]], v.signal[1]) for v in among if v.signal is not None]
        self._by_id = {m.frame_id: (name, m.get_signal_by_name(of), NewestFrame(m)) for name, m, of in sensors}
        self._usable = dict.fromkeys(self._by_id, False)  # whether the newest good frame says so

    def take(self, frames: Iterable[Sent], now_us: int) -> dict[str, float | bool]:
        """Return new values after a sample, and of every sensor whether its value may be used."""
        out: dict[str, float | bool] = {}
        for f in frames:
            if f.can_id not in self._by_id or f.error or f.extended:
                continue
            name, signal, newest = self._by_id[f.can_id]
            if newest.take(f.data, f.due_us):
                value = float(newest.values[signal.name])
                raw = round((value - float(signal.offset)) / float(signal.scale))
                self._usable[f.can_id] = (
                    int(newest.values["Status"]) in USABLE_STATUS and raw != end_of_field(signal)
                )  # fmt: skip
                if self._usable[f.can_id]:
                    out[name] = value
        for can_id, (name, _, newest) in self._by_id.items():
            out[name + VALID] = self._usable[can_id] and newest.fresh(now_us)
        return out


SAMPLE_S = SAMPLE_US * 1e-6
TOLERANCE_S = 1e-6  # of times that a master has added up
Value = float | int | bool | str
NOTHING: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}


class Plant:
    """The values of an FMU by name. Parameters are set before start(), inputs before step()."""

    def __init__(self, scenario: DriveScenario) -> None:
        self.scenario = scenario
        self.variables = variables(scenario.axles)
        speed = float(scenario.train.speed.at(np.zeros(1))[0])
        self.values: dict[str, Value] = {v.name: NOTHING[v.kind] for v in self.variables}
        self.values |= {SEED.name: seed_of(scenario), START_SPEED.name: speed}
        self.values |= dict.fromkeys(self._speeds(), speed)
        self._rig: Rig | None = None
        self._sensors = SensorOutputs(self.variables)
        self._start_s = 0.0

    def set(self, name: str, value: Value) -> None:
        """Set a parameter or an input. The train stands ready at its start speed as soon as that is set."""
        self.values[name] = value
        if name == START_SPEED.name:
            self.values |= dict.fromkeys(self._speeds(), value)

    def start(self, time_s: float) -> None:
        """Make the rig of the parameters. Raises InputError for one that is out of its range."""
        seed, speed = int(self.values[SEED.name]), float(self.values[START_SPEED.name])
        if seed < 0:
            raise InputError(f"must not be negative, is {seed}", key=SEED.name)
        if not SPEED.low <= speed <= SPEED.high:
            raise InputError(f"takes {SPEED.low:g} to {SPEED.high:g} m/s, not {speed:g}", key=START_SPEED.name)
        if not math.isfinite(time_s):
            raise InputError(f"the start time is {time_s}")
        scenario = reseeded(self.scenario, seed)
        scenario = replace(scenario, train=replace(scenario.train, speed=Course((0.0,), (speed,))))
        self._rig, self._start_s = Rig(scenario, [LOOP, WRCD]), time_s

    def step(self, time_s: float, step_s: float) -> None:
        """Go on by a communication step from a time. Raises InputError, and nothing has moved, if that can't be."""
        if self._rig is None:
            raise InputError("a step before the initialization has ended")
        samples = self._samples(self._rig, time_s, step_s)
        self._apply(self._rig)
        for _ in range(samples):
            self._take(self._rig.step())

    def _samples(self, rig: Rig, time_s: float, step_s: float) -> int:
        here = self._start_s + rig.time_us * 1e-6
        if not abs(time_s - here) <= TOLERANCE_S:
            raise InputError(f"a step from {time_s:.6f} s, but this FMU stands at {here:.6f} s and cannot go back")
        whole = round(step_s / SAMPLE_S) if math.isfinite(step_s) else 0
        if whole < 1 or abs(step_s - whole * SAMPLE_S) > TOLERANCE_S:
            raise InputError(f"a communication step of {step_s:g} s: it must be 0.005 s or a multiple of it")
        return whole

    def _apply(self, rig: Rig) -> None:
        """Hand the inputs to the rig, all of them or none."""
        share, demands = float(self.values[DRIVER_INPUT.name]), []
        if self.values[DRIVER_IS_INPUT.name] and not -1.0 <= share <= 1.0:
            raise InputError(f"takes -1 to 1, not {share:g}", key=DRIVER_INPUT.name)
        for n in self.scenario.axles:
            torque, valve = float(self.values[f"axle{n}.torque"]), self.values[f"axle{n}.valve"]
            if not math.isfinite(torque):
                raise InputError(f"takes a number, not {torque}", key=f"axle{n}.torque")
            if valve not in tuple(Valve):
                raise InputError(f"takes 0 (fill), 1 (hold) or 2 (vent), not {valve}", key=f"axle{n}.valve")
            demands.append((n, torque, Valve(int(valve))))
        if self.values[DRIVER_IS_INPUT.name]:
            rig.set_share(share)
        for demand in demands:
            rig.demand(*demand)

    def _take(self, step: Step) -> None:
        v = self.values
        v |= self._sensors.take(step.frames, step.due_us)
        v |= {DRIVER_SHARE.name: step.share, "truth.speed": step.speed_m_s, "truth.distance": step.distance_m}
        columns = {
            "wheel_speed": step.wheel_m_s, "pressure": step.pressure_bar, "torque": step.torque_N_m,
            "adhesion_available": step.mu_available, "adhesion_used": step.mu_used, "slip": step.slip_m_s,
        }  # fmt: skip
        for k, n in enumerate(self.scenario.axles):
            v |= {f"axle{n}.truth.{name}": float(column[k]) for name, column in columns.items()}
            energy = f"axle{n}.truth.slip_energy"
            v[energy] = float(v[energy]) + float(step.slip_energy_J[k])

    def _speeds(self) -> list[str]:
        """The outputs that are known before the first step."""
        return [v.name for v in self.variables if v.causality == OUTPUT and v.name.endswith("speed")]

    @property
    def settable(self) -> frozenset[str]:
        """Names of parameters and inputs."""
        return frozenset(v.name for v in self.variables if v.causality in (INPUT, "parameter"))


def seed_of(scenario: DriveScenario) -> int:
    """The key seed of a scenario; 1, its default, where every axle has a seed of its own."""
    axles = scenario.train.axles
    shared = [a.track_seed for a in axles if a.track_seed is not None]
    return (shared[0] - axles[0].number) // 16 if shared else 1


def reseeded(scenario: DriveScenario, seed: int) -> DriveScenario:
    """The same scenario with another key seed. Axles with a seed of their own keep it."""
    axles, first = scenario.train.axles, scenario.train.axles[0].number
    new = tuple(
        a if a.track_seed is None else replace(a, seed=seed * 16 + a.number, track_seed=seed * 16 + first)
        for a in axles
    )
    return replace(scenario, train=replace(scenario.train, axles=new))
