"""The figures of fusion along the vehicle, and their goals."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sim_ecu.loop.fusion.patches import KINDS, PATCH, SPEEDS_M_S
from sim_ecu.loop.fusion.play import SAMPLE_S, FloatArray, Played
from sim_ecu.loop.fusion.truth import BEHIND, FRAME_S, Entry, entry, false_lows, false_warnings
from sim_ecu.score.goals import MIN_QUICK_RUNS, MIN_RUNS, Goal
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.bootstrap import Figure

WARNED_SHARE = 0.9
MAX_FALSE_PER_HOUR = 6.0  # of a train: one in ten minutes
SLIDING = "the driver asks for more than the patch carries"
FAR = 0.95  # quantile of Distance's error
CHANCE = 0.05  # with which a rate as high would show no event


def judge(played: Sequence[Played], quick: bool = False) -> dict[str, Any]:
    """All figures. Leaves are Figures, numbers and words."""
    patches = [p for p in played if p.drive.kind == PATCH]
    every = [e for p in patches for axle in BEHIND if (e := entry(p, axle)) is not None]
    out: dict[str, Any] = {
        "patches": {"asked": sum(not p.drive.held for p in patches), "held": sum(p.drive.held for p in patches)},
        "axles": {
            str(axle + 1): _axle(of := [e for e in every if e.axle == axle + 1])
            | {"never_there": len(patches) - len(of)}
            for axle in BEHIND
        },
        "false_warnings": {
            kind: _false_warnings([p for p in played if kind in (p.drive.kind, "all")]) for kind in ("all", *KINDS)
        },
        "false_lows": _false_lows(played),
        "same_frames": all(p.same for p in played),
    }
    out["goals"] = [
        {"what": g.what, "figure": g.figure, "bound": g.bound, "at_least": g.at_least, "verdict": g.verdict}
        for g in _goals(out, MIN_QUICK_RUNS if quick else MIN_RUNS)
    ]
    return out


def _goals(out: dict[str, Any], min_runs: int) -> list[Goal]:
    warned = "fusion: axle {} warned before it is on the patch, {}"
    axles, false, low = out["axles"], out["false_warnings"]["all"], out["false_lows"]
    return [
        *(
            Goal(warned.format(a, "of all patches"), f["all"]["warned"], WARNED_SHARE, True, min_runs)
            for a, f in axles.items()
        ),
        *(
            Goal(warned.format(a, f"where {SLIDING}"), f["groups"][SLIDING]["warned"], WARNED_SHARE, True, min_runs)
            for a, f in axles.items()
        ),
        Goal("fusion: false warnings an hour of a train", false["per_hour"], MAX_FALSE_PER_HOUR),
        Goal("fusion: falsely told low ahead, s an hour of an axle", low["ahead_s_per_hour"], 0.0, never=True),
    ]


def _axle(of: Sequence[Entry]) -> dict[str, Any]:
    """Of one axle: of all patches, and of parts of them."""
    asked = [e for e in of if not e.held]
    groups = {
        SLIDING: [e for e in asked if e.slides],
        "for less, as it comes": [e for e in asked if not e.slides],
        "always for less": [e for e in of if e.held],
        "cleaned by slip": [e for e in of if e.cleaned],
        "not cleaned": [e for e in of if not e.cleaned],
    }
    return {
        "all": _figures(of),
        "speeds": {f"{v:g}": _figures([e for e in of if e.speed_m_s == v]) for v in SPEEDS_M_S},
        "groups": {name: _figures(part) for name, part in groups.items()},
    }


def _figures(of: Sequence[Entry]) -> dict[str, Figure]:
    runs = np.array([e.run for e in of], np.int64)
    lead, told, true = (np.array([getattr(e, name) for e in of]) for name in ("lead_s", "told_pct", "true_pct"))
    warned, known = np.isfinite(lead), np.isfinite(told)
    errors_m = np.abs(np.concatenate([e.errors_m for e in of] or [np.zeros(0)]))
    of_errors = np.repeat(runs, [len(e.errors_m) for e in of])
    return {
        "warned": bootstrap.share(warned, runs),
        "lead_s": bootstrap.quantile(lead[warned], runs[warned], 0.5),
        "told": bootstrap.share(known, runs),
        "confirmed": bootstrap.share(np.array([e.confirmed for e in of], bool), runs),
        "error_pp": bootstrap.mean(np.abs(told - true)[known], runs[known]),
        "bias_pp": bootstrap.mean((told - true)[known], runs[known]),
        "distance_m": bootstrap.quantile(errors_m, of_errors, 0.5),
        "distance_p95_m": bootstrap.quantile(errors_m, of_errors, FAR),
    }


def _hours(played: Sequence[Played]) -> FloatArray:
    return np.array([len(p.way_m) for p in played]) * SAMPLE_S / 3600.0


def _false_warnings(played: Sequence[Played]) -> dict[str, Any]:
    """Of whole runs: before, on and after a patch."""
    found, hours = np.array([false_warnings(p) for p in played], np.float64).reshape(-1, 2), _hours(played)
    return {
        "count": int(found[:, 0].sum()),
        "seconds": float(found[:, 1].sum()),
        "hours": float(hours.sum()),
        "per_hour": _rate(found[:, 0], hours),
    }


def _false_lows(played: Sequence[Played]) -> dict[str, Any]:
    """Frames that call a rail low that is not: of Adhesion, the same without fusion, and what fusion adds to them."""
    found = np.array([false_lows(p) for p in played]).reshape(-1, 2)
    seconds, hours = found[:, 1] * FRAME_S, _hours(played) * len(BEHIND)
    runs = np.arange(len(played))
    return {
        "adhesion": sum(p.false_lows for p in played),
        "ahead": int(found[:, 1].sum()),
        "ahead_told_low": int(found[:, 0].sum()),
        "ahead_s_per_hour": bootstrap.ratio(seconds, runs, hours, runs),
    }


def _rate(counts: FloatArray, hours: FloatArray) -> Figure:
    """Events an hour. Of none, the end of the interval is what would show so with a chance of 5 %."""
    runs = np.arange(len(counts))
    if not len(counts) or counts.any():
        return bootstrap.ratio(counts, runs, hours, runs)
    return Figure(0.0, 0.0, -math.log(CHANCE) / float(hours.sum()), len(counts), len(counts))
