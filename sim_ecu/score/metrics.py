"""Figures over traces. Errors are of MuAvailable, in percentage points; no frame that carries a number is left out."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.score.play import FloatArray, Trace
from wrcd.daemon.report import CONFIDENCES, SURFACES, surface

OURS = "wrcd"
BINS = (0.0, 0.3, 0.5, 0.7, 0.9, math.inf)  # of utilisation
UNSURE = (0.85, 1.0)  # utilisations between which a contact may be called either
SATURATED = 0.98  # utilisation from which a contact is saturated for certain
REACHED = 0.95  # of the wanted creep
SETTLED_S = 1.0
LATEST_S = 4.0  # a change that has not shown by then counts as this
HOLDS_S = 0.1  # the estimate has crossed when it stays across this long
LOW_SURFACES = ("Low", "VeryLow")


@dataclass(frozen=True, slots=True)
class Frames:
    """The judged frames of many traces side by side, arrays (frames,)."""

    mu: dict[str, FloatArray]  # of wrcd and of every baseline; NaN where nothing was said
    true: FloatArray
    used: FloatArray
    past_peak: NDArray[np.bool_]
    half_width: FloatArray
    contact: NDArray[np.str_]
    surface: NDArray[np.str_]
    curve: NDArray[np.str_]

    @property
    def utilisation(self) -> FloatArray:
        """Adhesion in use over adhesion available."""
        return np.asarray(self.used / self.true)

    @property
    def said(self) -> NDArray[np.bool_]:
        """Where wrcd sent a number."""
        return np.isfinite(self.mu[OURS])

    def errors(self, name: str) -> FloatArray:
        """Absolute errors in percentage points, NaN where nothing was said."""
        return np.asarray(np.abs(self.mu[name] - self.true))


def gather(traces: Sequence[Trace]) -> Frames:
    """All frames from when they are judged on."""
    names = list(dict.fromkeys([OURS, *(n for t in traces for n in t.baselines)]))
    keep = [t.time_s >= t.judged_from_s for t in traces]

    def join(parts: list[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([p[k] for p, k in zip(parts, keep, strict=True)]) if parts else np.zeros(0)

    return Frames(
        mu={n: join([_said(t, n) for t in traces]) for n in names},
        true=join([t.true_mu_pct for t in traces]),
        used=join([t.true_used_pct for t in traces]),
        past_peak=join([np.abs(t.true_slip) > t.peak_slip for t in traces]).astype(bool),
        half_width=join([t.half_width_pp for t in traces]),
        contact=join([t.contact for t in traces]),
        surface=join([t.surface for t in traces]),
        curve=join([np.full(len(t.time_s), t.curve) for t in traces]),
    )


def _said(t: Trace, name: str) -> FloatArray:
    """NaN where a baseline did not run."""
    return t.mu_pct if name == OURS else t.baselines.get(name, np.full(len(t.time_s), np.nan))


def accuracy(f: Frames, name: str, where: NDArray[np.bool_] | None = None) -> dict[str, float]:
    """Mean and 95th percentile of the error, its mean below half and above 0.9 of the available adhesion."""
    error, u = f.errors(name), f.utilisation
    use = f.said & np.isfinite(error)
    if where is not None:
        use &= where

    def mean(extra: NDArray[np.bool_]) -> float:
        chosen = error[use & extra]
        return float(chosen.mean()) if len(chosen) else math.nan

    return {
        "mean": mean(np.ones(len(error), bool)),
        "p95": float(np.quantile(error[use], 0.95)) if use.any() else math.nan,
        "below_half": mean(u < 0.5),
        "above_0.9": mean(u > 0.9),
        "frames": int(use.sum()),
    }


def by_class(f: Frames) -> dict[str, dict[str, float]]:
    """Mean error of wrcd by utilisation and by curve."""
    error, u = f.errors(OURS), f.utilisation
    out: dict[str, dict[str, float]] = {"utilisation": {}, "curve": {}}
    for lo, hi in itertools.pairwise(BINS):
        at = f.said & (u >= lo) & (u < hi)
        out["utilisation"][f"{lo:g}–{hi:g}" if hi < math.inf else f"{lo:g} up"] = _mean(error[at])
    for curve in sorted(set(f.curve.tolist())):
        out["curve"][curve] = _mean(error[f.said & (f.curve == curve)])
    return out


def _mean(x: FloatArray) -> float:
    return float(x.mean()) if len(x) else math.nan


def contact_right(f: Frames) -> dict[str, float]:
    """ContactState where it can be told: adhering well below the peak, saturated beyond it."""
    u = f.utilisation
    adhering = f.said & (u < UNSURE[0]) & ~f.past_peak
    # past the peak the adhesion in use falls again: outside 0.85 … 1 that is saturated, too
    saturated = f.said & ((u < UNSURE[0]) | (u > UNSURE[1])) & f.past_peak
    right = (adhering & (f.contact == "Adhering")) | (saturated & (f.contact == "Saturated"))
    judged = adhering | saturated
    return {
        "right": float(right.sum() / max(judged.sum(), 1)),
        "adhering_right": _mean((f.contact == "Adhering")[adhering].astype(float)),
        "saturated_right": _mean((f.contact == "Saturated")[f.said & (u >= SATURATED)].astype(float)),
        "frames": int(judged.sum()),
    }


def surfaces(f: Frames) -> dict[str, dict[str, float]]:
    """Share of each true surface's frames that was called what: {true: {said: share}}."""
    true = np.array([surface(float(m)) for m in f.true])
    names = [name for _, name in SURFACES]
    return {
        t: {s: float(np.mean(f.surface[f.said & (true == t)] == s)) for s in names}
        for t in names
        if (f.said & (true == t)).any()
    }


def confidence(f: Frames) -> dict[str, Any]:
    """How often the interval that Confidence claims holds the truth, by level; its width against a constant one."""
    error = f.errors(OURS)[f.said]
    half = f.half_width[f.said]
    levels = {}
    for width, name in CONFIDENCES:
        at = half == width
        if at.any():
            levels[name] = {"share": float(at.mean()), "covers": float(np.mean(error[at] <= width))}
    # the widest level claims no bound: it counts as an interval of no use, and covers nothing
    bounded = np.isfinite(half)
    covers = float(np.mean(error[bounded] <= half[bounded])) if bounded.any() else math.nan
    return {
        "levels": levels,
        "covers": covers,
        "median_half_width": float(np.median(half)),
        "constant_half_width": float(np.quantile(error[bounded], covers)) if bounded.any() else math.nan,
    }


def judged_from_reached(t: Trace) -> float:
    """A second after the creep came to its peak."""
    reached = np.flatnonzero(np.abs(t.true_slip) >= REACHED * t.peak_slip)
    return float(t.time_s[reached[0]]) + SETTLED_S if len(reached) else math.inf


def within(f: Frames) -> dict[str, float]:
    """Share of frames within 1 percentage point, or 10 % of the value if larger, and the worst error over that."""
    error, allowed = f.errors(OURS), np.maximum(1.0, 0.1 * f.true)
    ratio = np.where(f.said, error / allowed, np.inf)
    worst = float(ratio.max()) if len(ratio) else math.inf
    return {"share": _mean((ratio <= 1.0).astype(float)), "worst": worst, "frames": len(ratio)}


def delays(traces: Sequence[Trace], name: str = OURS) -> FloatArray:
    """Per change of rail: seconds until the estimate crosses the geometric mean of the two levels, LATEST_S if late;
    NaN where it was on the new level's side already, so that there is nothing to cross."""
    out = []
    for t in traces:
        mu = _said(t, name)
        for at in t.changes_s:
            before = float(t.true_mu_pct[t.time_s <= at - 0.1][-1])
            after = float(t.true_mu_pct[t.time_s >= at + 0.5][0])
            middle = math.sqrt(before * after)
            window = (t.time_s > at) & (t.time_s <= at + LATEST_S)
            just_before = (t.time_s > at - HOLDS_S) & (t.time_s <= at)
            with np.errstate(invalid="ignore"):
                across = mu[window] < middle if after < before else mu[window] > middle
                across_before = mu[just_before] >= middle if after < before else mu[just_before] <= middle
            if not np.any(across_before):
                out.append(math.nan)
                continue
            stays = max(1, round(HOLDS_S / float(np.median(np.diff(t.time_s)))))
            run = np.convolve(across, np.ones(stays), "full")[stays - 1 :][: len(across)]
            first = np.flatnonzero(run >= stays)
            out.append(float(t.time_s[window][first[0]]) - at if len(first) else LATEST_S)
    return np.array(out)


def false_lows(traces: Sequence[Trace]) -> dict[str, float]:
    """How often a dry rail began to be called Low or worse, in how many hours."""
    episodes = 0
    for t in traces:
        low = np.isin(t.surface, LOW_SURFACES)
        episodes += int(np.sum(low & ~np.concatenate(([False], low[:-1]))))
    hours = sum(float(t.time_s[-1] - t.time_s[0]) for t in traces) / 3600
    return {"episodes": episodes, "hours": hours, "per_hour": episodes / hours}
