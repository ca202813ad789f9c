"""What `sim-ecu score` plays: scenarios of up to four wheelsets, whose seeds no training condition has."""

from collections.abc import Callable, Iterator

from sim_ecu.design.brief import Recipe
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.score import ON_REQUEST, SUITES
from sim_ecu.score.suites.broken import dead, foreign
from sim_ecu.score.suites.change_suites import cycles, drops, paper, transitions
from sim_ecu.score.suites.map_passages import map_passages
from sim_ecu.score.suites.nominal import grid, harsh, robust, rough, slow
from sim_ecu.score.suites.run import Lot, Run, lot_of
from sim_ecu.score.suites.sound import canted, dry_hours, long, peak
from sim_ecu.score.suites.worlds import worlds

# suites whose runs are compared with those of the grid that have the same conditions
PAIRED = ("robust", "rough", "harsh")


def runs(source: Recipe, suite: str | None, scale: float, number: int = 0) -> Iterator[Run]:
    """One suite or all of them; scale is the share of the runs. A paired suite brings its part of the grid along.

    number: of a lot; 0 is what `sim-ecu score` plays, each other one gives the same kinds of runs with seeds of its
    own, and those below zero seeds that no score has: to choose a design by.
    """
    w, lot = source.wheelset, lot_of(number)
    makers: dict[str, Callable[[Wheelset, float, Lot], Iterator[Run]]] = {
        "paper": paper, "grid": grid, "robust": robust, "harsh": harsh, "long": long, "canted": canted, "peak": peak,
        "rough": lambda w, scale, lot: rough(w, scale, source.roughness, lot), "transitions": transitions,
        "drops": drops, "cycles": cycles, "slow": slow, "dead": dead, "foreign": foreign, "dry-hours": dry_hours,
        "worlds": lambda _, scale, lot: worlds(source, scale, lot),
        "map": lambda _, scale, lot: map_passages(source, scale, lot),
    }  # fmt: skip
    if suite is None:
        for name in (s for s in SUITES if s not in ON_REQUEST):
            yield from makers[name](w, scale, lot)
        return
    wanted = list(makers[suite](w, scale, lot))
    if suite in PAIRED:
        numbers = {r.number for r in wanted}
        yield from (r for r in grid(w, scale, lot) if r.group == "mems" and r.number in numbers)
    yield from wanted
