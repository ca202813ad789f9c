"""The goals of the score: which of its figures are held to a bound."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from sim_ecu.reporting.values import Figure
from sim_ecu.reporting.verdicts import MIN_QUICK_RUNS, MIN_RUNS, Goal
from sim_ecu.score.metrics.accuracy import OURS
from sim_ecu.score.metrics.map_metrics import ONE, THREE
from sim_ecu.score.suites.broken import (
    ACCELEROMETER_DIES,
    BOTH_DIE,
    DEAD_ACCELEROMETER,
    DEAD_GYRO,
    GYRO_DIES,
    NO_SENSOR,
    REVERSED,
    SWAPPED,
)  # fmt: skip
from sim_ecu.score.suites.map_passages import WET_STRETCH
from sim_ecu.score.suites.nominal import ROUGH_JUDGED
from sim_ecu.score.suites.sound import LONG
from sim_ecu.score.suites.worlds import AS_TRAINED, UNSEEN, WIDER, WORLDS, World

at_most = partial(partial, Goal)
at_least = partial(partial, Goal, at_least=True)
never_above = partial(partial, Goal, never=True)
# How often the estimator's own interval holds the truth, by a world's family: a level on the bus is rounded up, and
# would hold it though the interval does not. There is no upper bound: the width is set for Valid and wrong.
HOLDS: Mapping[str, float] = {AS_TRAINED: 0.87, WIDER: 0.8, UNSEEN: 0.7}
VALID = 0.95  # share of the frames in every world that has goals
LOSSES = 20.0  # of Valid, an axle-hour, where it is as trained
# Share of the frames that are Valid and wrong, by world.
VALID_AND_WRONG: Mapping[str, float] = {
    "its own vehicle": 0.005, "vehicle and sensors off": 0.015, "slopes untied": 0.035, "curves with cant": 0.025,
    "sampled inside, shaken": 0.015, "coasting before a stop": 0.02, "stops by full service": 0.025,
    "all off × 1.5": 0.07, "slopes untied × 1.5": 0.05, "track: china-hs": 0.11, "vibration: wheel flats": 0.03,
}  # fmt: skip
# Where it is as trained, by whether the slopes are tied to the friction.
OF_SLOPES: Mapping[bool, Mapping[str, dict[str, Any]]] = {
    True: {"mean": {"bound": 1.3}, "below_half": {"bound": 1.7}},
    False: {"mean": {"bound": 1.9}, "below_half": {"bound": 2.3}},
}
FIGURES = {
    "mean": "mean error", "below_half": "mean error below half", "own_covers": "its own interval holds the truth",
    "valid_and_wrong": "Valid and wrong, share of frames", "valid": "Valid, share of frames",
    "losses": "losses of Valid an axle-hour",
}  # fmt: skip


def of_world(w: World) -> dict[tuple[str, ...], partial[Goal]]:
    """The goals of a world."""
    path = ("worlds", "rows", w.name, "designs", OURS)
    tied = OF_SLOPES[w.tied] if w.family == AS_TRAINED and w.tied is not None else {}
    wrong = {"valid_and_wrong": {"bound": bound}} if (bound := VALID_AND_WRONG.get(w.name)) is not None else {}
    least = {"own_covers": HOLDS[w.family], "valid": VALID}
    lost = {"losses": {"bound": LOSSES}} if w.family == AS_TRAINED else {}
    bounds = {**tied, **wrong, **lost, **{of: {"bound": bound, "at_least": True} for of, bound in least.items()}}
    return {(*path, of): partial(Goal, f"worlds: {w.name}, {FIGURES[of]}", **ends) for of, ends in bounds.items()}


# By where the figure stands in the result of the suites.
SCORE_GOALS: Mapping[tuple[str, ...], partial[Goal]] = {
    ("paper", "within", "worst"): never_above("paper: worst error over its bound (1 pp, or 10 % if larger)", bound=1.0),
    ("grid", "compared", OURS, "mean"): at_most("grid: mean error", bound=0.88),
    ("grid", "confidence", "covers"): at_least("grid: the interval holds the truth", bound=0.85),
    ("robust", "compared", OURS, "mean"): at_most("robust: mean error", bound=1.25),
    ("robust", "confidence", "covers"): at_least("robust: the interval holds the truth", bound=0.85),
    **{("rough", "groups", n, "accuracy", "mean"): at_most(f"rough: mean error, {n}", bound=1.3) for n in ROUGH_JUDGED},
    **{path: goal for w in WORLDS for path, goal in of_world(w).items()},
    ("transitions", "compared", OURS, "p95"): at_most("transitions: 95th percentile, s", bound=1.0),
    ("drops", "lie", "p95"): at_most("drops: Valid with the truth below the interval, 95th percentile, s", bound=0.4),
    ("drops", "settled", "p95"): at_most("drops: settled, 95th percentile, s", bound=1.2),
    ("long", "rows", LONG, "valid"): at_least("long: Valid, share of frames", bound=0.95),
    ("dead", "groups", BOTH_DIE, "valid_s", "most"): never_above("dead: Valid after both die, longest, s", bound=1.5),
    **{
        (suite, "groups", n, "found"): at_least(f"{suite}: {n}, not Valid after 10 s, share of axles", bound=bound)
        for suite, n, bound in (
            ("dead", BOTH_DIE, 0.99),
            ("dead", GYRO_DIES, 0.9),
            ("dead", ACCELEROMETER_DIES, 0.98),
            ("foreign", REVERSED, 0.98),
            ("foreign", SWAPPED, 0.9),
            ("foreign", DEAD_GYRO, 0.9),
            ("foreign", DEAD_ACCELEROMETER, 0.98),
            ("foreign", NO_SENSOR, 0.99),
        )
    },
    **{
        ("map", "rows", row, family, figure): goal(f"map: {row}, {family}, {words}", bound=bound)
        for row, family, figure, goal, words, bound in (
            (ONE, AS_TRAINED, "found", at_least, "share of low blocks found", 0.9),
            (ONE, UNSEEN, "found", at_least, "share of low blocks found", 0.75),
            (THREE, AS_TRAINED, "found", at_least, "share of low blocks found", 0.97),
            (THREE, UNSEEN, "found", at_least, "share of low blocks found", 0.88),
            *((ONE, family, "alarms", at_most, "false alarms per 100 km", 1.0) for family in (AS_TRAINED, UNSEEN)),
            *(
                (WET_STRETCH.name, family, "alarms", at_most, "false alarms per 100 km", 2.0)
                for family in (AS_TRAINED, UNSEEN)
            ),
        )
    },
    ("dry-hours", "seconds"): never_above("dry-hours: seconds called Low or worse", bound=0.0),
}
ACCUSED = at_most("sound sensors: accused, share of frames", bound=0.001)


def goals(suites: Mapping[str, Any], accused: Figure | None, quick: bool = False) -> list[Goal]:
    """Return the goals of the suites that were played. accused: share of the frames of sound sensors in which one is
    accused; None where none are sound. quick: those of too few runs for a quick score are not judged."""
    found = [*((_figure(suites, path), goal) for path, goal in SCORE_GOALS.items()), (accused, ACCUSED)]
    least = MIN_QUICK_RUNS if quick else MIN_RUNS
    return [goal(figure=figure, min_runs=least) for figure, goal in found if figure is not None]


def _figure(suites: Any, path: tuple[str, ...]) -> Figure | None:
    for key in path:
        if (suites := suites.get(key)) is None:
            return None
    assert isinstance(suites, Figure)
    return suites
