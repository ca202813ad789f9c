"""What wrcd is held to in a loop: the same controller with it against without it. What is missed stays in the table."""

from collections.abc import Iterator
from typing import Any

from sim_ecu.loop.names import CREEP, LAWS, THRESHOLDS
from sim_ecu.loop.statistics import Against
from sim_ecu.loop.suites.rails import GREASY_STOP, WET_STOP
from sim_ecu.score.goals import Goal

MAX_SLIDES = 0.2
MAX_DISTANCE = {THRESHOLDS: 0.9, CREEP: 1.08}
MAX_ENERGY = 0.5
MAX_LONGER = 1.03
RAILS = ("braking", "traction", "train")  # suites that differ in nothing but the rail


def goals(suites: dict[str, Any]) -> list[Goal]:
    """All goals of the suites that were played."""
    out: list[Goal] = []
    for suite, cases in suites.items():
        for name, case in cases.items():
            if suite in RAILS and case["against"]:
                out += _of_rail(f"{suite}: {name}", case, name)
        out += _longest(suite, cases)
    return out


def _of_rail(what: str, case: dict[str, Any], name: str) -> Iterator[Goal]:
    if case["known_before"]:
        for law in LAWS:
            yield Goal(f"{what}: {law}, slides over those without wrcd", case["against"][law].slides, MAX_SLIDES)
    if case["known_before"] and case["braking"]:
        if name in (WET_STOP, GREASY_STOP):
            distance = case["against"][THRESHOLDS].way
            yield Goal(f"{what}: thresholds, distance over that without", distance, MAX_DISTANCE[THRESHOLDS])
        yield Goal(f"{what}: creep, slip energy over that without", case["against"][CREEP].energy, MAX_ENERGY)
        yield Goal(f"{what}: creep, distance over that without", case["against"][CREEP].way, MAX_DISTANCE[CREEP])
    yield Goal(f"{what}: front, factor by which the bare ones are no better", case["front"], 1.0, True)


def _longest(suite: str, cases: dict[str, Any]) -> Iterator[Goal]:
    """Of every controller the case whose stops grow most."""
    for law in LAWS:
        stops: dict[str, Against] = {n: c["against"][law] for n, c in cases.items() if c["braking"] and c["against"]}
        if stops:
            worst = max(stops, key=lambda n: stops[n].way.value)
            yield Goal(
                f"{suite}: {law}, distance over that without, the longest case ({worst})", stops[worst].way, MAX_LONGER
            )
