"""The score as figures: what the traces of each suite come to, and the goals that they are held to."""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from sim_ecu.design.cases import SEEDS_PER_PLAN
from sim_ecu.design.source import Source
from sim_ecu.score import metrics
from sim_ecu.score.metrics import OURS, Frames
from sim_ecu.score.play import Trace
from sim_ecu.score.suites import FIRST_TEST_SEED, ROUGH_JUDGED, SPEEDS, UTILISATIONS

SEEDS = (
    "The seeds of what is played here begin at {first}; the design was trained on seeds below {last}. "
    "No track and no noise is in both."
)
BESIDE = f"{OURS}, where the IMM ran"
LEAST_SHARE = 0.02  # a level of Confidence that occurs less is not judged


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure and its bound."""

    what: str
    value: float
    bound: float
    at_least: bool = False

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound


def judge(traces: Sequence[Trace], source: Source) -> dict[str, Any]:
    """All figures of the suites that were played, by suite. Errors are in percentage points."""
    design = source.design
    out: dict[str, Any] = {
        "design": {"name": design.name, "checksum": design.checksum, "window_s": design.window_s},
        "seeds": SEEDS.format(first=FIRST_TEST_SEED, last=(source.seed + 1) * SEEDS_PER_PLAN),
        "suites": {},
    }
    by_suite: dict[str, list[Trace]] = {}
    for t in traces:
        by_suite.setdefault(t.suite, []).append(t)
    makers = {
        "paper": _paper, "grid": _grid, "transitions": _transitions, "robust": _robust, "rough": _rough,
        "dry-hours": metrics.false_lows,
    }  # fmt: skip
    for suite, part in by_suite.items():
        out["suites"][suite] = makers[suite](part)
    out["goals"] = [asdict(g) | {"met": g.met} for g in goals(out["suites"])]
    return out


def _paper(traces: list[Trace]) -> dict[str, Any]:
    for t in traces:
        t.judged_from_s = metrics.judged_from_reached(t)
    out: dict[str, Any] = {"within": metrics.within(metrics.gather(traces)), "curves": {}}
    if any(math.isinf(t.judged_from_s) for t in traces):
        out["within"]["worst"] = math.inf  # a wheelset that never got to its peak proves nothing
    for curve in sorted({t.curve for t in traces}):
        f = metrics.gather([t for t in traces if t.curve == curve])
        out["curves"][curve] = metrics.within(f) | metrics.accuracy(f, OURS) | {"true": float(np.mean(f.true))}
    return out


def _compared(f: Frames) -> dict[str, Any]:
    """Every estimator on the same frames; where one did not run, also ours where it did."""
    out = {}
    for name in f.mu:
        out[name] = metrics.accuracy(f, name)
    if "IMM" in f.mu:
        out[BESIDE] = metrics.accuracy(f, OURS, np.isfinite(f.mu["IMM"]))
    return out


def _grid(traces: list[Trace]) -> dict[str, Any]:
    f = metrics.gather([t for t in traces if t.sensors == "mems"])
    tactical = [t for t in traces if t.sensors == "tactical"]
    return {
        "speeds": SPEEDS,
        "utilisations": UTILISATIONS,
        "compared": _compared(f),
        "tactical": metrics.accuracy(metrics.gather(tactical), OURS) if tactical else None,
        "by": metrics.by_class(f),
        "available": float(f.said.mean()),
        "contact": metrics.contact_right(f),
        "surfaces": metrics.surfaces(f),
        "confidence": metrics.confidence(f),
    }


def _robust(traces: list[Trace]) -> dict[str, Any]:
    f = metrics.gather(traces)
    return {"compared": _compared(f), "groups": _groups(traces), "confidence": metrics.confidence(f)}


def _rough(traces: list[Trace]) -> dict[str, Any]:
    return {"groups": _groups(traces)}


def _groups(traces: list[Trace]) -> dict[str, Any]:
    out = {}
    for group in dict.fromkeys(t.group for t in traces):
        f = metrics.gather([t for t in traces if t.group == group])
        out[group] = {n: metrics.accuracy(f, n) for n in f.mu} | {"available": float(f.said.mean())}
    return out


def _transitions(traces: list[Trace]) -> dict[str, Any]:
    out: dict[str, Any] = {"all": _delay(metrics.delays(traces)), "curves": {}}
    for curve in sorted({t.curve for t in traces}):
        both = metrics.delays([t for t in traces if t.curve == curve]).reshape(-1, 2)
        out["curves"][curve] = {"from dry": _delay(both[:, 0]), "to dry": _delay(both[:, 1])}
    return out


def _delay(d: np.ndarray) -> dict[str, float]:
    crossed = d[np.isfinite(d)]
    return {
        "median": float(np.median(crossed)) if len(crossed) else math.nan,
        "p95": float(np.quantile(crossed, 0.95)) if len(crossed) else math.nan,
        "changes": len(crossed),
        "already_there": len(d) - len(crossed),
    }


def goals(suites: dict[str, Any]) -> list[Goal]:
    """What the default design is held to, as far as its suites were played."""
    out = []
    if p := suites.get("paper"):
        out.append(Goal("paper: worst error over its bound (1 pp, or 10 % if larger)", p["within"]["worst"], 1.0))
    if g := suites.get("grid"):
        ours, c = g["compared"][OURS], g["confidence"]
        out += [
            Goal("grid: mean error", ours["mean"], 1.1),
            Goal("grid: 95th percentile", ours["p95"], 4.0),
            Goal("grid: mean error below half utilisation", ours["below_half"], 1.7),
            Goal("grid: mean error above 0.9", ours["above_0.9"], 0.6),
            Goal(
                "grid: torque ratio's error over ours", g["compared"]["torque ratio"]["mean"] / ours["mean"], 5.0, True
            ),
            Goal("grid: MuAvailable there, share of frames", g["available"], 0.95, True),
            Goal("grid: ContactState right, share of frames", g["contact"]["right"], 0.95, True),
            Goal(
                "grid: median half-width over a constant one's", c["median_half_width"] / c["constant_half_width"], 0.5
            ),
        ]
        out += _better("grid", g["compared"])
        for name, level in c["levels"].items():
            if level["share"] > LEAST_SHARE and name != "Wider":
                out.append(Goal(f"grid: {name} holds the truth, least", level["covers"], 0.85, True))
                out.append(Goal(f"grid: {name} holds the truth, most", level["covers"], 0.97))
    if r := suites.get("robust"):
        ours = r["compared"][OURS]
        out += [Goal("robust: mean error", ours["mean"], 1.4), Goal("robust: 95th percentile", ours["p95"], 5.5)]
        out += _better("robust", r["compared"])
    for name, row in suites.get("rough", {}).get("groups", {}).items():
        if name in ROUGH_JUDGED:
            out.append(Goal(f"rough: mean error, {name}", row[OURS]["mean"], 1.5))
    if t := suites.get("transitions"):
        out += [
            Goal("transitions: median delay, s", t["all"]["median"], 0.5),
            Goal("transitions: 95th percentile, s", t["all"]["p95"], 1.0),
        ]
    if d := suites.get("dry-hours"):
        out.append(Goal("dry-hours: times called Low or worse", d["episodes"], 0.0))
    return out


def _better(suite: str, compared: dict[str, Any]) -> list[Goal]:
    out = []
    for name in ("filterless", "EKF", "IMM"):
        if name in compared and compared[name]["frames"]:
            ours = compared[BESIDE if name == "IMM" else OURS]["mean"]
            out.append(Goal(f"{suite}: error over that of {name}", ours / compared[name]["mean"], 1.0))
    return out
