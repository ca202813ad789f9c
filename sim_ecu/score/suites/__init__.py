"""What `sim-ecu score` plays: scenarios of up to four wheelsets, whose seeds no training condition has."""

from collections.abc import Callable, Iterator

from sim_ecu.design.source import Source
from sim_ecu.score.names import SUITES
from sim_ecu.score.suites.broken import dead, foreign
from sim_ecu.score.suites.changes import cycles, drops, paper, transitions
from sim_ecu.score.suites.dry import dry_hours
from sim_ecu.score.suites.harsh import harsh, slow
from sim_ecu.score.suites.nominal import grid, robust, rough
from sim_ecu.score.suites.run import Run

# suites whose runs are compared with those of the grid that have the same conditions
PAIRED = ("robust", "rough", "harsh")


def runs(source: Source, suite: str | None, scale: float) -> Iterator[Run]:
    """One suite or all of them; scale is the share of the runs. A paired suite brings its part of the grid along."""
    w = source.wheelset
    makers: dict[str, Callable[[], Iterator[Run]]] = {
        "paper": lambda: paper(w, scale),
        "grid": lambda: grid(w, scale),
        "robust": lambda: robust(w, scale),
        "rough": lambda: rough(w, scale, source.roughness),
        "harsh": lambda: harsh(w, scale),
        "transitions": lambda: transitions(w, scale),
        "drops": lambda: drops(w, scale),
        "cycles": lambda: cycles(w, scale),
        "slow": lambda: slow(w, scale),
        "dead": lambda: dead(w, scale),
        "foreign": lambda: foreign(w, scale),
        "dry-hours": lambda: dry_hours(w, scale),
    }
    if suite is None:
        for name in SUITES:
            yield from makers[name]()
        return
    wanted = list(makers[suite]())
    if suite in PAIRED:
        numbers = {r.number for r in wanted}
        yield from (r for r in grid(w, scale) if r.group == "mems" and r.number in numbers)
    yield from wanted
