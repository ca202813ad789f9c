"""Rides become figures: spreads of each controller, each beside the same controller without wrcd, and goals. Pure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop import BARE_AND_WITH, CREEP, IDEAL, LAWS, THRESHOLDS, WITH
from sim_ecu.loop.loop_rides import RideResult
from sim_ecu.loop.ride_figures import Figures
from sim_ecu.loop.suites.rails import GREASY_STOP, WET_STOP
from sim_ecu.loop.suites.rides import FEW_SEEDS, FIRST_TEST_SEED, LoopCase
from sim_ecu.reporting.values import Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score.metrics import bootstrap

FloatArray = NDArray[np.float64]
KEYS = tuple(f.name for f in fields(Figures) if f.name not in ("seconds", "stopped"))
ENDS = (0.05, 0.95)
MIXES = np.linspace(0.0, 1.0, 101)  # of the two controllers with wrcd, along the line between them
MIN_ENERGY_KJ = 1e-9  # so that a ratio is a number
# Of a run, beyond the peak, without wrcd: less is taken for so much, for a ratio to next to nothing means nothing.
MIN_BEYOND_S, MIN_BEYOND_KJ = 0.1, 0.1
Runs = Mapping[int, Figures]  # by number


@dataclass(frozen=True, slots=True)
class Spread:
    """Median, and the range from the 5th to the 95th percentile; NaN of no runs."""

    median: float
    low: float
    high: float
    runs: int


@dataclass(frozen=True, slots=True)
class Against:
    """A controller over another one on the same runs: with wrcd over without, or the ideal over without.

    A stop that did not end is infinitely long and wears without end. Where the other one's did not end there is nothing
    to compare with: `left_out` counts these runs, and nothing but what lies beyond the peak is of them. endless: of the
    rest, the stops that the first did not end.

    way: stopping distance, or impulse where the train pulls: median of the runs' ratios; worst: the run's that loses
    most, NaN and no number where all are left out. energy: median of the ratios of slip energy. beyond_time,
    beyond_energy: what all runs have beyond the peak's creep over what they had; before, now: a run's mean.
    """

    way: Figure
    worst: float
    worst_number: int | None
    energy: Figure
    beyond_time: Figure
    beyond_energy: Figure
    beyond_s_before: float
    beyond_s_now: float
    endless: int
    left_out: int


def spread(values: Sequence[float]) -> Spread:
    """Return the spread of the values that are numbers."""
    known = np.array([v for v in values if not math.isnan(v)], np.float64)
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, 0)
    low, high = np.quantile(known, ENDS)
    return Spread(float(np.median(known)), float(low), float(high), len(known))


def spreads(runs: Runs) -> dict[str, Spread]:
    """By the figure's name. A stop's distance is of the runs that stopped: the others have none."""
    found = {key: [float(getattr(f, key)) for f in runs.values()] for key in KEYS}
    found["stop_m"] = [f.stop_m for f in runs.values() if f.stopped]
    return {key: spread(values) for key, values in found.items()}


def ways(runs: Runs, braking: bool) -> FloatArray:
    """Stopping distances (m), infinite of a stop that did not end; or impulses (kN s)."""
    return np.array(
        [(f.stop_m if f.stopped else math.inf) if braking else f.impulse_kNs for f in runs.values()], np.float64
    )


def energies(runs: Runs, braking: bool) -> FloatArray:
    """Slip energies (kJ), infinite of a stop that did not end: it is not all spent."""
    return np.array([math.inf if braking and not f.stopped else f.slip_energy_kJ for f in runs.values()], np.float64)


def against(new: Runs, old: Runs, braking: bool) -> Against:
    """Pair the runs by their numbers."""
    both = [n for n in old if n in new]
    s_new, s_old, kJ_new, kJ_old = (
        np.array([getattr(x[n], key) for n in both]) for key in ("beyond_s", "beyond_kJ") for x in (new, old)
    )
    every = np.array(both, np.int64)
    numbers = [n for n in both if old[n].stopped or not braking]
    new, old = {n: new[n] for n in numbers}, {n: old[n] for n in numbers}
    ratio = ways(new, braking) / ways(old, braking)
    loss = ratio if braking else 1.0 / ratio
    worst = int(np.argmax(loss)) if numbers else None
    return Against(
        way=bootstrap.median(ratio),
        worst=math.nan if worst is None else float(ratio[worst]),
        worst_number=None if worst is None else numbers[worst],
        energy=bootstrap.median(energies(new, braking) / np.maximum(energies(old, braking), MIN_ENERGY_KJ)),
        beyond_time=bootstrap.ratio(s_new, every, np.maximum(s_old, MIN_BEYOND_S), every),
        beyond_energy=bootstrap.ratio(kJ_new, every, np.maximum(kJ_old, MIN_BEYOND_KJ), every),
        beyond_s_before=float(s_old.mean()),
        beyond_s_now=float(s_new.mean()),
        endless=sum(braking and not f.stopped for f in new.values()),
        left_out=len(both) - len(numbers),
    )


def front(runs: Mapping[str, Runs], braking: bool) -> Figure:
    """Whether the front of the controllers with wrcd lies on or below both bare ones, in the plane of slip energy and
    distance (where the train pulls: one over impulse), each by the medians of its runs.

    For each bare one: the largest factor by which some mix of the two with wrcd is better in both, below 1 where each
    is worse in one of them. The figure is the lesser of the two. Runs that a bare one does not stop are left out.
    """
    every = set.intersection(*(set(r) for r in runs.values()))
    numbers = sorted(n for n in every if not braking or all(runs[law][n].stopped for law in LAWS))
    if not numbers:
        return bootstrap.NOTHING
    n = len(numbers)
    drawn = np.random.default_rng(bootstrap.SEED).integers(0, n, (bootstrap.REPLICATES, n))
    places = np.vstack((np.arange(n), drawn))
    energy, cost = {}, {}
    for name, r in runs.items():
        part = {n: r[n] for n in numbers}
        way = ways(part, braking)
        energy[name] = np.maximum(np.median(energies(part, braking)[places], axis=1), MIN_ENERGY_KJ)
        cost[name] = np.median((way if braking else 1.0 / way)[places], axis=1)
    mixed = [_mixes(*(of[WITH[law]] for law in LAWS)) for of in (energy, cost)]
    factors = [np.minimum(energy[law][:, None] / mixed[0], cost[law][:, None] / mixed[1]).max(axis=1) for law in LAWS]
    least = np.minimum(*factors)
    return _interval(float(least[0]), least[1:], n)


def _interval(value: float, replicates: FloatArray, runs: int) -> Figure:
    """The replicates' ends, each one of them: between an infinite one and another there is nothing."""
    if runs < 2:
        return Figure(value, math.nan, math.nan, runs, runs)
    ordered = np.sort(replicates)
    low, high = (float(ordered[max(math.ceil(q * len(ordered)), 1) - 1]) for q in bootstrap.further_out(runs))
    return Figure(value, low, high, runs, runs)


def _mixes(one: FloatArray, other: FloatArray) -> FloatArray:
    """Along the line from one to the other: (replicates, mixes). What is infinite is so in every mix."""
    with np.errstate(invalid="ignore"):
        out = np.outer(one, 1 - MIXES) + np.outer(other, MIXES)
    out[:, 0], out[:, -1] = one, other
    return np.asarray(out, np.float64)


MAX_BEYOND, MAX_ENERGY, MAX_SHORTER, MAX_LONGER = 0.2, 0.5, 0.9, 1.03
MIN_RUNS = FEW_SEEDS  # of every case: a figure of fewer pairs judges nothing
RAILS = ("braking", "traction", "train")  # suites that differ in nothing but the rail
Rides = Mapping[tuple[str, str], Mapping[str, Runs]]  # by suite and case, by controller


def goals(cases: Sequence[LoopCase], rides: Rides, suites: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what wrcd is held to in the suites that were played, with verdicts; every other figure has none.

    ideal: what the ideal reaches over the same controller without wrcd, on the same runs; None where not known.
    """
    every = [c for c in cases if suites[c.suite][c.name]["against"]]
    rails = [c for c in every if c.suite in RAILS]
    known, stops = [c for c in rails if c.known_before], [c for c in every if c.braking]
    slippery = [c for c in rails if c.name in (WET_STOP, GREASY_STOP)]
    out: list[dict[str, Any]] = []

    def add(
        what: str, figure: Figure, bound: float, of: int = 1, ideal: float | None = None, at_least: bool = False,
        never: bool = False,
    ) -> None:  # fmt: skip
        out.append(Goal(what, figure, bound, at_least, MIN_RUNS * of, never).record() | {"ideal": ideal})

    def pooled(some: Sequence[LoopCase], what: str, law: str, key: str, bound: float) -> None:
        """All runs of some cases together."""
        if not some:
            return
        bare = _pool(some, rides, law)
        ideal = _pool(some, rides, IDEAL)
        braking = all(c.braking for c in some)
        reached = getattr(against(ideal, bare, braking), key).value if len(ideal) == len(bare) else None
        new = getattr(against(_pool(some, rides, WITH[law]), bare, braking), key)
        add(f"{what}: {law}, {WHAT[key]} over that without", new, bound, len(some), reached)

    for law in LAWS:
        pooled(known, "rails known before", law, "beyond_time", MAX_BEYOND)
    pooled(slippery, "stops on wet and greasy rails known before", THRESHOLDS, "way", MAX_SHORTER)
    pooled([c for c in known if c.braking], "stops on rails known before", CREEP, "energy", MAX_ENERGY)
    fronts = {(c.suite, c.name): suites[c.suite][c.name]["front"] for c in rails}
    if fronts:
        suite, name = min(fronts, key=lambda n: fronts[n].value)
        what = "rails: front, least factor by which it is better than each bare controller, the worst row"
        add(f"{what} ({suite}: {name})", fronts[suite, name], 1.0, at_least=True)
    for law in LAWS:
        found = {(c.suite, c.name): suites[c.suite][c.name]["against"][law] for c in stops}
        found = {k: a for k, a in found.items() if not math.isnan(a.worst)}
        if found:
            suite, name = max(found, key=lambda k: found[k].way.value)
            what = f"stops: {law}, distance over that without, median of the worst row ({suite}: {name})"
            add(what, found[suite, name].way, MAX_LONGER)
            suite, name = max(found, key=lambda k: found[k].worst)
            a = found[suite, name]
            seed = FIRST_TEST_SEED + (a.worst_number or 0)
            what = f"stops: {law}, distance over that without, the worst of all runs ({suite}: {name}, seed {seed})"
            # it happened: no interval excuses it; too few to judge where its own case is
            runs = sum(x.way.runs for x in found.values())
            add(what, Figure(a.worst, math.nan, math.nan, a.way.runs, runs), MAX_LONGER, never=True)
    return out


WHAT = {"beyond_time": "time beyond the peak", "way": "distance", "energy": "slip energy"}


def _pool(cases: Sequence[LoopCase], rides: Rides, controller: str) -> Runs:
    """The runs of some cases, numbered through; none of a case that has not this controller."""
    every = [rides[c.suite, c.name].get(controller, {}) for c in cases]
    return dict(enumerate(run[n] for run in every for n in sorted(run)))


Found = Mapping[str, Mapping[int, RideResult]]  # by controller and number


def judge_all(cases: Sequence[LoopCase], outcomes: Sequence[RideResult]) -> dict[str, Any]:
    """All figures: leaves are Spreads, Figures, numbers and words."""
    found: dict[tuple[str, str], dict[str, dict[int, RideResult]]] = {}
    for o in outcomes:
        found.setdefault((o.suite, o.case), {}).setdefault(o.controller, {})[o.number] = o
    suites: dict[str, Any] = {}
    rides: dict[tuple[str, str], Mapping[str, Runs]] = {}
    for case in cases:
        bare = found.get((case.suite, case.bare), {}) if case.bare else {}
        own = {**{k: v for k, v in bare.items() if k not in case.controllers}, **found[case.suite, case.name]}
        runs = {name: {n: o.figures for n, o in part.items()} for name, part in own.items()}
        rides[case.suite, case.name] = runs
        suites.setdefault(case.suite, {})[case.name] = _case(case, own, runs)
    return {
        "suites": suites,
        "goals": goals(cases, rides, suites),
        "wrong": [
            _place(o) | {"axle": h.axle, "outside_s": h.outside_s, "over_s": h.over_s}
            for o in outcomes for h in o.honesty if h.wrong
        ],
        "runs": [_place(o) | asdict(o.figures) | {"said": [asdict(h) for h in o.honesty]} for o in outcomes],
    }  # fmt: skip


def _case(case: LoopCase, found: Found, runs: Mapping[str, Runs]) -> dict[str, Any]:
    braking = case.braking
    whole = all(name in runs for name in BARE_AND_WITH)
    return {
        "braking": braking,
        "known_before": case.known_before,
        "axles": case.axles,
        "controllers": {
            name: {"runs": len(r), "not_stopped": sum(braking and not f.stopped for f in r.values())} | spreads(r)
            for name, r in runs.items()
        },
        "against": {law: against(runs[WITH[law]], runs[law], braking) for law in LAWS if whole},
        "ideal": {law: against(runs[IDEAL], runs[law], braking) for law in LAWS if whole and IDEAL in runs},
        "front": front({name: runs[name] for name in BARE_AND_WITH}, braking) if whole else None,
        "said": {law: _honesty(list(found[WITH[law]].values())) for law in LAWS if WITH[law] in found},
    }


def _honesty(outcomes: Sequence[RideResult]) -> dict[str, float]:
    """How honest a daemon was; of rows without one, nothing."""
    every = [h for o in outcomes for h in o.honesty]
    if not every:
        return {"valid": math.nan, "outside": math.nan, "outside_s": 0.0, "wrong_runs": 0, "runs": len(outcomes)}
    return {
        "valid": float(np.mean([h.valid for h in every])),
        "outside": float(np.mean([h.outside for h in every])),
        "outside_s": max(h.outside_s for h in every),
        "wrong_runs": sum(any(h.wrong for h in o.honesty) for o in outcomes),
        "runs": len(outcomes),
    }


def _place(o: RideResult) -> dict[str, Any]:
    return {"suite": o.suite, "case": o.case, "controller": o.controller, "seed": FIRST_TEST_SEED + o.number}
