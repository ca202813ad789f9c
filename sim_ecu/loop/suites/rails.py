"""Stops and starts on every kind of rail: one axle, and four."""

from collections.abc import Callable, Iterator

from sim_ecu.loop import EVERY
from sim_ecu.loop.suites.rides import (
    BEFORE_S,
    DAMP,
    DRY,
    GREASY,
    KNOWN_S,
    LEAVES,
    LOW,
    WET,
    LoopCase,
    RidePlan,
    Rng,
    curve,
    demand,
)

PULLS_S = 10.0  # of full effort, where the driver pulls
BRAKE, PULL = -1.0, 1.0
Draw = Callable[[Rng], RidePlan]
WET_STOP, GREASY_STOP, LOW_STOP = "stop, wet, known before", "stop, greasy, known before", "stop, low, known before"
PATCH_STOP = "stop, wet, leaf patch on the way"
LEAF_STOP = "stop, dry, leaf patch"
SEVERAL_STOP = "stop, wet, several patches"
LEAF_START = "start, dry, leaf patch"
WET_START = "start, wet from the beginning"


Range = tuple[float, float]


def _same(friction: Range, speeds: Range, way: float, known: bool, seconds: float) -> Draw:
    """One rail all along; seconds: at most where the train brakes, of full effort where it pulls."""

    def plan(rng: Rng) -> RidePlan:
        rail = ((0.0, curve(rng, friction)),)
        most_s = seconds if way == BRAKE else seconds + (KNOWN_S if known else BEFORE_S)
        return RidePlan(rail, float(rng.uniform(*speeds)), demand(way, rng, known), most_s, known)

    return plan


def _part(
    base: Range, film: Range, speeds: Range, begins_m: Range, lengths: Range, way: float, most_s: float,
    met: bool = False, in_seconds: bool = False,
) -> Draw:  # fmt: skip
    """A rail of which a part, so long after the demand, is another. met: the rest has been met before the demand, and
    is the same behind the part. in_seconds: the part's length."""

    def plan(rng: Rng) -> RidePlan:
        v, begin, length = rng.uniform(*speeds), rng.uniform(*begins_m), rng.uniform(*lengths)
        at = v * (KNOWN_S if met else BEFORE_S) + begin
        first, other = curve(rng, base), curve(rng, film)
        rail = ((0.0, first), (at, other), (at + length * (v if in_seconds else 1), first if met else curve(rng, base)))
        return RidePlan(rail, float(v), demand(way, rng, met), most_s)

    return plan


def _patches(base: Range, speeds: Range, way: float, most_s: float) -> Draw:
    """A rail with three greasy or low patches of 8 to 20 m, 15 to 30 m apart; nothing known before."""

    def plan(rng: Rng) -> RidePlan:
        v = float(rng.uniform(*speeds))
        at_m, of = v * BEFORE_S, curve(rng, base)
        rail = [(0.0, of)]
        for _ in range(3):
            at_m += float(rng.uniform(15.0, 30.0))
            rail.append((at_m, curve(rng, GREASY if rng.random() < 0.5 else LOW)))
            at_m += float(rng.uniform(8.0, 20.0))
            rail.append((at_m, of))
        return RidePlan(tuple(rail), v, demand(way, rng, False), most_s)

    return plan


greasy_stop = _same(GREASY, (15.0, 18.0), BRAKE, True, 60.0)
leaf_stop = _part(DRY, LEAVES, (18.0, 22.0), (15.0, 40.0), (30.0, 60.0), BRAKE, 45.0)
met_leaf_stop = _part(DRY, LEAVES, (18.0, 22.0), (15.0, 40.0), (30.0, 60.0), BRAKE, 45.0, met=True)
several_patches_stop = _patches(WET, (18.0, 22.0), BRAKE, 60.0)
PULLED_S = BEFORE_S + PULLS_S
leaf_start = _part(DRY, LEAVES, (10.0, 14.0), (15.0, 30.0), (4.0, 6.0), PULL, PULLED_S, in_seconds=True)
STOPS: dict[str, Draw] = {
    WET_STOP: _same(WET, (18.0, 24.0), BRAKE, True, 45.0),
    GREASY_STOP: greasy_stop,
    LOW_STOP: _same(LOW, (10.0, 13.0), BRAKE, True, 70.0),
    # leaves when half of the way is done: the rail has been met before the demand, the patch has not
    PATCH_STOP: _part(WET, LEAVES, (18.0, 22.0), (30.0, 60.0), (15.0, 30.0), BRAKE, 60.0, met=True),
    "stop, wet from the beginning": _same(WET, (18.0, 24.0), BRAKE, False, 45.0),
    "stop, greasy from the beginning": _same(GREASY, (15.0, 18.0), BRAKE, False, 60.0),
    LEAF_STOP: leaf_stop,
    "stop, dry, wet, dry": _part(DRY, WET, (20.0, 25.0), (15.0, 30.0), (40.0, 70.0), BRAKE, 45.0),
    SEVERAL_STOP: several_patches_stop,
}
STARTS: dict[str, Draw] = {
    "start, greasy, known before": _same(GREASY, (6.0, 10.0), PULL, True, PULLS_S),
    "start, low, known before": _same(LOW, (6.0, 10.0), PULL, True, PULLS_S),
    WET_START: _same(WET, (4.0, 6.0), PULL, False, PULLS_S),
    LEAF_START: leaf_start,
    "start, dry, wet, dry": _part(DRY, WET, (8.0, 12.0), (15.0, 30.0), (40.0, 70.0), PULL, PULLED_S),
    "start, damp, several patches": _patches(DAMP, (8.0, 12.0), PULL, PULLED_S),
}
TRAIN = {
    GREASY_STOP: greasy_stop, LEAF_STOP: leaf_stop, SEVERAL_STOP: several_patches_stop, LEAF_START: leaf_start,
}  # fmt: skip
TRAIN_AXLES = 4


def braking() -> Iterator[LoopCase]:
    """One axle."""
    for name, plan in STOPS.items():
        yield LoopCase("braking", name, plan, controllers=EVERY, shown=name == GREASY_STOP)


def traction() -> Iterator[LoopCase]:
    """One axle."""
    for name, plan in STARTS.items():
        yield LoopCase("traction", name, plan, shown=name == LEAF_START)


def train() -> Iterator[LoopCase]:
    """Four axles that follow each other over the same rail."""
    for name, plan in TRAIN.items():
        yield LoopCase("train", name, plan, axles=TRAIN_AXLES, shown=name == LEAF_STOP)
