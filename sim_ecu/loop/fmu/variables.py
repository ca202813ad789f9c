"""Every variable of the FMU: the model description, its page and docs/how-to/use-the-fmu.md are made from these."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

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
        """As FMI names it. What sensors say changes when their frame comes."""
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
    """What tells variables from others: an FMU's are those of the version that made it."""
    return hashlib.sha256(repr(tuple(of)).encode()).hexdigest()
