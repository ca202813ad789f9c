"""How far the estimates are off, in percentage points of MuAvailable, and whether the words beside them are right."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.reporting.values import Figure
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.score_play import FloatArray, Trace
from wrcd.core.reports import surface
from wrcd.core.vocabulary import SURFACES

OURS = "wrcd"
VALID = "Valid"


@dataclass(frozen=True, slots=True)
class JudgedFrames:
    """Arrays (frames,) of the frames from when they are judged on, those that are not Valid included."""

    mu: dict[str, FloatArray]  # of wrcd and of every baseline; NaN where there is no estimate
    true: FloatArray
    used: FloatArray
    past_peak: NDArray[np.bool_]
    half_width: FloatArray  # of the level on the bus; inf for none claimed
    own_half_width: FloatArray  # before the bus made it a level
    validity: NDArray[np.str_]
    cause: NDArray[np.str_]
    contact: NDArray[np.str_]
    surface: NDArray[np.str_]
    curve: NDArray[np.str_]
    run: NDArray[np.int64]

    @property
    def utilisation(self) -> FloatArray:
        """Adhesion in use over adhesion available."""
        return np.asarray(self.used / self.true)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where a controller may go by what wrcd says."""
        return np.asarray(self.validity == VALID)

    def errors(self, name: str) -> FloatArray:
        """Absolute errors in percentage points, NaN where there is no estimate."""
        return np.asarray(np.abs(self.mu[name] - self.true))

    @property
    def outside(self) -> NDArray[np.bool_]:
        """Where the truth lies outside wrcd's interval. A Valid frame without a number lies outside any."""
        return np.asarray(~(self.errors(OURS) <= self.half_width))


def gather(traces: Sequence[Trace]) -> JudgedFrames:
    """All frames from when they are judged on."""
    names = list(dict.fromkeys([OURS, *(n for t in traces for n in t.baselines)]))
    keep = [t.time_s >= t.judged_from_s for t in traces]

    def join(parts: list[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([p[k] for p, k in zip(parts, keep, strict=True)]) if parts else np.zeros(0)

    return JudgedFrames(
        mu={n: join([estimates(t, n) for t in traces]) for n in names},
        true=join([t.true_mu_pct for t in traces]),
        used=join([t.true_used_pct for t in traces]),
        past_peak=join([np.abs(t.true_slip) > t.peak_slip for t in traces]).astype(bool),
        half_width=join([t.half_width_pp for t in traces]),
        own_half_width=join([t.own_half_width_pp for t in traces]),
        validity=join([t.validity for t in traces]).astype(np.str_),
        cause=join([t.cause for t in traces]).astype(np.str_),
        contact=join([t.contact for t in traces]),
        surface=join([t.surface for t in traces]),
        curve=join([np.full(len(t.time_s), t.curve) for t in traces]),
        run=join([np.full(len(t.time_s), t.run) for t in traces]).astype(np.int64),
    )


def estimates(t: Trace, name: str) -> FloatArray:
    """What an estimator gave throughout; NaN where a baseline did not run."""
    return t.mu_pct if name == OURS else t.baselines.get(name, np.full(len(t.time_s), np.nan))


def valid(t: Trace) -> NDArray[np.bool_]:
    """Which frames of a trace are Valid."""
    return np.asarray(t.validity == VALID)


def period_s(t: Trace) -> float:
    """Time from frame to frame."""
    return float(np.median(np.diff(t.time_s)))


BINS = (0.0, 0.3, 0.5, 0.7, 0.9, math.inf)  # of utilisation
UNSURE = (0.85, 1.0)  # utilisations between which a contact may be called either
SATURATED = 0.98  # utilisation from which a contact is saturated for certain
REACHED = 0.95  # of the wanted creep
SETTLED_S = 1.0
WRONG_PP, WRONG_OF_TRUTH = 2.0, 0.2  # an error beyond either is wrong: this project's own choice


def judged(f: JudgedFrames, name: str) -> NDArray[np.bool_]:
    """The frames that an estimator is judged on: wrcd's Valid ones, the same for every baseline."""
    return np.asarray(f.valid & np.isfinite(f.errors(name)))


def accuracy(f: JudgedFrames, name: str) -> dict[str, Figure]:
    """Mean and 95th percentile of the error, its mean below half and above 0.9 of the available adhesion; of wrcd,
    which alone says Valid, also the share that is Valid and wrong."""
    error, u, use = f.errors(name), f.utilisation, judged(f, name)

    def mean(where: NDArray[np.bool_]) -> Figure:
        return bootstrap.mean(error[where], f.run[where])

    return {
        "mean": mean(use),
        "p95": bootstrap.quantile(error[use], f.run[use], 0.95),
        "below_half": mean(use & (u < 0.5)),
        "above_0.9": mean(use & (u > 0.9)),
    } | ({"valid_and_wrong": valid_and_wrong(f)} if name == OURS else {})


def valid_and_wrong(f: JudgedFrames) -> Figure:
    """Share of all judged frames with a truth, Valid or not, that are Valid and wrong: the truth is outside the
    interval on the bus, and more than WRONG_PP or the share WRONG_OF_TRUTH of it off. No number at all is wrong, too.
    """
    right = f.errors(OURS) <= np.minimum(WRONG_PP, WRONG_OF_TRUTH * f.true)
    known = np.isfinite(f.true)
    return bootstrap.mean((f.valid & f.outside & ~right)[known], f.run[known])


def over(f: JudgedFrames, of: JudgedFrames, name: str = OURS) -> dict[str, Figure]:
    """The mean error as a multiple of that in other frames, and less it; runs of the same number are paired."""
    a, b = judged(f, name), judged(of, name)
    parts = f.errors(name)[a], f.run[a], of.errors(name)[b], of.run[b]
    return {"ratio": bootstrap.ratio(*parts), "difference": bootstrap.difference(*parts)}


def over_baseline(f: JudgedFrames, name: str) -> Figure:
    """wrcd's mean error over that of a baseline on the same frames."""
    use = judged(f, OURS) & judged(f, name)
    return bootstrap.ratio(f.errors(OURS)[use], f.run[use], f.errors(name)[use], f.run[use])


def by_class(f: JudgedFrames) -> dict[str, dict[str, Figure]]:
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


def contact_right(f: JudgedFrames) -> dict[str, Figure]:
    """ContactState where it is clear: adhering well below the peak, saturated beyond it."""
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


def surfaces(f: JudgedFrames) -> dict[str, dict[str, float]]:
    """Share of each true surface's Valid frames that was called what: {true: {estimated: share}}."""
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


def within(f: JudgedFrames) -> dict[str, Any]:
    """Share of frames within 1 percentage point, or 10 % of the value if larger, and the worst error over that."""
    error, allowed = f.errors(OURS), np.maximum(1.0, 0.1 * f.true)
    ratio = np.where(f.valid & np.isfinite(error), error / allowed, np.inf)
    return {
        "share": bootstrap.mean(ratio <= 1.0, f.run),
        "worst": bootstrap.largest(ratio, f.run) if len(ratio) else bootstrap.exact(math.inf, 0, 0),
    }
