"""The fronts as sentences, tables for a terminal, and one page with a picture for every rail."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from sim_ecu.loop import LAWS, WITH
from sim_ecu.loop.fronts.front_figures import FrontComparison
from sim_ecu.loop.fronts.front_rides import CASES, TOLD_PCT, tuned
from sim_ecu.loop.fronts.front_sentences import says, span
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting import page as reporting
from sim_ecu.reporting.page import Items, PageSection
from sim_ecu.reporting.table import Row, Table
from sim_ecu.reporting.values import Rounded, number
from sim_ecu.score.sections import warnings

WHAT = (
    "Another set point moves a controller's stop along a front: less slip energy, more distance. So each law is driven "
    "at eight set points with wrcd and at the same eight without, on the same runs. A front is what no other set point "
    "betters in both the median slip energy of a wheel (kJ) and the median distance (m), with lines between its "
    "points. A figure is the front with wrcd over the one without, the geometric mean along the former as far as the "
    "latter reaches it: energy at equal distance is the least energy within a distance, distance at equal energy the "
    "least distance within an energy. In brackets its 90 % interval, of whole runs."
)
CHANCE = "Of figures that are 1 in truth every tenth interval leaves it out: {count} figures are judged here."
POINTS = (
    "medians of distance and slip energy at every set point, and of the lies; thresholds: a factor of the slips at "
    "which it acts"
)
FRONTS = "the front with wrcd over that without, by rail and law"
TOLD = (
    "energy at equal distance over the front without wrcd: of the front with wrcd, and of the tuned law that is told a "
    "constant adhesion all along in the daemon's place, Valid and precise. A dash: no stop without wrcd is so short"
)


def sections(result: Mapping[str, Any]) -> list[PageSection]:
    """Return the sentences, and the tables of the fronts, the lies and the points."""
    run, fronts = result["run"], result["fronts"]
    count = 2 * len(LAWS) * len(fronts)
    head = PageSection("", parts=[
        f"Runs of every point: {run['seeds']}, seeds from {FIRST_TEST_SEED} on; the controllers were tuned on seeds "
        "below 1000.", WHAT, CHANCE.format(count=count),
    ])  # fmt: skip
    every = [(rail, law, of) for rail, laws in fronts.items() for law, of in laws.items()]
    return [
        head,
        PageSection("fronts", FRONTS, [
            Items([f"{rail}: {says(law, of['with_over_bare'])}" for rail, law, of in every]), _fronts(every),
        ]),
        PageSection("told", TOLD, [_told(every)]),
        PageSection("points", POINTS, [_points(every)]),
    ]  # fmt: skip


def text(result: Mapping[str, Any]) -> list[str]:
    """Return all as lines for a terminal, and for a page of docs."""
    return [line for word, of in warnings(result) for line in (f"{word}: {of}", "")] + reporting.markdown(
        sections(result)
    )


def page(result: Mapping[str, Any]) -> str:
    """Return all as HTML, with pictures inside."""
    from sim_ecu.loop.fronts.front_pictures import picture

    pictures = (picture(rail, CASES[rail].name, laws) for rail, laws in result["fronts"].items())
    heading = "Is it wrcd, or another set point?"
    return reporting.html(reporting.Page("sim-ecu fronts", heading, sections(result), (), warnings(result), pictures))


def _fronts(every: Sequence[tuple[str, str, Mapping[str, Any]]]) -> Table:
    head = ["rail: law", "distances, m", "energy at equal distance", "energies, kJ",
            "distance at equal energy"]  # fmt: skip
    return Table(head, list(_front_rows(every)))


def _front_rows(every: Sequence[tuple[str, str, Mapping[str, Any]]]) -> Iterator[Row]:
    for rail, law, of in every:
        c: FrontComparison = of["with_over_bare"]
        yield Row([
            f"{rail}: {law}", span((c.energy.at[0], c.energy.at[-1])), c.energy.mean,
            span((c.distance.at[0], c.distance.at[-1])), Rounded(c.distance.mean, 3),
        ])  # fmt: skip


def _told(every: Sequence[tuple[str, str, Mapping[str, Any]]]) -> Table:
    rows = [
        [f"{rail}: {law}", of["with_over_bare"].energy.mean, *(t["over_bare"].energy.mean for t in of["told"])]
        for rail, law, of in every
    ]
    return Table(["rail: law", "with wrcd", *(f"told {pct:g} %" for pct in TOLD_PCT)], rows)


def _points(every: Sequence[tuple[str, str, Mapping[str, Any]]]) -> Table:
    head = ["rail: law", "set point", "distance, m", "with wrcd", "slip energy, kJ", "with wrcd"]
    rows = []
    for rail, law, of in every:
        for bare, own in zip(of["points"][law], of["points"][WITH[law]], strict=True):
            at = f"{bare['set_point']:g}" + (", tuned" if bare["set_point"] == tuned(law) else "")
            rows.append([f"{rail}: {law}", at, _place(bare, "distance_m"), _place(own, "distance_m"),
                         _place(bare, "energy_kJ"), _place(own, "energy_kJ")])  # fmt: skip
        rows += [
            [f"{rail}: {law}", f"told {t['told_pct']:g} %", "", _place(t, "distance_m"), "", _place(t, "energy_kJ")]
            for t in of["told"]
        ]
    return Table(head, rows)


def _place(point: Mapping[str, Any], key: str) -> str:
    """A median; it is infinite where half of the stops did not end."""
    missing = f", {point['not_stopped']} not stopped" if point["not_stopped"] and key == "distance_m" else ""
    return number(point[key].value, 1) + missing
