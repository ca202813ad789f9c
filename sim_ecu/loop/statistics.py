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
KEYS = ("slides", "locked_s", "max_slip_m_s", "slip_energy_kJ", "utilisation", "stop_m", "impulse_kNs")
ENDS = (0.05, 0.95)
MIXES = np.linspace(0.0, 1.0, 101)  # of two bare controllers, along the line between them
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
    """A controller with wrcd over the same one without, on the same runs.

    way: stopping distance, or impulse where the train pulls: median of the runs' ratios; worst: the run's that loses
    most. energy: median of the ratios of slip energy. slides: all slides over all slides; before, now: a run's mean.
    """

    way: Figure
    worst: float
    worst_number: int
    energy: Figure
    slides: Figure
    slides_before: float
    slides_now: float


def spread(values: Sequence[float]) -> Spread:
    """Of the values that are numbers."""
    known = np.array([v for v in values if not math.isnan(v)], np.float64)
    if not len(known):
        return Spread(math.nan, math.nan, math.nan, 0)
    low, high = np.quantile(known, ENDS)
    return Spread(float(np.median(known)), float(low), float(high), len(known))


def spreads(runs: Runs) -> dict[str, Spread]:
    """By the figure's name."""
    return {key: spread([float(getattr(f, key)) for f in runs.values()]) for key in KEYS}


def ways(runs: Runs, braking: bool) -> FloatArray:
    """Stopping distances (m), or impulses (kN s)."""
    return np.array([f.stop_m if braking else f.impulse_kNs for f in runs.values()], np.float64)


def against(with_wrcd: Runs, bare: Runs, braking: bool) -> Against:
    """Pair the runs by their numbers."""
    numbers = [n for n in bare if n in with_wrcd]
    new, old = {n: with_wrcd[n] for n in numbers}, {n: bare[n] for n in numbers}
    at = np.array(numbers, np.int64)
    ratio = ways(new, braking) / ways(old, braking)
    loss = ratio if braking else 1.0 / ratio
    worst = int(np.argmax(loss))
    energy = np.array([new[n].slip_energy_kJ / max(old[n].slip_energy_kJ, 1e-9) for n in numbers])
    slid_new, slid_old = (np.array([float(f.slides) for f in x.values()]) for x in (new, old))
    return Against(
        way=median(ratio, at),
        worst=float(ratio[worst]),
        worst_number=numbers[worst],
        energy=median(energy, at),
        slides=of_slides(slid_new, slid_old, at),
        slides_before=float(slid_old.mean()),
        slides_now=float(slid_new.mean()),
    )


def median(values: FloatArray, runs: NDArray[np.int64]) -> Figure:
    """With the 90 % interval from drawing runs again; the mean of the two in the middle of an even number."""
    drawn = values[again(len(values))]
    draws = bootstrap.Draws(runs)
    return draws.figure(float(np.median(values)), np.median(drawn, axis=1), len(values))


def of_slides(new: FloatArray, old: FloatArray, runs: NDArray[np.int64]) -> Figure:
    """Slides over slides. Where there were none before, one is too many: infinite; none is 0."""
    if not old.any():
        return bootstrap.exact(math.inf if new.any() else 0.0, len(runs), len(runs))
    return bootstrap.ratio(new, runs, old, runs)


def again(n: int) -> NDArray[np.int64]:
    """Places of n runs, drawn again: (replicates, n)."""
    return np.random.default_rng(bootstrap.SEED).integers(0, n, (bootstrap.REPLICATES, n))


def front(runs: Mapping[str, Runs], braking: bool) -> Figure:
    """How far the controllers with wrcd lie on or below the front of the bare ones, in the plane of slip energy and
    distance (where the train pulls: one over impulse), each by the medians of its runs.

    For each with wrcd: the least factor by which some mix of the bare ones is worse in one of the two. Below 1, that
    mix is better in both. The figure is the smaller one's.
    """
    numbers = sorted(set.intersection(*(set(r) for r in runs.values())))
    if not numbers:
        return bootstrap.NOTHING
    places = np.vstack((np.arange(len(numbers)), again(len(numbers))))
    energy, cost = {}, {}
    for name, r in runs.items():
        part = {n: r[n] for n in numbers}
        way = ways(part, braking)
        energy[name] = np.median(np.array([f.slip_energy_kJ for f in part.values()])[places], axis=1)
        cost[name] = np.median((way if braking else 1.0 / way)[places], axis=1)
    mixed = [
        np.outer(of[LAWS[0]], 1 - MIXES) + np.outer(of[LAWS[1]], MIXES) for of in (energy, cost)
    ]  # (replicates, mixes) of slip energy and of cost
    factors = [
        np.maximum(mixed[0] / energy[WITH[law]][:, None], mixed[1] / cost[WITH[law]][:, None]).min(axis=1)
        for law in LAWS
    ]
    least = np.minimum(*factors)
    draws = bootstrap.Draws(np.array(numbers, np.int64))
    return draws.figure(float(least[0]), least[1:], len(numbers))
