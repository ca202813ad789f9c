"""Worlds by name, each of a family: as the training's, wider than they are, or of a kind that no training has."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from sim_ecu.design.brief import Recipe
from sim_ecu.score.suites.nominal import ROBUST, Variant, condition, spread
from sim_ecu.score.suites.run import TEST, Lot, Run

AS_TRAINED, WIDER, UNSEEN = "as trained", "wider", "unseen"  # families
WORLD_RUNS = 20  # of each world: enough that more than ten of them are below half of the rail in use


@dataclass(frozen=True, slots=True)
class World:
    """What a row of the suite plays. tied: whether the slope of the rail's creep curves is that of their friction.
    make: returns one of its runs for a design, a lot and the number of the conditions."""

    name: str
    family: str
    tied: bool
    make: Callable[[Recipe, Lot, int], Run]


def varied_as(variant: Variant) -> Callable[[Recipe, Lot, int], Run]:
    """The grid's conditions of a lone wheelset, with a variant."""
    return lambda source, lot, number: condition("worlds", source.wheelset, number, variant, lot=lot)


WORLDS = (
    World("lone wheelset", AS_TRAINED, True, varied_as(Variant())),
    World("lone wheelset, parameters off by up to 10 %", WIDER, True, varied_as(ROBUST[0])),
)


def worlds(source: Recipe, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """So many runs of each world."""
    for k, world in enumerate(WORLDS):
        for number in spread(scale, WORLD_RUNS, k):
            yield replace(world.make(source, lot, number), suite="worlds", group=world.name)
