"""Runs become figures: spreads of each controller, and each beside the same controller without wrcd. Pure."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.judge import Figures
from sim_ecu.loop.names import LAWS, WITH
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.bootstrap import Figure

FloatArray = NDArray[np.float64]
KEYS = (
    "slides", "beyond_s", "locked_s", "max_slip_m_s", "slip_energy_kJ", "beyond_kJ", "utilisation", "stop_m",
    "impulse_kNs",
)  # fmt: skip
ENDS = (0.05, 0.95)
MIXES = np.linspace(0.0, 1.0, 101)  # of the two controllers with wrcd, along the line between them
MIN_ENERGY_KJ = 1e-9  # so that a ratio is a number
# Of a run, beyond the peak, without wrcd: less is taken for so much, for a ratio to next to nothing tells nothing.
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
    """Of the values that are numbers."""
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


def again(n: int) -> NDArray[np.int64]:
    """Places of n runs, drawn again: (replicates, n)."""
    return np.random.default_rng(bootstrap.SEED).integers(0, n, (bootstrap.REPLICATES, n))


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
    places = np.vstack((np.arange(len(numbers)), again(len(numbers))))
    energy, cost = {}, {}
    for name, r in runs.items():
        part = {n: r[n] for n in numbers}
        way = ways(part, braking)
        energy[name] = np.maximum(np.median(energies(part, braking)[places], axis=1), MIN_ENERGY_KJ)
        cost[name] = np.median((way if braking else 1.0 / way)[places], axis=1)
    mixed = [_mixes(*(of[WITH[law]] for law in LAWS)) for of in (energy, cost)]
    factors = [np.minimum(energy[law][:, None] / mixed[0], cost[law][:, None] / mixed[1]).max(axis=1) for law in LAWS]
    least = np.minimum(*factors)
    return _interval(float(least[0]), least[1:], len(numbers))


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
