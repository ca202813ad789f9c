"""The short stop on a greasy rail in worlds that are not as the daemon's design thinks."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from sim_ecu.design.brief import find, read_brief
from sim_ecu.loop.names import BARE_AND_WITH, LAWS, WITH
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.loop.suites.case import DRY, Case, Plan, Rng, asks, curve, with_train
from sim_ecu.loop.suites.faults import short_stop
from sim_ecu.physics.axlebox import AxleBox
from sim_ecu.physics.rail import FloatArray
from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import Wheelset
from wrcd.settings import read_toml

AS_DESIGNED = "as designed"
PARAMETERS = ("m_w", "I_w", "k_w", "I_R", "I_L", "k_s", "C_s", "a", "b")
K_A, K_S = 4, 5  # columns of a rail table
World = Callable[[DriveScenario, Rng], DriveScenario]


def _either(rng: Rng, share: float) -> float:
    return 1.0 + share if rng.random() < 0.5 else 1.0 - share


def _scattered(s: DriveScenario, rng: Rng) -> DriveScenario:
    w = s.train.wheelset
    return with_train(s, replace(w, **{n: getattr(w, n) * rng.uniform(0.9, 1.1) for n in PARAMETERS}))


def _conicity(s: DriveScenario, rng: Rng) -> DriveScenario:
    w = s.train.wheelset
    return with_train(s, replace(w, gamma=w.gamma * _either(rng, 0.3)))


def _law(column: int) -> World:
    """A parameter of the creep curve off by 30 %, on every rail."""

    def world(s: DriveScenario, rng: Rng) -> DriveScenario:
        factor = _either(rng, 0.3)

        def changed(rail: FloatArray) -> FloatArray:
            rail = rail.copy()
            rail[:, column] *= factor
            return rail

        return with_train(s, axles=lambda a: replace(a, rail=changed(a.rail)))

    return world


def _rough(factor: float) -> World:
    return lambda s, _: with_train(s, axles=lambda a: replace(a, roughness=QUALITY["good"] * factor))


def _sensed(change: Callable[[SensorSet], SensorSet]) -> World:
    return lambda s, _: with_train(s, sensors=change)


def _gyro(gain: float) -> World:
    return _sensed(lambda x: replace(x, yaw_rate=replace(x.yaw_rate, gain=gain)))


def _torque(gain: float) -> World:
    return _sensed(lambda x: replace(x, torque=replace(x.torque, gain=gain)))


def _wheelset(name: str) -> World:
    """A wheelset that the design is not for, with actuators of the same deceleration."""

    def world(s: DriveScenario, _rng: Rng) -> DriveScenario:
        other: Wheelset = read_brief(read_toml(find(Path(name)))).wheelset
        own, a = s.train.wheelset, s.actuators
        k = other.M_v * other.r_0 / (own.M_v * own.r_0)
        drive = replace(
            a.drive, max_traction_N_m=k * a.drive.max_traction_N_m, max_brake_N_m=k * a.drive.max_brake_N_m,
            max_power_kW=other.M_v / own.M_v * a.drive.max_power_kW,
            rise_N_m_s=k * a.drive.rise_N_m_s, fall_N_m_s=k * a.drive.fall_N_m_s,
        )  # fmt: skip
        air = replace(a.pneumatics, torque_per_bar_N_m=k * a.pneumatics.torque_per_bar_N_m)
        scaled = replace(a, drive=drive, pneumatics=air, full_brake_N_m=k * a.full_brake_N_m)
        return with_train(s, other, actuators=scaled)

    return world


def _vibrating(s: DriveScenario, _rng: Rng) -> DriveScenario:
    return with_train(s, axles=lambda a: replace(a, axlebox=AxleBox(vibration_m_s2=0.3)))


def _from_wheels(s: DriveScenario, _rng: Rng) -> DriveScenario:
    return replace(s, speed_of_wrcd="wheels")


# what the train itself does not notice: its bare runs are those of the world as designed
SENSED: dict[str, World] = {
    "vibration of 0.3 m/s²": _vibrating,
    "gyro dead from the start": _gyro(0.0),
    "gyro reversed": _gyro(-1.0),
    "torque reads 10 % high": _torque(1.1),
    "torque reads 10 % low": _torque(0.9),
    "VehicleSpeed made from the wheels": _from_wheels,
}
OTHERS: dict[str, World] = {
    "parameters off by up to 10 %": _scattered,
    "conicity off by 30 %": _conicity,
    "k_A off by 30 %": _law(K_A),
    "k_S off by 30 %": _law(K_S),
    "track half as rough as good": _rough(0.5),
    "track four times as rough as good": _rough(4.0),
    "metro wheelset": _wheelset("metro"),
    "locomotive wheelset": _wheelset("locomotive"),
}


# what somebody says all along in the daemon's place: what a lie costs, and what probing gives by itself
TOLD_PCT = (3.0, 40.0)
ON_DRY = "as designed, dry rail"


def dry_stop(rng: Rng) -> Plan:
    """From 15 to 20 m/s on a dry rail that carries all that is asked."""
    return Plan(((0.0, curve(rng, DRY)),), float(rng.uniform(15.0, 20.0)), asks(-1.0, rng, True), 30.0, True)


def worlds() -> Iterator[Case]:
    """The same runs as those of the faults; and a dry rail."""
    yield Case("worlds", AS_DESIGNED, short_stop, key="faults", controllers=BARE_AND_WITH)
    for name, world in OTHERS.items():
        yield Case("worlds", name, short_stop, 1, world, "faults", controllers=BARE_AND_WITH)
    alone = tuple(WITH[law] for law in LAWS)
    for name, world in SENSED.items():
        shown = name.startswith("VehicleSpeed")
        yield Case("worlds", name, short_stop, 1, world, "faults", AS_DESIGNED, alone, shown=shown)
    yield Case("worlds", ON_DRY, dry_stop, controllers=BARE_AND_WITH)
    for pct in TOLD_PCT:
        name = f"told {pct:g} % ± 1 all along"
        yield Case("worlds", name, short_stop, 1, key="faults", bare=AS_DESIGNED, controllers=alone, told_pct=pct)
        on_dry = f"{name}, dry rail"
        yield Case("worlds", on_dry, dry_stop, 1, key=ON_DRY, bare=ON_DRY, controllers=alone, told_pct=pct)
