"""The short stop on a greasy rail with faults of wrcd's inputs, in other worlds, with other actuators."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from sim_ecu.loop import BARE_AND_WITH, LAWS, WITH
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.suites.rails import leaf_stop
from sim_ecu.loop.suites.rides import DRY, GREASY, KNOWN_S, LoopCase, RidePlan, Rng, curve, demand, with_train
from sim_ecu.physics.actuators import Actuators, Drive
from sim_ecu.physics.axlebox import AxleBox
from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.track import SPECTRA
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.faults import ALL, KINDS, Fault, Stage
from sim_ecu.play.vehicles import load_vehicle
from sim_ecu.score.suites.nominal import either, scattered

World = Callable[[DriveScenario, Rng], DriveScenario]
ONLY_WITH = tuple(WITH[law] for law in LAWS)


def short_stop(rng: Rng) -> RidePlan:
    """From 15 to 17 m/s on a greasy rail known before."""
    return RidePlan(((0.0, curve(rng, GREASY)),), float(rng.uniform(15.0, 17.0)), demand(-1.0, rng, True), 50.0, True)


def dry_stop(rng: Rng) -> RidePlan:
    """From 15 to 20 m/s on a dry rail that carries all that is demanded."""
    return RidePlan(((0.0, curve(rng, DRY)),), float(rng.uniform(15.0, 20.0)), demand(-1.0, rng, True), 30.0, True)


# --- faults: every one of `sim-ecu inject` that frames can carry, in the middle of the stop

AT_S, FOR_S = KNOWN_S + 2.0, 2.0
NONE, NONE_OF_TWO = "no fault", "no fault, two axles"
AWAY = "bus away (link-down, device-gone, bus-off)"
# Beside the default amounts, of all signals of axle 1: faults of one signal that a controller's limit depends on.
MORE = (
    Fault("bias", AT_S, FOR_S, "torque", amount=-3000.0), Fault("bias", AT_S, FOR_S, "speed"),
    Fault("freeze", AT_S, FOR_S, "speed"), Fault("reverse", AT_S, FOR_S, "torque"),
)  # fmt: skip
LOSS = 0.3  # of the frames: two in a hundred do nothing


def faults() -> Iterator[LoopCase]:
    """Nothing of a fault reaches a bare controller: its runs are those without one."""
    yield LoopCase("faults", NONE, short_stop, key="faults", controllers=BARE_AND_WITH, shown=True)
    yield LoopCase("faults", NONE_OF_TWO, short_stop, 2, key="faults", controllers=BARE_AND_WITH)
    every = [
        Fault(name, AT_S, FOR_S, ALL, amount=LOSS if name == "loss" else None)
        for name, kind in KINDS.items()
        if kind.stage is not Stage.BUS
    ]
    for fault in sorted((*every, *MORE), key=lambda f: list(KINDS).index(f.kind)):
        name = f"{fault.kind}, {'all signals' if fault.of == ALL else fault.of.replace('_', ' ')}"
        axles, bare = (2, NONE_OF_TWO) if fault.kind.startswith("swap") else (1, NONE)
        yield LoopCase(
            "faults", name, short_stop, axles, key="faults", bare=bare, controllers=ONLY_WITH, fault=fault
        )  # fmt: skip
    # who demands falls silent, too: the bare runs have it as well
    away = (Fault("link-down", AT_S, FOR_S),)
    yield LoopCase(
        "faults", AWAY, short_stop, world=lambda s, _: replace(s, train=replace(s.train, faults=away)), key="faults",
        controllers=BARE_AND_WITH,
    )  # fmt: skip


# --- worlds that are not as the daemon's design thinks

AS_DESIGNED, ON_DRY = "as designed", "as designed, dry rail"
K_A, K_S = 4, 5  # columns of a rail table
CONSTANT_PCT = (3.0, 40.0)  # reported all along in the daemon's place: what a lie costs, what probing gives by itself


def _creep_law(column: int) -> World:
    """A parameter of the creep curve off by 30 %, on every rail."""

    def world(s: DriveScenario, rng: Rng) -> DriveScenario:
        rails = [a.rail.copy() for a in s.train.axles]
        factor = either(rng, 0.3)
        for rail in rails:
            rail[:, column] *= factor
        axles = tuple(replace(a, rail=rail) for a, rail in zip(s.train.axles, rails, strict=True))
        return replace(s, train=replace(s.train, axles=axles))

    return world


def _rough(factor: float) -> World:
    return lambda s, _: with_train(s, axles=lambda a: replace(a, track=SPECTRA["good"].scaled(factor)))


def _sensed(change: Callable[[SensorSet], SensorSet]) -> World:
    return lambda s, _: with_train(s, sensors=change)


def _gyro(gain: float) -> World:
    return _sensed(lambda x: replace(x, yaw_rate=replace(x.yaw_rate, gain=gain)))


def _torque(gain: float) -> World:
    return _sensed(lambda x: replace(x, torque=replace(x.torque, gain=gain)))


def _wheelset(name: str) -> World:
    """A wheelset that the design is not for, with actuators of the same deceleration."""

    def world(s: DriveScenario, _rng: Rng) -> DriveScenario:
        other: Wheelset = load_vehicle(name)
        own, a = s.train.wheelset, s.actuators
        k = other.M_v * other.r_0 / (own.M_v * own.r_0)
        torques = ("max_traction_N_m", "max_brake_N_m", "rise_N_m_s", "fall_N_m_s")
        power_kW = other.M_v / own.M_v * a.drive.max_power_kW
        drive = replace(a.drive, max_power_kW=power_kW, **{of: k * getattr(a.drive, of) for of in torques})
        air = replace(a.pneumatics, torque_per_bar_N_m=k * a.pneumatics.torque_per_bar_N_m)
        scaled = replace(a, drive=drive, pneumatics=air, full_brake_N_m=k * a.full_brake_N_m)
        return with_train(s, other, actuators=scaled)

    return world


# what the train itself does not notice: its bare runs are those of the world as designed
SENSED: dict[str, World] = {
    "vibration of 0.3 m/s²": lambda s, _: with_train(
        s, axles=lambda a: replace(a, axlebox=AxleBox(vibration_m_s2=0.3))
    ),
    "gyro dead from the start": _gyro(0.0),
    "gyro reversed": _gyro(-1.0),
    "torque reads 10 % high": _torque(1.1),
    "torque reads 10 % low": _torque(0.9),
    "VehicleSpeed made from the wheels": lambda s, _: replace(s, speed_of_wrcd="wheels"),
}
OTHERS: dict[str, World] = {
    "parameters off by up to 10 %": lambda s, rng: with_train(s, scattered(s.train.wheelset, rng)),
    "conicity off by 30 %": lambda s, rng: with_train(
        s, replace(s.train.wheelset, gamma=s.train.wheelset.gamma * either(rng, 0.3))
    ),
    "k_A off by 30 %": _creep_law(K_A),
    "k_S off by 30 %": _creep_law(K_S),
    "track half as rough as good": _rough(0.5),
    "track four times as rough as good": _rough(4.0),
    "metro wheelset": _wheelset("metro"),
    "locomotive wheelset": _wheelset("locomotive"),
}


def worlds() -> Iterator[LoopCase]:
    """The same runs as those of the faults; and a dry rail."""
    yield LoopCase("worlds", AS_DESIGNED, short_stop, key="faults", controllers=BARE_AND_WITH)
    for name, world in OTHERS.items():
        yield LoopCase("worlds", name, short_stop, 1, world, "faults", controllers=BARE_AND_WITH)
    for name, world in SENSED.items():
        shown = name.startswith("VehicleSpeed")
        yield LoopCase("worlds", name, short_stop, 1, world, "faults", AS_DESIGNED, ONLY_WITH, shown=shown)
    yield LoopCase("worlds", ON_DRY, dry_stop, controllers=BARE_AND_WITH)
    for pct in CONSTANT_PCT:
        name = f"told {pct:g} % ± 1 all along"
        for row, plan, key, bare in (
            (name, short_stop, "faults", AS_DESIGNED), (f"{name}, dry rail", dry_stop, ON_DRY, ON_DRY),
        ):  # fmt: skip
            yield LoopCase("worlds", row, plan, 1, key=key, bare=bare, controllers=ONLY_WITH, constant_pct=pct)


# --- actuators, slow and fast, pneumatic and blended: the defaults are one choice of many

SWEEP = {
    "slow electric": Actuators(Drive(lag_s=0.15, rise_N_m_s=30_000.0, fall_N_m_s=60_000.0)),
    "typical electric": Actuators(),
    "fast electric": Actuators(Drive(lag_s=0.02, rise_N_m_s=200_000.0, fall_N_m_s=500_000.0)),
    "pneumatic alone": Actuators(Drive(max_brake_N_m=0.0)),
    "half electric, half pneumatic": Actuators(Drive(max_brake_N_m=11_000.0)),
}
STOPS: dict[str, Callable[[Rng], RidePlan]] = {"greasy, known before": short_stop, "dry, leaf patch": leaf_stop}


def actuators() -> Iterator[LoopCase]:
    """The same runs with each."""
    for rail, plan in STOPS.items():
        for name, a in SWEEP.items():
            shown = name == "pneumatic alone" and plan is short_stop
            row = f"{rail}: {name}"
            yield LoopCase("actuators", row, plan, 1, _with(a), rail, "", BARE_AND_WITH, shown=shown)


def _with(a: Actuators) -> World:
    return lambda s, _: replace(s, actuators=a)
