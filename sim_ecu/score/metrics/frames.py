"""The judged frames of many traces side by side."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.score.play import FloatArray, Trace

OURS = "wrcd"
VALID = "Valid"


@dataclass(frozen=True, slots=True)
class Frames:
    """Arrays (frames,) of the frames from when they are judged on, those that are not Valid included."""

    mu: dict[str, FloatArray]  # of wrcd and of every baseline; NaN where nothing was said
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
        """Absolute errors in percentage points, NaN where nothing was said."""
        return np.asarray(np.abs(self.mu[name] - self.true))

    @property
    def outside(self) -> NDArray[np.bool_]:
        """Where the truth lies outside wrcd's interval. A Valid frame without a number lies outside any."""
        return np.asarray(~(self.errors(OURS) <= self.half_width))


def gather(traces: Sequence[Trace]) -> Frames:
    """All frames from when they are judged on."""
    names = list(dict.fromkeys([OURS, *(n for t in traces for n in t.baselines)]))
    keep = [t.time_s >= t.judged_from_s for t in traces]

    def join(parts: list[NDArray[Any]]) -> NDArray[Any]:
        return np.concatenate([p[k] for p, k in zip(parts, keep, strict=True)]) if parts else np.zeros(0)

    return Frames(
        mu={n: join([said(t, n) for t in traces]) for n in names},
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


def said(t: Trace, name: str) -> FloatArray:
    """What an estimator said throughout; NaN where a baseline did not run."""
    return t.mu_pct if name == OURS else t.baselines.get(name, np.full(len(t.time_s), np.nan))


def valid(t: Trace) -> NDArray[np.bool_]:
    """Which frames of a trace are Valid."""
    return np.asarray(t.validity == VALID)


def period_s(t: Trace) -> float:
    """Time from frame to frame."""
    return float(np.median(np.diff(t.time_s)))
