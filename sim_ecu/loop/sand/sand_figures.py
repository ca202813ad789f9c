"""Stops with sand become figures, and a goal. Pure."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim_ecu.loop.sand.sanded_stops import AT_SLIDE, BEARING, BEFORE, NONE, RAILS, SLIPPERY, WHEN_LOW, WHO, DrivenStops
from sim_ecu.reporting.values import Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score.metrics import bootstrap

AGAIN = 0.5  # of what sand at the slide saves, sand before it is to save again
Stops = Sequence[DrivenStops]


@dataclass(frozen=True, slots=True)
class SandFigures:
    """Of a policy on a rail; means of stops, with intervals. saved_m: metres less than without sand. sanded: share of
    the stops in which sand came."""

    metres: Figure
    saved_m: Figure
    kg: Figure
    sanded: Figure


def sand_figures(every: Stops, who: str) -> SandFigures:
    """The figures of a policy in some stops, one at least."""
    seeds = np.array([d.seed for d in every], np.int64)
    metres, bare = _metres(every, who), _metres(every, NONE)
    kg = np.array([d.stops[who].kg for d in every])
    return SandFigures(
        bootstrap.mean(metres, seeds), bootstrap.mean(bare - metres, seeds), bootstrap.mean(kg, seeds),
        bootstrap.share(kg > 0.0, seeds),
    )  # fmt: skip


def saved_again(every: Stops, who: str) -> Figure:
    """Metres that a policy stops shorter than AT_SLIDE, by those that this stops shorter than without sand."""
    seeds = np.array([d.seed for d in every], np.int64)
    at_slide = _metres(every, AT_SLIDE)
    return bootstrap.ratio(at_slide - _metres(every, who), seeds, _metres(every, NONE) - at_slide, seeds)


def _most(slippery: Stops, bears: Stops) -> float:
    """The share that a rail would save again that bears the demand: the most that any sand can; NaN where sand at the
    slide saves nothing."""
    bare, at_slide = (float(_metres(slippery, who).mean()) for who in (NONE, AT_SLIDE))
    if bare == at_slide:
        return math.nan
    return (at_slide - float(_metres(bears, NONE).mean())) / (bare - at_slide)


def _metres(every: Stops, who: str) -> np.ndarray:
    return np.array([d.stops[who].metres for d in every])


def judge_all(every: Stops) -> dict[str, Any]:
    """All figures: leaves are SandFigures, Figures, numbers and words."""
    of = {rail: [d for d in every if d.rail == rail] for rail in RAILS}
    groups = {rail: stops for rail, stops in of.items() if stops}
    bears, slippery = ([d for d in every if d.rail in rails] for rails in (BEARING, SLIPPERY))
    if bears:
        groups["false sand"] = bears
    again = {who: saved_again(slippery, who) for who in (WHEN_LOW, BEFORE)}
    earlier = [d.stops[AT_SLIDE].first_s - d.stops[WHEN_LOW].first_s for d in slippery]
    known = [s for s in earlier if math.isfinite(s)]
    ahead = [d.stops[BEFORE].first_s < 0.0 for d in slippery]
    goal = Goal(
        f"share of what sand at the slide saves that {WHEN_LOW} saves again", again[WHEN_LOW], AGAIN, at_least=True,
        min_runs=bootstrap.FEWEST,
    )  # fmt: skip
    return {
        "rails": {name: {who: sand_figures(stops, who) for who in WHO} for name, stops in groups.items()},
        "again": again,
        "most": _most(slippery, bears) if slippery and bears else math.nan,
        "earlier_s": float(np.mean(known)) if known else math.nan,
        "ahead": float(np.mean(ahead)) if ahead else math.nan,
        "goals": [goal.record()],
        "stops": [{"rail": d.rail, "seed": d.seed, "policies": dict(d.stops)} for d in every],
    }
