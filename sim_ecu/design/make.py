"""`sim-ecu design`: from a wheelset and creep curves to the design file."""

import importlib.metadata
import json
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Plan, Progress, features, record
from sim_ecu.design.gains import steady_state
from sim_ecu.design.linear import Point
from sim_ecu.design.rules import PAPER_POLYNOMIAL, RESIDUAL_NAMES, RuleBase, fit
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.wheelset import Wheelset
from wrcd.estimator.design import FORMAT, Design, checksum, parse_design

FloatArray = NDArray[np.float64]

# The paper's four design points. Process noise per root Hz: y_t' m/s, yaw rad/s2, lateral m/s2.
POINTS = (
    Point("curve A at its peak", CURVES["A"], 1.0, (0.08, 0.002, 0.05)),
    Point("curve C at its peak", CURVES["C"], 1.0, (0.004, 0.25, 0.003)),
    Point("curve D at its peak", CURVES["D"], 1.0, (0.12, 0.09, 0.018)),
    Point("curve B, linear region", CURVES["B"], 0.15, (0.6, 0.07, 0.04)),
)


@dataclass(frozen=True, slots=True)
class Brief:
    """All that goes into a design."""

    wheelset: Wheelset = field(default_factory=Wheelset)
    points: tuple[Point, ...] = POINTS
    tick_s: float = 0.005
    window_s: float = 1.0
    recent_s: float = 0.2
    speed_range: tuple[float, float] = (3.0, 60.0)
    grid: int = 48
    plan: Plan = field(default_factory=Plan)
    torque_sets: int = 5
    most_rules: int = 100
    polynomial: str = "fitted"  # or "paper": (16)
    saturated_share: float = 0.93


def design(brief: Brief, progress: Progress) -> dict[str, Any]:
    """The design document. Takes minutes; deterministic for one set of library versions."""
    document = bank(brief)
    progress("gains", 1.0)
    recordings = record(brief.wheelset, brief.plan, brief.tick_s, brief.window_s, progress)
    data = features(_with_placeholder_rules(document), recordings, brief.plan.windows)
    progress("residuals", 1.0)
    rules = fit(data, brief.torque_sets, brief.most_rules)
    document |= fuzzy_part(brief, rules)
    document["fit"] = fit_report(rules, data.mu_pct)
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
                    "curve": p.curve.name,
                    "creep_of_peak": p.creep_of_peak,
                    "noise": list(p.noise),
                    "g11_N": [_number(row[i].g11, 5) for row in table],
                    "g22_N": [_number(row[i].g22, 5) for row in table],
                }
                for i, p in enumerate(brief.points)
            ],
            "speeds_m_s": speeds.tolist(),
            "Phi": _short([[g.Phi for g in row] for row in table]).tolist(),
            "K": _short([[g.K for g in row] for row in table]).tolist(),
            "H": _short([[g.H for g in row] for row in table]).tolist(),
            "whiten": _short([[np.linalg.inv(np.linalg.cholesky(g.S)) for g in row] for row in table]).tolist(),
        },
    }


def fuzzy_part(brief: Brief, rules: RuleBase) -> dict[str, Any]:
    """The document's part that comes from the rule base."""
    names: list[list[str]] = [list(RESIDUAL_NAMES)] * 4 + [[f"T_{i + 1}" for i in range(len(rules.centres[4]))]]
    keys = [f"residual_{m + 1}" for m in range(4)] + ["torque"]
    polynomial = PAPER_POLYNOMIAL if brief.polynomial == "paper" else tuple(_short(rules.polynomial, 9))
    mu = rules.fuzzy
    ends = np.polyval(polynomial, [mu.max(), mu.min()])
    return {
        "fuzzy": {
            **{
                k: {"names": n, "centres": _short(c, 6).tolist()}
                for k, n, c in zip(keys, names, rules.centres, strict=True)
            },
            "rules": rules.rules.tolist(),
            "consequents": rules.consequents.tolist(),
            "spreads": _short(rules.spreads, 3).tolist(),
            "support": _short(rules.support, 4).tolist(),
        },
        "polynomial": [float(c) for c in polynomial],
        "adhesion_range_pct": {"low": max(0.5, _number(ends[0], 4)), "high": min(70.0, _number(ends[1], 4))},
    }


def fit_report(rules: RuleBase, mu_pct: FloatArray) -> dict[str, float]:
    """How well the rule base describes its own training data (no claim about anything else)."""
    error = np.abs(np.polyval(rules.polynomial, rules.fuzzy) - mu_pct)
    return {
        "windows": len(mu_pct),
        "mean_error_pp": _number(float(error.mean()), 4),
        "p95_error_pp": _number(float(np.quantile(error, 0.95)), 4),
        "least_firing": _number(float(rules.support.min()), 4),
    }


def _with_placeholder_rules(document: dict[str, Any]) -> Design:
    """The bank alone as a design: the residuals do not depend on rules, which are not there yet."""
    sets = {"names": ["Low", "High"], "centres": [-3.0, 3.0]}
    part: dict[str, Any] = {
        "fuzzy": {f"residual_{m + 1}": sets for m in range(4)}
        | {"torque": sets, "rules": [[0, 0, 0, 0, 0]], "consequents": [50.0], "spreads": [1.0]},
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
