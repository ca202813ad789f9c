"""Stops and starts on every kind of rail: one axle, and four."""

from collections.abc import Iterator

from sim_ecu.loop.names import EVERY
from sim_ecu.loop.suites.case import (
    BEFORE_S,
    DAMP,
    DRY,
    GREASY,
    KNOWN_S,
    LEAVES,
    LOW,
    WET,
    Case,
    Plan,
    Rng,
    asks,
    curve,
)
from sim_ecu.physics.contact import CreepCurve

PULLS_S = 10.0  # of full effort, where the driver pulls
BRAKE, PULL = -1.0, 1.0
WET_STOP, GREASY_STOP, LOW_STOP = "stop, wet, known before", "stop, greasy, known before", "stop, low, known before"
PATCH_STOP = "stop, wet, leaf patch on the way"
LEAF_STOP = "stop, dry, leaf patch"
SEVERAL_STOP = "stop, wet, several patches"
LEAF_START = "start, dry, leaf patch"
WET_START = "start, wet from the beginning"


def _stop(rng: Rng, friction: tuple[float, float], speeds: tuple[float, float], known: bool, most_s: float) -> Plan:
    """On one rail all along."""
    rail = ((0.0, curve(rng, friction)),)
    return Plan(rail, float(rng.uniform(*speeds)), asks(BRAKE, rng, known), most_s, known)


def wet_stop(rng: Rng) -> Plan:
    """From 18 to 24 m/s."""
    return _stop(rng, WET, (18.0, 24.0), True, 45.0)


def greasy_stop(rng: Rng) -> Plan:
    """From 15 to 18 m/s."""
    return _stop(rng, GREASY, (15.0, 18.0), True, 60.0)


def low_stop(rng: Rng) -> Plan:
    """From 10 to 13 m/s: low all along."""
    return _stop(rng, LOW, (10.0, 13.0), True, 70.0)


def wet_surprise(rng: Rng) -> Plan:
    """Wet from the beginning, and no effort before the demand."""
    return _stop(rng, WET, (18.0, 24.0), False, 45.0)


def greasy_surprise(rng: Rng) -> Plan:
    """The same, greasy."""
    return _stop(rng, GREASY, (15.0, 18.0), False, 60.0)


def leaf_stop(rng: Rng) -> Plan:
    """Braking on a dry rail meets 30 to 60 m of leaf film after 15 to 40 m."""
    v, begin, length = rng.uniform(18.0, 22.0), rng.uniform(15.0, 40.0), rng.uniform(30.0, 60.0)
    at = v * BEFORE_S + begin
    rail = ((0.0, curve(rng, DRY)), (at, curve(rng, LEAVES)), (at + length, curve(rng, DRY)))
    return Plan(rail, float(v), asks(BRAKE, rng, False), 45.0)


def dry_wet_dry_stop(rng: Rng) -> Plan:
    """Braking on a dry rail, 40 to 70 m of a wet one after 15 to 30 m, then dry again."""
    v, begin, length = rng.uniform(20.0, 25.0), rng.uniform(15.0, 30.0), rng.uniform(40.0, 70.0)
    at = v * BEFORE_S + begin
    rail = ((0.0, curve(rng, DRY)), (at, curve(rng, WET)), (at + length, curve(rng, DRY)))
    return Plan(rail, float(v), asks(BRAKE, rng, False), 45.0)


def patch_while_stopping(rng: Rng) -> Plan:
    """A stop on a wet rail meets 15 to 30 m of leaf film, when half of the way is done.

    The rail has been met before the demand, the patch has not."""
    v, begin, length = rng.uniform(18.0, 22.0), rng.uniform(30.0, 60.0), rng.uniform(15.0, 30.0)
    at, wet = v * KNOWN_S + begin, curve(rng, WET)
    rail = ((0.0, wet), (at, curve(rng, LEAVES)), (at + length, wet))
    return Plan(rail, float(v), asks(BRAKE, rng, True), 60.0)


def several_patches_stop(rng: Rng) -> Plan:
    """A stop on a wet rail with three greasy or low patches of 8 to 20 m, 15 to 30 m apart; nothing known before."""
    v = float(rng.uniform(18.0, 22.0))
    return Plan(_patches(rng, v * BEFORE_S, WET, 3), v, asks(BRAKE, rng, False), 60.0)


def _patches(rng: Rng, at_m: float, friction: tuple[float, float], count: int) -> tuple[tuple[float, CreepCurve], ...]:
    base = curve(rng, friction)
    rail = [(0.0, base)]
    for _ in range(count):
        at_m += float(rng.uniform(15.0, 30.0))
        rail.append((at_m, curve(rng, GREASY if rng.random() < 0.5 else LOW)))
        at_m += float(rng.uniform(8.0, 20.0))
        rail.append((at_m, base))
    return tuple(rail)


def leaf_start(rng: Rng) -> Plan:
    """Pulling on a dry rail from 10 to 14 m/s meets 4 to 6 s of leaf film."""
    v, begin, length = rng.uniform(10.0, 14.0), rng.uniform(15.0, 30.0), rng.uniform(4.0, 6.0)
    at = v * BEFORE_S + begin
    rail = ((0.0, curve(rng, DRY)), (at, curve(rng, LEAVES)), (at + length * v, curve(rng, DRY)))
    return Plan(rail, float(v), asks(PULL, rng, False), BEFORE_S + PULLS_S)


def wet_start(rng: Rng) -> Plan:
    """From 4 to 6 m/s on a wet rail, without any effort before."""
    return _start(rng, WET, (4.0, 6.0), False)


def greasy_start(rng: Rng) -> Plan:
    """From 6 to 10 m/s on a greasy rail that a little effort has met."""
    return _start(rng, GREASY, (6.0, 10.0), True)


def low_start(rng: Rng) -> Plan:
    """The same, low all along."""
    return _start(rng, LOW, (6.0, 10.0), True)


def _start(rng: Rng, friction: tuple[float, float], speeds: tuple[float, float], known: bool) -> Plan:
    end_s = (KNOWN_S if known else BEFORE_S) + PULLS_S
    return Plan(((0.0, curve(rng, friction)),), float(rng.uniform(*speeds)), asks(PULL, rng, known), end_s, known)


def dry_wet_dry_start(rng: Rng) -> Plan:
    """Pulling on a dry rail, 40 to 70 m of a wet one, then dry again."""
    v, begin, length = rng.uniform(8.0, 12.0), rng.uniform(15.0, 30.0), rng.uniform(40.0, 70.0)
    at = v * BEFORE_S + begin
    rail = ((0.0, curve(rng, DRY)), (at, curve(rng, WET)), (at + length, curve(rng, DRY)))
    return Plan(rail, float(v), asks(PULL, rng, False), BEFORE_S + PULLS_S)


def several_patches_start(rng: Rng) -> Plan:
    """Pulling on a damp rail with three greasy or low patches."""
    v = float(rng.uniform(8.0, 12.0))
    return Plan(_patches(rng, v * BEFORE_S, DAMP, 3), v, asks(PULL, rng, False), BEFORE_S + PULLS_S)


STOPS = {
    WET_STOP: wet_stop, GREASY_STOP: greasy_stop, LOW_STOP: low_stop,
    PATCH_STOP: patch_while_stopping,
    "stop, wet from the beginning": wet_surprise, "stop, greasy from the beginning": greasy_surprise,
    LEAF_STOP: leaf_stop, "stop, dry, wet, dry": dry_wet_dry_stop, SEVERAL_STOP: several_patches_stop,
}  # fmt: skip
STARTS = {
    "start, greasy, known before": greasy_start, "start, low, known before": low_start,
    WET_START: wet_start, LEAF_START: leaf_start, "start, dry, wet, dry": dry_wet_dry_start,
    "start, damp, several patches": several_patches_start,
}  # fmt: skip
TRAIN = {
    GREASY_STOP: greasy_stop, LEAF_STOP: leaf_stop, SEVERAL_STOP: several_patches_stop, LEAF_START: leaf_start,
}  # fmt: skip
TRAIN_AXLES = 4


def braking() -> Iterator[Case]:
    """One axle."""
    for name, plan in STOPS.items():
        yield Case("braking", name, plan, controllers=EVERY, shown=name == GREASY_STOP)


def traction() -> Iterator[Case]:
    """One axle."""
    for name, plan in STARTS.items():
        yield Case("traction", name, plan, shown=name == LEAF_START)


def train() -> Iterator[Case]:
    """Four axles that follow each other over the same rail."""
    for name, plan in TRAIN.items():
        yield Case("train", name, plan, axles=TRAIN_AXLES, shown=name == LEAF_STOP)
