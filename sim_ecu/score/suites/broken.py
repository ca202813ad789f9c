"""Sensors that give nothing but their own noise, sensors mounted wrongly, wheelsets that the design is not for."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.faults import Fault
from sim_ecu.play.vehicles import load_vehicle
from sim_ecu.score.suites.nominal import MEMS, Variant, condition, spread, varied
from sim_ecu.score.suites.run import AXLES, TEST, Lot, Run

DIES_S = 5.0
DEAD_S = 16.0  # length of a run: ten seconds after, and time to see that it stays so
DEAD_RUNS = 10
YAW, LAT = "yaw_rate", "lateral_acceleration"
BOTH_DIE, BOTH_DEAD = "both die", "both dead from the start"
GYRO_DIES, ACCELEROMETER_DIES = "the gyro dies", "the accelerometer dies"

FOREIGN_S = 13.0  # a window and ten seconds of judgement, and time to see that it stays so
FOREIGN_RUNS = 20
OTHERS_RUNS = 8
REVERSED, SWAPPED, DEAD_GYRO = "reversed gyro", "accelerometers' wires swapped between axles", "dead gyro"
DEAD_ACCELEROMETER, NO_SENSOR = "dead accelerometer", "both dead"
OTHER_WHEELSETS = ("metro", "locomotive")


def amplified(yaw_rate: float, lat_accel: float) -> SensorSet:
    """The sensors with a gain on what they feel; with 0 their own noise is left."""
    return replace(
        MEMS,
        yaw_rate=replace(MEMS.yaw_rate, gain=yaw_rate),
        lat_accel=replace(MEMS.lat_accel, gain=lat_accel),
    )


def _dying(*signals: str) -> tuple[Fault, ...]:
    return tuple(Fault("dead", DIES_S, DEAD_S - DIES_S, s, a) for a in range(1, AXLES + 1) for s in signals)


# On one track, as a train is: what the other axle of a bogie feels is the same, a moment later.
_on_one_track = partial(Variant, one_track=True)
DEAD = (
    _on_one_track(BOTH_DIE, faults=_dying(YAW, LAT)),
    _on_one_track(BOTH_DEAD, sensors=amplified(0.0, 0.0)),
    _on_one_track(GYRO_DIES, faults=_dying(YAW)),
    _on_one_track(ACCELEROMETER_DIES, faults=_dying(LAT)),
)
FOREIGN = (
    _on_one_track(REVERSED, sensors=amplified(-1.0, 1.0)),
    _on_one_track(SWAPPED, faults=tuple(Fault("swap-wiring", 0.0, FOREIGN_S, LAT, a) for a in (1, 3))),
    _on_one_track(DEAD_GYRO, sensors=amplified(0.0, 1.0)),
    _on_one_track(DEAD_ACCELEROMETER, sensors=amplified(1.0, 0.0)),
    _on_one_track(NO_SENSOR, sensors=amplified(0.0, 0.0)),
)


def dead(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Cables that come off, sensors that freeze inside: noise goes on."""
    for k, variant in enumerate(DEAD):
        dies = variant.name != BOTH_DEAD
        for n in spread(scale, DEAD_RUNS, 60 + k):
            run = condition("dead", w, n, variant, DEAD_S, lot)
            yield replace(run, judged_from_s=DIES_S, changes_s=(DIES_S,)) if dies else replace(run, judged_from_s=0.0)


def foreign(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """What is wrong from the first day on; and other wheelsets under the design, which nothing on the bus shows."""
    yield from varied("foreign", FOREIGN, FOREIGN_RUNS, 70, FOREIGN_S)(w, scale, lot)
    for k, name in enumerate(OTHER_WHEELSETS):
        other = replace(load_vehicle(name), bogie=w.bogie)
        yield from varied("foreign", [Variant(wheelset_of(name))], OTHERS_RUNS, 80 + k)(other, scale, lot)


def wheelset_of(name: str) -> str:
    """The group of a wheelset that the design is not for."""
    return f"{name} wheelset"
