"""What a change of rail does to the estimate: when it follows, and what it claims until then."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.reporting.values import Figure
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.accuracy import OURS, estimates, period_s, valid
from sim_ecu.score.score_play import FloatArray, Trace

LATEST_S = 4.0  # a change that has not shown by then counts as this
HOLDS_S = 0.1  # the estimate has crossed when it stays across this long
SETTLED_HOLDS_S = 0.2  # it has settled when it stays within its bound this long
FAR_PP = 3.0  # over-estimates by more than this are timed


@dataclass(frozen=True, slots=True)
class Drop:
    """One change down, seen for LATEST_S or until the next. Seconds and percentage points.

    lie_s: Valid with the truth below the interval. settled_s: until a Valid estimate stays within 1 point or 10 %.
    max_over_pp: the worst over-estimate in a Valid frame. far_s: the longest unbroken time in which Valid frames say
    more than FAR_PP too much and the truth lies outside its interval.
    """

    run: int
    curve: str
    lie_s: float
    settled_s: float
    max_over_pp: float
    far_s: float


def delays(traces: Sequence[Trace], name: str = OURS) -> tuple[FloatArray, NDArray[np.int64]]:
    """Per change of rail: seconds until the estimate crosses the geometric mean of the two levels, LATEST_S if late;
    NaN where it was on the new level's side already, so that there is nothing to cross. And the run of each."""
    out, runs = [], []
    for t in traces:
        mu = _estimates(t, name)
        for at, _ in _changes(t):
            before, after = _levels(t, at)
            middle = math.sqrt(before * after)
            window = (t.time_s > at) & (t.time_s <= at + LATEST_S)
            just_before = (t.time_s > at - HOLDS_S) & (t.time_s <= at)
            with np.errstate(invalid="ignore"):
                across = mu[window] < middle if after < before else mu[window] > middle
                across_before = mu[just_before] >= middle if after < before else mu[just_before] <= middle
            runs.append(t.run)
            out.append(_holds_from(across, t, HOLDS_S, window, at) if np.any(across_before) else math.nan)
    return np.array(out), np.array(runs, np.int64)


def drops(traces: Sequence[Trace]) -> list[Drop]:
    """Every change to a lower rail."""
    out = []
    for t in traces:
        each_s, ok = period_s(t), valid(t)
        for at, end in _changes(t):
            before, after = _levels(t, at)
            if after >= before:
                continue
            window = (t.time_s > at) & (t.time_s <= end)
            over = t.mu_pct[window] - t.true_mu_pct[window]
            with np.errstate(invalid="ignore"):
                lies = ok[window] & (over > np.nan_to_num(t.half_width_pp[window], nan=0.0, posinf=np.inf))
                far = lies & (over > FAR_PP)
            over = over[ok[window] & np.isfinite(over)]
            out.append(
                Drop(
                    run=t.run,
                    curve=t.curve,
                    lie_s=float(lies.sum()) * each_s,
                    settled_s=settled(t, at, end, OURS),
                    max_over_pp=float(over.max()) if len(over) else -math.inf,
                    far_s=_longest(far) * each_s,
                )
            )
    return out


def settled(t: Trace, at: float, end: float, name: str) -> float:
    """Seconds from a change until the estimate (wrcd's: a Valid one) stays within 1 point or 10 %; LATEST_S if late."""
    window = (t.time_s > at) & (t.time_s <= end)
    with np.errstate(invalid="ignore"):
        near = np.abs(_estimates(t, name) - t.true_mu_pct) <= np.maximum(1.0, 0.1 * t.true_mu_pct)
    return _holds_from(near[window], t, SETTLED_HOLDS_S, window, at)


def settlings(traces: Sequence[Trace], name: str) -> tuple[FloatArray, NDArray[np.int64]]:
    """Of every change down, for wrcd or a baseline. And the run of each."""
    rows = [
        (settled(t, at, end, name), t.run) for t in traces for at, end in _changes(t) if np.less(*_levels(t, at)[::-1])
    ]
    return np.array([s for s, _ in rows]), np.array([r for _, r in rows], np.int64)


def median_and_p95(seconds: FloatArray, runs: NDArray[np.int64]) -> dict[str, Figure]:
    """Of those that are numbers."""
    known = np.isfinite(seconds)
    return {
        "median": bootstrap.quantile(seconds[known], runs[known], 0.5),
        "p95": bootstrap.quantile(seconds[known], runs[known], 0.95),
    }


def _estimates(t: Trace, name: str) -> FloatArray:
    """What a controller goes by: of wrcd only Valid frames, of a baseline all."""
    mu = estimates(t, name)
    return np.where(valid(t), mu, np.nan) if name == OURS else mu


def _changes(t: Trace) -> Iterator[tuple[float, float]]:
    """When each change begins, and until when it is looked at."""
    for at, after in itertools.zip_longest(t.changes_s, t.changes_s[1:], fillvalue=math.inf):
        yield at, min(at + LATEST_S, after)


def _levels(t: Trace, at: float) -> tuple[float, float]:
    """The truth before a change and after it."""
    return float(t.true_mu_pct[t.time_s <= at - 0.1][-1]), float(t.true_mu_pct[t.time_s >= at + 0.5][0])


def _holds_from(hits: NDArray[np.bool_], t: Trace, holds_s: float, window: NDArray[np.bool_], at: float) -> float:
    """Seconds after `at` from which hits (of the frames in the window) hold for a time; LATEST_S if they never do."""
    stays = max(1, round(holds_s / period_s(t)))
    run = np.convolve(hits, np.ones(stays), "full")[stays - 1 :][: len(hits)]
    first = np.flatnonzero(run >= stays)
    return float(t.time_s[window][first[0]]) - at if len(first) else LATEST_S


def _longest(hits: NDArray[np.bool_]) -> int:
    """The most consecutive frames."""
    return max((len(list(g)) for k, g in itertools.groupby(hits) if k), default=0)
