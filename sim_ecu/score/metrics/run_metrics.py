"""Figures of one run by name, for a row of a table; NaN where a run has none."""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from sim_ecu.score.metrics import accuracy, change_metrics, honesty
from sim_ecu.score.metrics.accuracy import OURS, gather, period_s, valid
from sim_ecu.score.score_play import Trace
from wrcd.core.vocabulary import SURFACES

RunFigures: TypeAlias = dict[str, float | int | str]
NOT_LOW_PCT = min(low for low, name in SURFACES if name not in honesty.LOW_SURFACES)
OF_ESTIMATES = ("mean_error_pp", "p95_error_pp", "worst_axle_pp", "valid", "coverage", "half_width_pp", "lie_s",
                "lie_worst_s", "false_low_s")  # fmt: skip
OF_SUITES = ("delay_s", "drop_lie_s", "settled_s", "settled_worst_s", "max_over_pp", "far_s", "found", "valid_after_s")


def estimate_figures(traces: Sequence[Trace]) -> RunFigures:
    """Return OF_ESTIMATES, false_lows and cause of a run's traces, an axle each, one at least."""
    f = gather(traces)
    error, confidence = accuracy.accuracy(f, OURS), honesty.confidence(f)
    means = [accuracy.accuracy(gather([t]), OURS)["mean"].value for t in traces]
    lies = [_lie_s(t) for t in traces]
    low_s, lows = zip(*map(_false_low, traces), strict=True)
    return {
        "mean_error_pp": error["mean"].value,
        "p95_error_pp": error["p95"].value,
        "worst_axle_pp": _of(max, means),
        "valid": float(np.mean(f.valid)),
        "coverage": confidence["covers"].value,
        "half_width_pp": confidence["mean_half_width"].value,
        "lie_s": sum(lies) / len(lies),
        "lie_worst_s": max(lies),
        "false_low_s": sum(low_s),
        "false_lows": sum(lows),
        "cause": next(iter(honesty.not_valid(f)["causes"]), ""),
    }


def suite_figures(traces: Sequence[Trace]) -> RunFigures:
    """Return those, and OF_SUITES, which are of changes of the rail and of broken sensors."""
    suite = traces[0].suite
    out = estimate_figures(traces) | dict.fromkeys(OF_SUITES, math.nan)
    if suite in ("transitions", "drops"):
        drops = change_metrics.drops(traces)
        out |= {
            "delay_s": _of(np.mean, change_metrics.delays(traces)[0].tolist()),
            "drop_lie_s": _of(np.mean, [d.lie_s for d in drops]),
            "settled_s": _of(np.mean, [d.settled_s for d in drops]),
            "settled_worst_s": _of(np.max, [d.settled_s for d in drops]),
            "max_over_pp": _of(np.max, [d.max_over_pp for d in drops]),
            "far_s": _of(np.max, [d.far_s for d in drops]),
        }
    if suite in ("dead", "foreign"):
        out["found"] = honesty.found_out(traces).value
    if suite == "dead":
        out["valid_after_s"] = honesty.valid_after(traces, traces[0].judged_from_s)["most"].value
    return out


def _lie_s(t: Trace) -> float:
    """Seconds Valid with the truth below the interval."""
    over = t.mu_pct - t.true_mu_pct
    with np.errstate(invalid="ignore"):
        lies = valid(t) & (over > np.nan_to_num(t.half_width_pp, nan=0.0, posinf=np.inf))
    return float(np.sum(lies & (t.time_s >= t.judged_from_s))) * period_s(t)


def _false_low(t: Trace) -> tuple[float, int]:
    """Seconds Valid and called low on a rail that is not, and how often that began."""
    low = np.isin(t.surface, honesty.LOW_SURFACES) & valid(t) & (t.true_mu_pct >= NOT_LOW_PCT)
    begins = low & ~np.concatenate(([False], low[:-1]))
    return float(low.sum()) * period_s(t), int(begins.sum())


def _of(how: Callable[[list[float]], Any], values: Sequence[float]) -> float:
    """Apply how to the values that are numbers; NaN for none."""
    known = [v for v in values if math.isfinite(v)]
    return float(how(known)) if known else math.nan
