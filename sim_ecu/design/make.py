"""`sim-ecu design`: from a wheelset and creep curves to the design file."""

import importlib.metadata
import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Features, Plan, Progress, Recording, features, record
from sim_ecu.design.gains import steady_state
from sim_ecu.design.linear import Point
from sim_ecu.design.rules import COVERS, PAPER_POLYNOMIAL, RuleBase, fit, polynomial
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.wheelset import Wheelset
from wrcd.checksum import checksum
from wrcd.estimator.design import FORMAT, INPUTS, MODELS, Design, parse_design

FloatArray = NDArray[np.float64]
RESIDUAL_NAMES = ("Low", "Moderate", "High")
SPEED_NAMES = ("Slow", "Fast")
CHANGE_MARGIN = 1.4  # a window is judged fifty times a second: its limits of change lie this far beyond the quantile

# The paper's four design points. Process noise per root Hz: y_t' m/s, yaw rad/s2, lateral m/s2. Noise and weights were
# searched together (CMA-ES) for the least error of the whole estimator on validation conditions, which are neither
# trained on nor scored.
POINTS = (
    Point("curve A at its peak", CURVES["A"], 1.0, (0.02, 27.0, 0.174), 0.0073),
    Point("curve C at its peak", CURVES["C"], 1.0, (0.04, 5.7, 0.006), 0.07),
    Point("curve D at its peak", CURVES["D"], 1.0, (0.085, 0.00078, 0.00018), 1.992),
    Point("curve B, linear region", CURVES["B"], 0.004, (0.49, 0.067, 0.0036), 0.31),
)


@dataclass(frozen=True, slots=True)
class Brief:
    """All that goes into a design."""

    wheelset: Wheelset = field(default_factory=Wheelset)
    points: tuple[Point, ...] = POINTS
    tick_s: float = 0.005
    window_s: float = 1.0
    recent_s: float = 0.25
    speed_range: tuple[float, float] = (3.0, 60.0)
    grid: int = 48
    plan: Plan = field(default_factory=Plan)
    torque_sets: int = 5
    most_rules: int = 100
    polynomial: str = "fitted"  # or "paper": (16)
    saturated_share: float = 0.93
    unchanged_share: float = 0.9995  # of windows on one rail in which a residual stays within its limit of change


def design(brief: Brief, progress: Progress) -> tuple[dict[str, Any], list[Recording]]:
    """The design document, and the recordings it is made from. Minutes; deterministic for one set of libraries."""
    document = bank(brief)
    progress("gains", 1.0)
    recordings = record(brief.wheelset, brief.plan, brief.tick_s, brief.window_s, progress)
    return fitted(brief, document, recordings, progress), recordings


def fitted(brief: Brief, document: dict[str, Any], recordings: list[Recording], progress: Progress) -> dict[str, Any]:
    """The document of a bank with the rule base that recordings give it."""
    data = features(_with_placeholder_rules(document), recordings, brief.plan.windows)
    progress("residuals", 1.0)
    sets = [len(names) for names in set_names(brief)]
    rules = fit(data.inputs, data.mu_pct, sets, brief.most_rules, data.importance(brief.plan), data.condition)
    document = document | fuzzy_part(brief, rules) | window_part(brief, rules, data)
    document["fit"] = fit_report(rules, data)
    document["checksum"] = checksum(document)
    progress("rule base", 1.0)
    return document


def bank(brief: Brief) -> dict[str, Any]:
    """Inputs, versions and the bank's matrices over a grid of speeds (evenly spaced in the logarithm)."""
    lo, hi = brief.speed_range
    speeds = _short(lo * (hi / lo) ** (np.arange(brief.grid) / (brief.grid - 1)), 6)
    sensors = SENSOR_SETS[brief.plan.sensors]
    noise = (sensors.yaw_rate.noise_rms, sensors.lat_accel.noise_rms)
    table = [[steady_state(brief.wheelset, p, float(v), brief.tick_s, noise) for p in brief.points] for v in speeds]
    return {
        "format": FORMAT,
        "name": brief.wheelset.name,
        "inputs": {
            "wheelset": asdict(brief.wheelset),
            "normal_N": brief.wheelset.normal_N,
            "curves": {c.name: asdict(c) for c in CURVES.values()},
            "sensors": asdict(sensors),
            "plan": asdict(brief.plan),
        },
        "versions": {
            "python": ".".join(map(str, sys.version_info[:2])),
            **{
                p: importlib.metadata.version(p)
                for p in ("wrcd", "numpy", "scipy", "filterpy", "scikit-fuzzy", "numba")
            },
        },
        "window_s": brief.window_s,
        "recent_s": brief.recent_s,
        "saturated_share": brief.saturated_share,
        "bank": {
            "tick_s": brief.tick_s,
            "models": [
                {
                    "name": p.name,
                    "curve": asdict(p.curve),
                    "creep_of_peak": p.creep_of_peak,
                    "noise": list(p.noise),
                    "yaw_rate_weight": p.yaw_rate_weight,
                    "g11_N": [_number(row[i].g11, 5) for row in table],
                    "g22_N": [_number(row[i].g22, 5) for row in table],
                }
                for i, p in enumerate(brief.points)
            ],
            "speeds_m_s": speeds.tolist(),
            "Phi": _short([[g.Phi for g in row] for row in table]).tolist(),
            "K": _short([[g.K for g in row] for row in table]).tolist(),
            "H": _short([[g.H for g in row] for row in table]).tolist(),
            "noise": _short(
                [[g.noise(p) for g, p in zip(row, brief.points, strict=True)] for row in table], 6
            ).tolist(),
            "whiten": _short([[g.whiten(p) for g, p in zip(row, brief.points, strict=True)] for row in table]).tolist(),
        },
    }


def set_names(brief: Brief) -> list[list[str]]:
    """Names of the sets of the six inputs."""
    torque = [f"T_{i + 1}" for i in range(brief.torque_sets)]
    return [*[list(RESIDUAL_NAMES)] * MODELS, torque, list(SPEED_NAMES)]


def fuzzy_part(brief: Brief, rules: RuleBase) -> dict[str, Any]:
    """The document's part that comes from the rule base."""
    names = set_names(brief)
    keys = [f"residual_{m + 1}" for m in range(MODELS)] + ["torque", "speed"]
    converts = PAPER_POLYNOMIAL if brief.polynomial == "paper" else tuple(_short(polynomial(), 9))
    ends = np.polyval(converts, [100.0, 0.0])
    return {
        "fuzzy": {
            **{
                k: {"names": n, "centres": _short(c, 6).tolist()}
                for k, n, c in zip(keys, names, rules.centres, strict=True)
            },
            "rules": rules.rules.tolist(),
            "bases": rules.bases.tolist(),
            "slopes": rules.slopes.tolist(),
            "spreads": _short(rules.spreads, 3).tolist(),
            "spread_slopes": rules.spread_slopes.tolist(),
            "typical_pct": _short(rules.typical, 3).tolist(),
            "support": _short(rules.support, 4).tolist(),
        },
        "polynomial": [float(c) for c in converts],
        "adhesion_range_pct": {"low": max(0.5, _number(ends[0], 4)), "high": min(70.0, _number(ends[1], 4))},
    }


def window_part(brief: Brief, rules: RuleBase, data: Features) -> dict[str, Any]:
    """What the newest part of a window may do while the rail does not change, and how much less it knows."""
    limits = np.quantile(np.abs(data.differences), brief.unchanged_share, axis=0)
    guess = rules.mu_pct(data.recent)
    relative = np.abs(guess - data.mu_pct) / guess / rules.spread(data.recent)
    return {
        "changes": _short(CHANGE_MARGIN * limits, 3).tolist(),
        "short_spread": max(1.0, _number(float(np.quantile(relative, COVERS)), 3)),
    }


def fit_report(rules: RuleBase, data: Features) -> dict[str, float]:
    """How well the rule base describes its own training data (no claim about anything else)."""
    error = np.abs(rules.mu_pct(data.inputs) - data.mu_pct)
    return {
        "windows": len(error),
        "mean_error_pp": _number(float(error.mean()), 4),
        "p95_error_pp": _number(float(np.quantile(error, 0.95)), 4),
        "least_support": _number(float(rules.support.min()), 4),
    }


def _with_placeholder_rules(document: dict[str, Any]) -> Design:
    """The bank alone as a design: the residuals do not depend on rules, which are not there yet."""
    sets = {"names": ["Low", "High"], "centres": [-3.0, 3.0]}
    names = [*(f"residual_{m + 1}" for m in range(MODELS)), "torque", "speed"]
    zeros = [[0] * INPUTS]
    part: dict[str, Any] = {
        "fuzzy": dict.fromkeys(names, sets)
        | {
            "rules": zeros,
            "bases": [50.0],
            "slopes": zeros,
            "spreads": [1.0],
            "spread_slopes": zeros,
            "typical_pct": [[0.0, 100.0]],
        },
        "changes": [9.0] * MODELS,
        "short_spread": 1.0,
        "polynomial": [50.0],
        "adhesion_range_pct": {"low": 0.0, "high": 100.0},
    }
    whole = document | part
    whole["checksum"] = checksum(whole)
    return parse_design(whole, "the new bank")


def _short(a: Any, digits: int = 12) -> FloatArray:
    """Rounded to significant digits: enough for the purpose, readable, and deaf to the last bits of a library."""
    out: FloatArray = np.vectorize(lambda v: _number(v, digits), otypes=[float])(np.asarray(a, dtype=np.float64))
    return out


def _number(x: float, digits: int) -> float:
    return float(f"{x:.{digits}g}")


def write(document: dict[str, Any], path: Path) -> None:
    """One line per entry of the larger tables, so that a review sees which speed or rule changed."""
    path.write_text(_pretty(document, 0) + "\n", encoding="utf-8")


def _pretty(node: Any, depth: int) -> str:
    flat = json.dumps(node, ensure_ascii=False)
    if not isinstance(node, (dict, list)) or len(flat) <= 110 or (isinstance(node, list) and depth > 2):
        return flat
    pad, end = "  " * (depth + 1), "  " * depth
    if isinstance(node, dict):
        rows = [f"{pad}{json.dumps(k)}: {_pretty(v, depth + 1)}" for k, v in node.items()]
        return "{\n" + ",\n".join(rows) + f"\n{end}}}"
    return "[\n" + ",\n".join(pad + _pretty(v, depth + 1) for v in node) + f"\n{end}]"
