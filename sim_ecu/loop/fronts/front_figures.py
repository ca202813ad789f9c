"""Fronts in the plane of slip energy and stopping distance, and one over another: at equal distance, at equal energy.

A front's points are medians over the runs, one for each set point. Runs are drawn again for the intervals, the same
ones for both fronts: their stops differ in nothing but the controller.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop import LAWS, WITH
from sim_ecu.loop.comparison_figures import Runs, energies, ways
from sim_ecu.loop.fronts.front_rides import SET_POINTS, TOLD_PCT, FrontRide
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting.values import Figure
from sim_ecu.score.metrics import bootstrap

FloatArray = NDArray[np.float64]
DISTANCE, ENERGY = 0, 1  # columns of a point
GRID = 25  # places along what is compared of a front
Range = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FrontRatio:
    """One front over another, along the distances or energies of the one that the other reaches too.

    mean: geometric, over evenly spaced places; NaN where the other reaches none. at, ratio, low, high: place by place.
    one, other: the range of each (m or kJ; NaN: it has no point).
    """

    mean: Figure
    at: tuple[float, ...]
    ratio: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    one: Range
    other: Range


@dataclass(frozen=True, slots=True)
class FrontComparison:
    """One front over another. energy: at equal distance; distance: at equal energy."""

    energy: FrontRatio
    distance: FrontRatio


def envelope(points: FloatArray) -> FloatArray:
    """Return the points (m, 2) of points (n, 2) that no other one betters in both distance and energy, by distance.
    Points that are infinite are none: a stop that did not end."""
    found = points[np.isfinite(points).all(axis=1)]
    found = found[np.lexsort((found[:, ENERGY], found[:, DISTANCE]))]
    least = np.minimum.accumulate(found[:, ENERGY])
    better = np.concatenate((np.ones(min(len(found), 1), bool), least[1:] < least[:-1]))
    return np.asarray(found[better], np.float64)


def read_off(front: FloatArray, at: FloatArray, of: int) -> FloatArray:
    """Return an envelope's least energy within distances, or its least distance within energies (of: which is given):
    on the lines between its points, and at the last one's beyond it. Before the first there is none."""
    ordered = front[np.argsort(front[:, of])]
    return np.asarray(np.interp(at, ordered[:, of], ordered[:, 1 - of]), np.float64)


def reach(front: FloatArray, of: int) -> Range:
    """Return an envelope's ends in distance or energy; NaN where it has no point."""
    return (float(front[:, of].min()), float(front[:, of].max())) if len(front) else (float("nan"), float("nan"))


def ratios(one: FloatArray, other: FloatArray, of: int) -> tuple[FloatArray, FloatArray]:
    """Return the places (GRID,) of one envelope that another reaches too, and the ratios of their other values there;
    NaN if there is none."""
    (first, last), least = reach(one, of), reach(other, of)[0]
    low, high = max(first, least), last
    if not low <= high or np.isnan(least):
        return np.full(GRID, np.nan), np.full(GRID, np.nan)
    at = np.linspace(low, high, GRID)
    return at, read_off(one, at, of) / read_off(other, at, of)


def compare(one: FloatArray, other: FloatArray) -> FrontComparison:
    """Compare two fronts: distances and energies (set points, runs, 2) of the same runs."""
    n = one.shape[1]
    draws = bootstrap.Draws(np.arange(n))
    places = [np.arange(n), *(np.repeat(np.arange(n), times.astype(np.int64)) for times in draws.times)]
    fronts = [(envelope(np.median(one[:, p], axis=1)), envelope(np.median(other[:, p], axis=1))) for p in places]
    found = []
    for of in (DISTANCE, ENERGY):
        at, _ = ratios(*fronts[0], of)
        every = np.array([ratios(a, b, of)[1] for a, b in fronts])
        with np.errstate(invalid="ignore"):
            means = np.exp(np.log(every).mean(axis=1))
        each = [draws.figure(float(every[0, k]), every[1:, k], n) for k in range(GRID)]
        found.append(FrontRatio(
            draws.figure(float(means[0]), means[1:], n), tuple(at.tolist()), tuple(f.value for f in each),
            tuple(f.low for f in each), tuple(f.high for f in each), *(reach(front, of) for front in fronts[0]),
        ))  # fmt: skip
    return FrontComparison(*found)


def judge_all(rides: Sequence[FrontRide]) -> dict[str, Any]:
    """Return all figures of the rails that were driven: leaves are Figures, numbers and words."""
    found: dict[tuple[str, str, str, float, float | None], dict[int, Any]] = {}
    for r in rides:
        found.setdefault((r.rail, r.law, r.controller, r.set_point, r.told_pct), {})[r.number] = r.figures
    rails = dict.fromkeys(r.rail for r in rides)
    return {
        "fronts": {rail: {law: _law(found, rail, law) for law in LAWS} for rail in rails},
        "runs": [
            {"rail": r.rail, "controller": r.controller, "set_point": r.set_point, "told_pct": r.told_pct,
             "seed": FIRST_TEST_SEED + r.number} | asdict(r.figures) for r in rides
        ],
    }  # fmt: skip


def _law(found: Mapping[tuple[str, str, str, float, float | None], Runs], rail: str, law: str) -> dict[str, Any]:
    fronts = {
        c: {x: found[rail, law, c, x, None] for x in SET_POINTS[law]} for c in (law, WITH[law])
    }  # fmt: skip
    told = {pct: runs for (r, of, _, _, pct), runs in found.items() if (r, of) == (rail, law) and pct in TOLD_PCT}
    bare, own = (_plane(list(of.values())) for of in fronts.values())
    return {
        "points": {c: [{"set_point": x} | _point(runs) for x, runs in of.items()] for c, of in fronts.items()},
        "with_over_bare": compare(own, bare),
        "told": [
            {"told_pct": pct, "over_bare": compare(_plane([runs]), bare)} | _point(runs) for pct, runs in told.items()
        ],
    }


def _plane(of: Sequence[Runs]) -> FloatArray:
    """Distances (m) and slip energies (kJ): (set points, runs, 2)."""
    return np.array([np.stack((ways(runs, True), energies(runs, True)), axis=1) for runs in of])


def _point(runs: Runs) -> dict[str, Any]:
    return {
        "distance_m": bootstrap.median(ways(runs, True)),
        "energy_kJ": bootstrap.median(energies(runs, True)),
        "not_stopped": sum(not f.stopped for f in runs.values()),
    }
