"""What wrcd said in one run, as figures: of the judged frames of all axles together where nothing else is said."""

from collections.abc import Sequence

import numpy as np

from sim_ecu.campaign.job import Scalar
from sim_ecu.campaign.kind import Figure, Type
from sim_ecu.score.metrics import accuracy, honesty
from sim_ecu.score.metrics.frames import OURS, gather, period_s, valid
from sim_ecu.score.play import Trace
from wrcd.core.vocabulary import SURFACES

NOT_LOW_PCT = min(low for low, name in SURFACES if name not in honesty.LOW_SURFACES)

FIGURES = (
    Figure("mean_error_pp", Type.NUMBER, "mean error of MuAvailable in Valid frames; NaN if none is", "pp", "less"),
    Figure("p95_error_pp", Type.NUMBER, "its 95th percentile", "pp", "less"),
    Figure("worst_axle_pp", Type.NUMBER, "mean error of the axle where it is largest", "pp", "less"),
    Figure("valid", Type.NUMBER, "share of the frames that are Valid", better="more"),
    Figure("coverage", Type.NUMBER, "share of the Valid frames whose interval holds the truth; 0.9 is claimed"),
    Figure("half_width_pp", Type.NUMBER, "mean half-width of the estimator's interval in Valid frames", "pp", "less"),
    Figure("lie_s", Type.NUMBER, "time Valid with the truth below the interval, mean of the axles", "s", "less"),
    Figure("lie_worst_s", Type.NUMBER, "the same, worst axle", "s", "less"),
    Figure("false_low_s", Type.NUMBER, "time Valid and called Low or worse on a rail that is not, from the start on, "
           "sum of all axles", "s", "less"),
    Figure("false_lows", Type.WHOLE, "how often that began", better="less"),
    Figure("cause", Type.TEXT, "the most frequent cause of not being Valid; empty for none"),
)  # fmt: skip


def figures_of(traces: Sequence[Trace]) -> dict[str, Scalar]:
    """Of a run's traces, an axle each, one at least."""
    f = gather(traces)
    of_all = accuracy.accuracy(f, OURS)
    confidence = honesty.confidence(f)
    means = [accuracy.accuracy(gather([t]), OURS)["mean"].value for t in traces]
    known = [m for m in means if np.isfinite(m)]
    lies = [_lie_s(t) for t in traces]
    low_s, lows = zip(*map(_false_low, traces), strict=True)
    causes = honesty.not_valid(f)["causes"]
    return {
        "mean_error_pp": of_all["mean"].value,
        "p95_error_pp": of_all["p95"].value,
        "worst_axle_pp": max(known, default=float("nan")),
        "valid": float(np.mean(f.valid)),
        "coverage": confidence["covers"].value,
        "half_width_pp": confidence["mean_half_width"].value,
        "lie_s": sum(lies) / len(lies),
        "lie_worst_s": max(lies),
        "false_low_s": sum(low_s),
        "false_lows": sum(lows),
        "cause": next(iter(causes), ""),
    }


def _lie_s(t: Trace) -> float:
    over = t.mu_pct - t.true_mu_pct
    with np.errstate(invalid="ignore"):
        lies = valid(t) & (over > np.nan_to_num(t.half_width_pp, nan=0.0, posinf=np.inf))
    return float(np.sum(lies & (t.time_s >= t.judged_from_s))) * period_s(t)


def _false_low(t: Trace) -> tuple[float, int]:
    """Seconds, and how often it began."""
    low = np.isin(t.surface, honesty.LOW_SURFACES) & valid(t) & (t.true_mu_pct >= NOT_LOW_PCT)
    begins = low & ~np.concatenate(([False], low[:-1]))
    return float(low.sum()) * period_s(t), int(begins.sum())
