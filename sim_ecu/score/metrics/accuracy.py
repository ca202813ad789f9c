"""How far the estimates are off, in percentage points of MuAvailable, and whether the words beside them are right."""

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.bootstrap import Figure
from sim_ecu.score.metrics.frames import OURS, Frames
from sim_ecu.score.play import Trace
from wrcd.core.messages import surface
from wrcd.core.vocabulary import SURFACES

BINS = (0.0, 0.3, 0.5, 0.7, 0.9, math.inf)  # of utilisation
UNSURE = (0.85, 1.0)  # utilisations between which a contact may be called either
SATURATED = 0.98  # utilisation from which a contact is saturated for certain
REACHED = 0.95  # of the wanted creep
SETTLED_S = 1.0


def judged(f: Frames, name: str) -> NDArray[np.bool_]:
    """The frames that an estimator is judged on: wrcd's Valid ones, the same for every baseline."""
    return np.asarray(f.valid & np.isfinite(f.errors(name)))


def accuracy(f: Frames, name: str) -> dict[str, Figure]:
    """Mean and 95th percentile of the error, its mean below half and above 0.9 of the available adhesion."""
    error, u, use = f.errors(name), f.utilisation, judged(f, name)

    def mean(where: NDArray[np.bool_]) -> Figure:
        return bootstrap.mean(error[where], f.run[where])

    return {
        "mean": mean(use),
        "p95": bootstrap.quantile(error[use], f.run[use], 0.95),
        "below_half": mean(use & (u < 0.5)),
        "above_0.9": mean(use & (u > 0.9)),
    }


def over(f: Frames, of: Frames, name: str = OURS) -> dict[str, Figure]:
    """The mean error as a multiple of that in other frames, and less it; runs of the same number are paired."""
    a, b = judged(f, name), judged(of, name)
    parts = f.errors(name)[a], f.run[a], of.errors(name)[b], of.run[b]
    return {"ratio": bootstrap.ratio(*parts), "difference": bootstrap.difference(*parts)}


def over_baseline(f: Frames, name: str) -> Figure:
    """wrcd's mean error over that of a baseline on the same frames."""
    use = judged(f, OURS) & judged(f, name)
    return bootstrap.ratio(f.errors(OURS)[use], f.run[use], f.errors(name)[use], f.run[use])


def by_class(f: Frames) -> dict[str, dict[str, Figure]]:
    """Mean error of wrcd by utilisation and by curve."""
    error, u, use = f.errors(OURS), f.utilisation, judged(f, OURS)
    classes: dict[str, dict[str, NDArray[np.bool_]]] = {"utilisation": {}, "curve": {}}
    for lo, hi in itertools.pairwise(BINS):
        classes["utilisation"][f"{lo:g}–{hi:g}" if hi < math.inf else f"{lo:g} up"] = (u >= lo) & (u < hi)
    for curve in sorted(set(f.curve.tolist())):
        classes["curve"][curve] = f.curve == curve
    return {
        kind: {name: bootstrap.mean(error[use & at], f.run[use & at]) for name, at in members.items()}
        for kind, members in classes.items()
    }


def contact_right(f: Frames) -> dict[str, Figure]:
    """ContactState where it can be told: adhering well below the peak, saturated beyond it."""
    u = f.utilisation
    adhering = f.valid & (u < UNSURE[0]) & ~f.past_peak
    # past the peak the adhesion in use falls again: outside 0.85 … 1 that is saturated, too
    saturated = f.valid & ((u < UNSURE[0]) | (u > UNSURE[1])) & f.past_peak
    right = (adhering & (f.contact == "Adhering")) | (saturated & (f.contact == "Saturated"))
    certain = f.valid & (u >= SATURATED)

    def mean(hits: NDArray[np.bool_], where: NDArray[np.bool_]) -> Figure:
        return bootstrap.mean(hits[where], f.run[where])

    return {
        "right": mean(right, adhering | saturated),
        "adhering_right": mean(f.contact == "Adhering", adhering),
        "saturated_right": mean(f.contact == "Saturated", certain),
    }


def surfaces(f: Frames) -> dict[str, dict[str, float]]:
    """Share of each true surface's Valid frames that was called what: {true: {said: share}}."""
    true = np.array([surface(float(m)) for m in f.true])
    names = [name for _, name in SURFACES]
    return {
        t: {s: float(np.mean(f.surface[f.valid & (true == t)] == s)) for s in names}
        for t in names
        if (f.valid & (true == t)).any()
    }


def judged_from_reached(t: Trace) -> float:
    """A second after the creep came to its peak."""
    reached = np.flatnonzero(np.abs(t.true_slip) >= REACHED * t.peak_slip)
    return float(t.time_s[reached[0]]) + SETTLED_S if len(reached) else math.inf


def within(f: Frames) -> dict[str, Any]:
    """Share of frames within 1 percentage point, or 10 % of the value if larger, and the worst error over that."""
    error, allowed = f.errors(OURS), np.maximum(1.0, 0.1 * f.true)
    ratio = np.where(f.valid & np.isfinite(error), error / allowed, np.inf)
    return {
        "share": bootstrap.mean(ratio <= 1.0, f.run),
        "worst": bootstrap.largest(ratio, f.run) if len(ratio) else bootstrap.exact(math.inf, 0, 0),
    }
