"""What `sim-ecu score` plays: scenarios of up to four wheelsets, whose seeds no training condition has."""

from collections.abc import Callable, Iterator

from sim_ecu.design.source import Source
from sim_ecu.score.names import SUITES
from sim_ecu.score.suites.broken import dead, foreign
from sim_ecu.score.suites.changes import cycles, drops, paper, transitions
from sim_ecu.score.suites.dry import dry_hours
from sim_ecu.score.suites.harsh import harsh, slow
from sim_ecu.score.suites.nominal import grid, robust, rough
from sim_ecu.score.suites.run import Lot, Run, scored_lot, training_lot
from sim_ecu.score.suites.sound import canted, long, peak

# suites whose runs are compared with those of the grid that have the same conditions
PAIRED = ("robust", "rough", "harsh")


def runs(source: Source, suite: str | None, scale: float, lot: int = 0) -> Iterator[Run]:
    """One suite or all of them; scale is the share of the runs. A paired suite brings its part of the grid along.

    lot: 0 is what `sim-ecu score` plays; each other number below TEST_LOTS, and TUNED_LOT, gives the same kinds of
    runs with seeds of its own.
    """
    yield from _runs(source, suite, scale, scored_lot(lot))


def training_runs(source: Source, suite: str, scale: float, lot: int = 0) -> Iterator[Run]:
    """The same with seeds that no score has: to tune with. lot: below TRAINING_LOTS."""
    yield from _runs(source, suite, scale, training_lot(lot))


def _runs(source: Source, suite: str | None, scale: float, lot: Lot) -> Iterator[Run]:
    w = source.wheelset
    makers: dict[str, Callable[[], Iterator[Run]]] = {
        "paper": lambda: paper(w, scale, lot),
        "grid": lambda: grid(w, scale, lot),
        "robust": lambda: robust(w, scale, lot),
        "rough": lambda: rough(w, scale, source.roughness, lot),
        "harsh": lambda: harsh(w, scale, lot),
        "long": lambda: long(w, scale, lot),
        "canted": lambda: canted(w, scale, lot),
        "peak": lambda: peak(w, scale, lot),
        "transitions": lambda: transitions(w, scale, lot),
        "drops": lambda: drops(w, scale, lot),
        "cycles": lambda: cycles(w, scale, lot),
        "slow": lambda: slow(w, scale, lot),
        "dead": lambda: dead(w, scale, lot),
        "foreign": lambda: foreign(w, scale, lot),
        "dry-hours": lambda: dry_hours(w, scale, lot),
    }
    if suite is None:
        for name in SUITES:
            yield from makers[name]()
        return
    wanted = list(makers[suite]())
    if suite in PAIRED:
        numbers = {r.number for r in wanted}
        yield from (r for r in grid(w, scale, lot) if r.group == "mems" and r.number in numbers)
    yield from wanted
