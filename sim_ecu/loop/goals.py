"""What wrcd is held to in a loop: the same controller with it against without it. What is missed stays in the table."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from sim_ecu.loop.names import CREEP, LAWS, THRESHOLDS
from sim_ecu.loop.statistics import Against
from sim_ecu.loop.suites.case import FEW_SEEDS, FIRST_TEST_SEED
from sim_ecu.loop.suites.rails import GREASY_STOP, WET_STOP
from sim_ecu.score.goals import Goal
from sim_ecu.score.metrics.bootstrap import Figure

MAX_BEYOND = 0.2
MAX_DISTANCE = {THRESHOLDS: 0.9, CREEP: 1.08}
MAX_ENERGY = 0.5
MAX_LONGER = 1.03
MIN_RUNS = FEW_SEEDS  # a figure of fewer pairs judges nothing
RAILS = ("braking", "traction", "train")  # suites that differ in nothing but the rail

BEYOND, SHORTER, ENERGY, AT_DISTANCE = "beyond", "shorter", "energy", "at distance"
LONGER, LONGEST, FRONT = "longer", "longest run", "front"


@dataclass(frozen=True, slots=True)
class LoopGoal:
    """A goal of a kind, and beside it what the ideal reaches against the same bare controller.

    ideal: its figures by their names, empty where no ideal was driven. ideal_is: whether it meets the bound itself;
    None where that is not known.
    """

    suite: str
    kind: str
    goal: Goal
    ideal: dict[str, float]
    ideal_is: bool | None


def goals(suites: dict[str, Any]) -> list[LoopGoal]:
    """All goals of the suites that were played."""
    out: list[LoopGoal] = []
    for suite, cases in suites.items():
        compared = {name: case for name, case in cases.items() if case["against"]}
        for name, case in compared.items():
            out += _of_case(suite, name, case)
        out += _longest(suite, {name: case for name, case in compared.items() if case["braking"]})
    return out


def _of_case(suite: str, name: str, case: dict[str, Any]) -> Iterator[LoopGoal]:
    what, known = f"{suite}: {name}", case["known_before"]
    new, ideal = case["against"], case["ideal"]
    if known:
        for law in LAWS:
            goal = _goal(f"{what}: {law}, time beyond the peak over that without", new[law].beyond_time, MAX_BEYOND)
            yield _beside(suite, BEYOND, goal, ideal.get(law), "beyond_time")
            figure = new[law].beyond_energy
            goal = _goal(f"{what}: {law}, slip energy beyond the peak over that without", figure, MAX_BEYOND)
            yield _beside(suite, BEYOND, goal, ideal.get(law), "beyond_energy")
    if known and case["braking"] and suite in RAILS:
        if name in (WET_STOP, GREASY_STOP):
            goal = _goal(
                f"{what}: thresholds, distance over that without", new[THRESHOLDS].way, MAX_DISTANCE[THRESHOLDS]
            )
            yield _beside(suite, SHORTER, goal, ideal.get(THRESHOLDS), "way")
        goal = _goal(f"{what}: creep, slip energy over that without", new[CREEP].energy, MAX_ENERGY)
        yield _beside(suite, ENERGY, goal, ideal.get(CREEP), "energy", "way")
        goal = _goal(f"{what}: creep, distance over that without", new[CREEP].way, MAX_DISTANCE[CREEP])
        yield _beside(suite, AT_DISTANCE, goal, ideal.get(CREEP), "way", "energy")
    if case["braking"]:
        for law in LAWS:
            goal = _goal(f"{what}: {law}, distance over that without, median", new[law].way, MAX_LONGER)
            yield _beside(suite, LONGER, goal, ideal.get(law), "way", "energy")
    if suite in RAILS:
        whole = "front, least factor by which it is better than each bare controller"
        yield LoopGoal(suite, FRONT, _goal(f"{what}: {whole}", case["front"], 1.0, True), {}, None)


def _goal(what: str, figure: Figure, bound: float, at_least: bool = False, never: bool = False) -> Goal:
    return Goal(what, figure, bound, at_least, MIN_RUNS, never)


def _beside(suite: str, kind: str, goal: Goal, ideal: Against | None, *keys: str) -> LoopGoal:
    """The ideal's figures; the first of the keys is the goal's."""
    if ideal is None:
        return LoopGoal(suite, kind, goal, {}, None)
    found = {key: float(getattr(ideal, key).value) for key in keys}
    return LoopGoal(suite, kind, goal, found, found[keys[0]] <= goal.bound)


def _longest(suite: str, stops: dict[str, dict[str, Any]]) -> Iterator[LoopGoal]:
    """Of every controller the single run whose stop grows most. It happened: no interval excuses it."""
    for law in LAWS:
        known = {name: c["against"][law] for name, c in stops.items() if not math.isnan(c["against"][law].worst)}
        if known:
            name = max(known, key=lambda n: known[n].worst)
            a: Against = known[name]
            runs = sum(x.way.runs for x in known.values())
            seed = FIRST_TEST_SEED + (a.worst_number or 0)
            what = f"{suite}: {law}, distance over that without, the worst of all runs ({name}, seed {seed})"
            # too few to judge where its own case is
            figure = Figure(a.worst, math.nan, math.nan, a.way.runs, runs)
            yield LoopGoal(suite, LONGEST, _goal(what, figure, MAX_LONGER, never=True), {}, None)
