"""Whether Valid and Confidence hold against the truth."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sim_ecu.reporting.values import Figure
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.accuracy import OURS, VALID, JudgedFrames, period_s, valid
from sim_ecu.score.score_play import Trace
from wrcd.core.causes import OF_SENSOR
from wrcd.core.vocabulary import CONFIDENCES

FOUND_S = 0.5  # of a run's end: what is not Valid all that time has been found out
LOW_SURFACES = ("Low", "VeryLow")
ACCUSING = tuple(c.label for c in OF_SENSOR)


def not_valid(f: JudgedFrames) -> dict[str, Any]:
    """Share of the frames that are not Valid, of those that accuse a sensor, and of each cause (of all frames)."""
    causes, count = np.unique(f.cause[~f.valid], return_counts=True)
    order = np.argsort(-count, kind="stable")  # of equal ones the first by name, on any processor
    return {
        "share": bootstrap.mean(~f.valid, f.run),
        "accused": bootstrap.mean(~f.valid & np.isin(f.cause, ACCUSING), f.run),
        "causes": {str(causes[k]): float(count[k] / len(f.true)) for k in order if causes[k] not in ("", "None")},
    }


def accused(traces: Sequence[Trace]) -> Figure:
    """Return the share of all judged frames, of any suites, in which a sensor is accused."""
    keep = [t.time_s >= t.judged_from_s for t in traces]
    hits = [(~valid(t) & np.isin(t.cause, ACCUSING))[k] for t, k in zip(traces, keep, strict=True)]
    runs = [np.full(int(k.sum()), t.run, np.int64) for t, k in zip(traces, keep, strict=True)]
    return bootstrap.mean(np.concatenate(hits), np.concatenate(runs))


def losses(traces: Sequence[Trace]) -> Figure:
    """How often Valid is lost in an hour of an axle, from when its frames are judged on."""
    lost, runs = [], []
    for t in traces:
        now = valid(t)[t.time_s >= t.judged_from_s]
        if len(now) < 2:
            continue
        lost.append(np.append(False, now[:-1] & ~now[1:]) * (3600.0 / period_s(t)))
        runs.append(np.full(len(now), t.run, np.int64))
    return bootstrap.mean(np.concatenate(lost), np.concatenate(runs)) if lost else bootstrap.NOTHING


def coverage(f: JudgedFrames) -> Figure:
    """Share of the Valid frames whose interval holds the truth. One that claims no bound holds it, at no use."""
    return bootstrap.mean(~f.outside[f.valid], f.run[f.valid])


def own_coverage(f: JudgedFrames) -> Figure:
    """Share of the Valid frames whose interval as estimated, before it became a level on the bus, holds the truth."""
    return bootstrap.mean((f.errors(OURS) <= f.own_half_width)[f.valid], f.run[f.valid])


def confidence(f: JudgedFrames) -> dict[str, Any]:
    """How often the interval that Confidence claims holds the truth, by level; its width against a constant one."""
    inside = ~f.outside
    levels = {}
    for width, name in CONFIDENCES:
        at = f.valid & (f.half_width == width)
        if at.any():
            levels[name] = {"share": float(at.sum() / f.valid.sum()), "covers": bootstrap.mean(inside[at], f.run[at])}
    covers = coverage(f)
    # an interval without a bound would make a constant one as wide as the worst error
    bounded = f.valid & np.isfinite(f.half_width)
    own = f.valid & np.isfinite(f.own_half_width)
    held = float(np.mean(inside[bounded])) if bounded.any() else math.nan
    error = f.errors(OURS)
    return {
        "levels": levels,
        "covers": covers,
        "median_half_width": bootstrap.quantile(f.own_half_width[own], f.run[own], 0.5),
        "mean_half_width": bootstrap.mean(f.own_half_width[own], f.run[own]),
        "median_on_bus": float(np.median(f.half_width[bounded])) if bounded.any() else math.nan,
        "covers_bounded": held,
        "constant_half_width": (
            bootstrap.quantile(error[bounded], f.run[bounded], held) if bounded.any() else bootstrap.NOTHING
        ),
    }


def false_lows(traces: Sequence[Trace]) -> dict[str, Any]:
    """How often, and for how long, a Valid frame began to call a dry rail Low or worse, in how many hours."""
    episodes, seconds, valid_s, whole_s = 0, [], 0.0, 0.0
    for t in traces:
        each_s = period_s(t)
        ok = valid(t)
        low = np.isin(t.surface, LOW_SURFACES) & ok
        episodes += int(np.sum(low & ~np.concatenate(([False], low[:-1]))))
        seconds.append(float(low.sum()) * each_s)
        valid_s += float(ok.sum()) * each_s
        whole_s += len(t.time_s) * each_s
    per_axle = bootstrap.mean(np.array(seconds), np.array([t.run for t in traces], np.int64))
    n = len(traces)
    return {
        "episodes": episodes,
        "seconds": Figure(per_axle.value * n, per_axle.low * n, per_axle.high * n, per_axle.runs, n),
        "hours": whole_s / 3600,
        "valid_hours": valid_s / 3600,
        # where there was none: what would show itself in so many hours with a chance of 95 %
        "at_most_per_hour": -math.log(0.05) / (valid_s / 3600) if not episodes and valid_s else math.nan,
    }


def valid_after(traces: Sequence[Trace], at_s: float) -> dict[str, Figure]:
    """Seconds Valid after a moment, per axle: their median and the most."""
    seconds = np.array([np.sum(valid(t) & (t.time_s > at_s)) * period_s(t) for t in traces])
    runs = np.array([t.run for t in traces], np.int64)
    return {"median": bootstrap.quantile(seconds, runs, 0.5), "most": bootstrap.largest(seconds, runs)}


def found_out(traces: Sequence[Trace]) -> Figure:
    """Share of the axles that are not Valid any more at the end of their run."""
    found = [not (t.validity[t.time_s > t.time_s[-1] - FOUND_S] == VALID).any() for t in traces]
    return bootstrap.share(np.array(found, bool), np.array([t.run for t in traces], np.int64))
