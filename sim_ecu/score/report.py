"""The score as figures: what the traces of each suite come to."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from sim_ecu.design.brief import Recipe
from sim_ecu.design.cases import SEEDS_PER_PLAN
from sim_ecu.reporting.values import Figure
from sim_ecu.score import MAP
from sim_ecu.score.map_play import Passage
from sim_ecu.score.metrics import accuracy, bootstrap, change_metrics, honesty
from sim_ecu.score.metrics.accuracy import OURS, JudgedFrames, gather
from sim_ecu.score.metrics.map_metrics import map_figures
from sim_ecu.score.score_goals import goals
from sim_ecu.score.score_play import Trace
from sim_ecu.score.suites import PAIRED
from sim_ecu.score.suites.broken import DIES_S
from sim_ecu.score.suites.run import FIRST_TEST_SEED, SPEEDS, UTILISATIONS
from sim_ecu.score.suites.worlds import EVERY

SEEDS = (
    "The seeds of what is played here begin at {first}; the design was trained on seeds below {last}. "
    "No track and no noise is in both."
)
PACKAGED_SEEDS = " The packaged scenarios have their own seeds, 1 to 6, which no training has."
PLAY_PACKAGED = {"canted", "peak"}
BROKEN = ("dead", "foreign")  # suites in which an accusation is right
MEMS, TACTICAL = "mems", "tactical"


def judge(
    played: Sequence[Trace | Passage], source: Recipe, suite: str | None = None, quick: bool = False
) -> dict[str, Any]:
    """All figures of the suites that were played (or of one, whose twins in the grid were played along), by suite.

    Errors are in percentage points. Leaves are Figures, numbers and words.
    """
    design = source.design
    traces, passages = [t for t in played if isinstance(t, Trace)], [p for p in played if isinstance(p, Passage)]
    by_suite: dict[str, list[Trace]] = {}
    for t in traces:
        by_suite.setdefault(t.suite, []).append(t)
    twins: dict[int, list[Trace]] = {}
    for t in by_suite.get("grid", []):
        if t.group == MEMS:
            twins.setdefault(t.run, []).append(t)
    makers = {
        "paper": _paper, "grid": _grid, "transitions": _transitions, "drops": _drops, "cycles": _cycles,
        "dead": lambda part: _foreign(part, after=True), "foreign": _foreign, "slow": _variants,
        "worlds": _worlds, "dry-hours": honesty.false_lows, "long": _sound, "canted": _sound, "peak": _sound,
    }  # fmt: skip
    shown = {
        name: _variants(part, twins) if name in PAIRED else makers[name](part)
        for name, part in by_suite.items()
        if suite in (None, name)
    }
    for name, part in by_suite.items():
        if name in shown:
            shown[name]["not_valid_of"] = {"all": honesty.not_valid(gather(part))} | {
                group: honesty.not_valid(gather(of_group)) for group, of_group in _groups(part).items()
            }
    if passages:
        shown[MAP] = map_figures(passages)
    sound = [t for name, part in by_suite.items() if name in shown and name not in BROKEN for t in part]
    accused = honesty.accused(sound) if sound else None
    return {
        "design": {"name": design.name, "checksum": design.checksum, "window_s": design.window_s},
        "seeds": SEEDS.format(first=FIRST_TEST_SEED, last=(source.seed + 1) * SEEDS_PER_PLAN)
        + PACKAGED_SEEDS * (not PLAY_PACKAGED.isdisjoint(shown)),
        "suites": shown,
        "accused": accused,
        "goals": [g.record() for g in goals(shown, accused, quick)],
    }


def _groups(traces: Sequence[Trace]) -> dict[str, list[Trace]]:
    out: dict[str, list[Trace]] = {}
    for t in traces:
        out.setdefault(t.group, []).append(t)
    return out


def _compared(f: JudgedFrames) -> dict[str, Any]:
    """Every estimator on the same frames, and wrcd's error over that of each other."""
    out: dict[str, Any] = {name: accuracy.accuracy(f, name) for name in f.mu}
    for name in out:
        if name != OURS:
            out[name]["ours_over_it"] = accuracy.over_baseline(f, name)
    return out


def _whole(f: JudgedFrames) -> dict[str, Any]:
    return {
        "compared": _compared(f),
        "confidence": honesty.confidence(f),
        "not_valid": honesty.not_valid(f),
    }


def _paper(traces: list[Trace]) -> dict[str, Any]:
    for t in traces:
        t.judged_from_s = accuracy.judged_from_reached(t)
    f = gather(traces)
    out: dict[str, Any] = {"within": accuracy.within(f), "compared": _compared(f), "curves": {}}
    if any(math.isinf(t.judged_from_s) for t in traces):
        worst = out["within"]["worst"]  # a wheelset that never got to its peak proves nothing
        out["within"]["worst"] = bootstrap.exact(math.inf, worst.runs, worst.count)
    for curve in sorted({t.curve for t in traces}):
        f = gather([t for t in traces if t.curve == curve])
        means = {name: accuracy.accuracy(f, name)["mean"] for name in f.mu}
        out["curves"][curve] = accuracy.within(f) | {
            "means": means, "true": float(np.mean(f.true)), "valid_and_wrong": accuracy.valid_and_wrong(f)
        }  # fmt: skip
    return out


def _grid(traces: list[Trace]) -> dict[str, Any]:
    f = gather([t for t in traces if t.group == MEMS])
    better = gather([t for t in traces if t.group == TACTICAL])
    numbers = set(better.run.tolist())
    same = [t for t in traces if t.group == MEMS and t.run in numbers]
    return _whole(f) | {
        "speeds": SPEEDS,
        "utilisations": UTILISATIONS,
        "tactical": accuracy.accuracy(better, OURS) | accuracy.over(better, gather(same)) if numbers else None,
        "by": accuracy.by_class(f),
        "contact": accuracy.contact_right(f),
        "surfaces": accuracy.surfaces(f),
    }


def _variants(traces: list[Trace], twins: dict[int, list[Trace]] | None = None) -> dict[str, Any]:
    """Variants one by one, each beside the same conditions of the grid."""
    groups = {}
    for name, part in _groups(traces).items():
        f = gather(part)
        groups[name] = {
            "accuracy": accuracy.accuracy(f, OURS),
            "others": {n: accuracy.accuracy(f, n)["mean"] for n in f.mu if n != OURS},
            "covers": honesty.coverage(f),
            "not_valid": honesty.not_valid(f),
        }
        if twins is not None:
            nominal = gather([t for run in dict.fromkeys(t.run for t in part) for t in twins.get(run, [])])
            groups[name] |= accuracy.over(f, nominal)
    return _whole(gather(traces)) | {"groups": groups}


def _worlds(traces: list[Trace]) -> dict[str, Any]:
    """Every design on the same frames, whole: by what it says on the bus."""
    of = {w.name: w for w in EVERY}
    return {
        "rows": {
            name: {
                "family": of[name].family,
                "tied": of[name].tied,
                "designs": {OURS: _of_world(part)}
                | {other: _of_world([t.beside[other] for t in part]) for other in part[0].beside},
            }
            for name, part in _groups(traces).items()
        }
    }


def _of_world(traces: Sequence[Trace]) -> dict[str, Figure]:
    f = gather(traces)
    return accuracy.accuracy(f, OURS) | {
        "covers": honesty.coverage(f),
        "own_covers": honesty.own_coverage(f),
        "valid": bootstrap.mean(f.valid, f.run),
        "losses": honesty.losses(traces),
    }


def _sound(traces: list[Trace]) -> dict[str, Any]:
    """By group, and by the rail of all groups."""
    rails = {f"rail {c}": [t for t in traces if t.curve == c] for c in sorted({t.curve for t in traces})}
    rows = {}
    for name, part in (_groups(traces) | rails).items():
        f = gather(part)
        rows[name] = {
            "accuracy": accuracy.accuracy(f, OURS),
            "covers": honesty.coverage(f),
            "valid": bootstrap.mean(f.valid, f.run),
            "not_valid": honesty.not_valid(f),
        }
    seconds = [round(float(t.time_s[-1])) for t in traces]
    return {"rows": rows, "seconds": [min(seconds), max(seconds)]}


def _estimators(traces: Sequence[Trace]) -> list[str]:
    return list(dict.fromkeys([OURS, *(n for t in traces for n in t.baselines)]))


def _transitions(traces: list[Trace]) -> dict[str, Any]:
    out: dict[str, Any] = {"compared": {}, "curves": {}}
    for name in _estimators(traces):
        out["compared"][name] = _delay(*change_metrics.delays(traces, name))
    for curve in sorted({t.curve for t in traces}):
        d, runs = change_metrics.delays([t for t in traces if t.curve == curve])
        out["curves"][curve] = {
            way: _delay(d[k::2], runs[k::2]) for k, way in enumerate(("from dry", "to dry"))
        }  # fmt: skip
    return out


def _delay(d: np.ndarray, runs: np.ndarray) -> dict[str, Any]:
    crossed = int(np.isfinite(d).sum())
    return change_metrics.median_and_p95(d, runs) | {"changes": crossed, "already_there": len(d) - crossed}


def _drops(traces: list[Trace]) -> dict[str, Any]:
    every = change_metrics.drops(traces)
    runs = np.array([d.run for d in every], np.int64)

    def column(name: str) -> np.ndarray:
        return np.array([getattr(d, name) for d in every])

    def spread(name: str) -> dict[str, Figure]:
        return change_metrics.median_and_p95(column(name), runs) | {"most": bootstrap.largest(column(name), runs)}

    to = np.array([d.curve.split()[-1] for d in every])
    return {
        "drops": len(every),
        "lie": change_metrics.median_and_p95(column("lie_s"), runs),
        "settled": change_metrics.median_and_p95(column("settled_s"), runs),
        "over": spread("max_over_pp"),
        "far": spread("far_s"),
        "others": {
            name: change_metrics.median_and_p95(*change_metrics.settlings(traces, name))
            for name in _estimators(traces)
            if name != OURS
        },
        "curves": {
            c: {
                "drops": int(np.sum(to == c)),
                "lie": change_metrics.median_and_p95(column("lie_s")[to == c], runs[to == c]),
                "settled": change_metrics.median_and_p95(column("settled_s")[to == c], runs[to == c]),
                "over": float(column("max_over_pp")[to == c].max()),
            }
            for c in sorted(set(to.tolist()))
        },
        "not_valid": honesty.not_valid(gather(traces)),
    }  # fmt: skip


def _cycles(traces: list[Trace]) -> dict[str, Any]:
    f = gather(traces)
    return _whole(f) | {
        "outside": bootstrap.mean(f.outside[f.valid], f.run[f.valid]),
        "curves": {
            c: {
                "mean": bootstrap.mean(f.errors(OURS)[at], f.run[at]),
                "covers": honesty.coverage(g),
                "valid_and_wrong": accuracy.valid_and_wrong(g),
            }
            for c in sorted(set(f.curve.tolist()))
            for at, g in [(accuracy.judged(f, OURS) & (f.curve == c), gather([t for t in traces if t.curve == c]))]
        },
    }


def _foreign(traces: list[Trace], after: bool = False) -> dict[str, Any]:
    """Return how often each group is found out, and what it says until then. after: how long it is Valid, too."""
    groups = {}
    for name, part in _groups(traces).items():
        f = gather(part)
        groups[name] = ({"valid_s": honesty.valid_after(part, part[0].judged_from_s)} if after else {}) | {
            "found": honesty.found_out(part),
            "covers": honesty.coverage(f),
            "mean": accuracy.accuracy(f, OURS)["mean"],
            "valid_and_wrong": accuracy.valid_and_wrong(f),
            "not_valid": honesty.not_valid(f),
        }
    return {"groups": groups} | ({"dies_s": DIES_S} if after else {})
