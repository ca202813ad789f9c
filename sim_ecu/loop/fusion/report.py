"""The figures of fusion along the vehicle, their goals, and the tables of both."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from sim_ecu.loop.fusion.patches import PLACES_M, SPEEDS_M_S
from sim_ecu.loop.fusion.play import Played
from sim_ecu.score.goals import MIN_QUICK_RUNS, MIN_RUNS, Goal
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.bootstrap import Figure
from sim_ecu.score.tables import fig, pct

BEHIND = range(1, len(PLACES_M))  # places of the axles that are warned
WARNED_SHARE = 0.9


class Entry(NamedTuple):
    """An axle that comes to a patch. lead_s: for how long it had been warned; NaN for not at all. told_pct: what was
    predicted last, NaN for nothing."""

    run: int
    axle: int
    speed_m_s: float
    slides: bool
    cleaned: bool
    held: bool
    lead_s: float
    told_pct: float
    true_pct: float
    confirmed: bool
    distance_m: float  # told with the first warning, less the way that was left
    delay_s: float  # from the first axle's entry to the first warning


def entries(played: Sequence[Played]) -> list[Entry]:
    """Of all axles behind the first that come to a patch."""
    return [e for p in played for axle in BEHIND if (e := _entry(p, axle)) is not None]


def _entry(p: Played, axle: int) -> Entry | None:
    first_s, own_s, seen, drive = p.enters_s[0], p.enters_s[axle], p.seen[axle], p.drive
    if math.isnan(own_s):
        return None
    before = seen.warns & (seen.time_s >= first_s) & (seen.time_s <= own_s)
    k = np.flatnonzero(before)
    warned = bool(len(k))
    left_m = (own_s - seen.time_s[k[0]]) * drive.speed_m_s if warned else math.nan
    return Entry(
        run=drive.number,
        axle=axle + 1,
        speed_m_s=drive.speed_m_s,
        slides=drive.slides,
        cleaned=drive.cleaned,
        held=drive.held,
        lead_s=float(own_s - seen.time_s[k[0]]) if warned else math.nan,
        told_pct=float(seen.mu_pct[k[-1]]) if warned else math.nan,
        true_pct=float(p.true_pct[axle]),
        confirmed=bool(seen.confirmed[k[-1]]) if warned else False,
        distance_m=float(seen.distance_m[k[0]]) - left_m if warned else math.nan,
        delay_s=float(seen.time_s[k[0]] - first_s) if warned else math.nan,
    )


def _false_warnings(p: Played) -> tuple[int, float]:
    """How often a train was warned of nothing, and in how many hours: on a rail that does not change, and before the
    first axle comes to a patch."""
    until_s = p.enters_s[0] if p.drive.start_m is not None else p.seconds
    times = p.seen[0].time_s
    any_axle = np.logical_or.reduce([s.warns for s in p.seen])[times < until_s]
    begins = any_axle & ~np.concatenate(([False], any_axle[:-1]))
    return int(begins.sum()), float(until_s) / 3600


def judge(driven: Sequence[Played], steady: Sequence[Played], quick: bool = False) -> dict[str, Any]:
    """All figures. Leaves are Figures, numbers and words."""
    every = entries(driven)
    false = [_false_warnings(p) for p in (*steady, *driven)]
    seconds = 3600.0 * np.array([h for _, h in false])
    counts = np.array([c for c, _ in false], np.float64)
    runs = np.arange(len(false))
    rate = bootstrap.ratio(counts, runs, seconds / 3600.0, runs)
    low = np.array([p.false_lows for p in (*steady, *driven)])
    out: dict[str, Any] = {
        "patches": {"asked": sum(not p.drive.held for p in driven), "held": sum(p.drive.held for p in driven)},
        "axles": {str(a + 1): _axle([e for e in every if e.axle == a + 1]) for a in BEHIND},
        "false_warnings": {"count": int(counts.sum()), "hours": float(seconds.sum() / 3600), "per_hour": rate},
        "false_lows": {"with": int(low[:, 0].sum()), "without": int(low[:, 1].sum())},
        "same_frames": all(p.same for p in (*steady, *driven)),
    }
    goals = [
        Goal(
            f"fusion: axle {axle} warned before it is on the patch", figures["warned"], WARNED_SHARE, at_least=True,
            min_runs=MIN_QUICK_RUNS if quick else MIN_RUNS,
        )
        for axle, figures in out["axles"].items()
    ]  # fmt: skip
    n = len(false)
    more = bootstrap.exact(float(low[:, 0].sum() - low[:, 1].sum()), n, n)
    goals.append(Goal("fusion: frames falsely called low, with less without", more, 0.0))
    out["goals"] = [
        {"what": g.what, "figure": g.figure, "bound": g.bound, "at_least": g.at_least, "verdict": g.verdict}
        for g in goals
    ]
    return out


def _axle(of: Sequence[Entry]) -> dict[str, Any]:
    """Of one axle. The patches that hold count in their own row alone."""
    asked = [e for e in of if not e.held]
    groups = {
        "the driver asks for more than the patch carries": [e for e in asked if e.slides],
        "for less, as it comes": [e for e in asked if not e.slides],
        "cleaned by slip": [e for e in asked if e.cleaned],
        "not cleaned": [e for e in asked if not e.cleaned],
        "apart: always for less": [e for e in of if e.held],
    }
    return _figures(asked) | {
        "speeds": {f"{v:g}": _figures([e for e in asked if e.speed_m_s == v]) for v in SPEEDS_M_S},
        "groups": {name: _figures(part) for name, part in groups.items()},
    }


def _figures(of: Sequence[Entry]) -> dict[str, Figure]:
    runs = np.array([e.run for e in of], np.int64)
    lead, told, true = (np.array([getattr(e, name) for e in of]) for name in ("lead_s", "told_pct", "true_pct"))
    warned, known = np.isfinite(lead), np.isfinite(told)
    confirmed = np.array([e.confirmed for e in of], bool)
    return {
        "warned": bootstrap.share(warned, runs),
        "lead_s": bootstrap.quantile(lead[warned], runs[warned], 0.5),
        "told": bootstrap.share(known, runs),
        "confirmed": bootstrap.share(confirmed, runs),
        "error_pp": bootstrap.mean(np.abs(told - true)[known], runs[known]),
        "bias_pp": bootstrap.mean((told - true)[known], runs[known]),
    }


def tables(result: dict[str, Any]) -> list[str]:
    """Markdown, line by line."""
    patches, axles = result["patches"], result["axles"]
    false, low = result["false_warnings"], result["false_lows"]
    out = [
        f"**fusion**: {patches['asked']} patches of low rail, passed by four axles; what axles 2 to 4 were told before "
        f"they were on it. {patches['held']} patches more, on which nothing slips, count apart.",
        "",
        "| axle | warned before | by (median), s | confirmed | adhesion told | its error, pp | bias, pp |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, f in axles.items():
        cells = [pct(f["warned"]), fig(f["lead_s"]), pct(f["confirmed"]), pct(f["told"]), fig(f["error_pp"]),
                 fig(f["bias_pp"])]  # fmt: skip
        out.append(f"| {name} | " + " | ".join(cells) + " |")
    out += ["", "| warned before, of | " + " | ".join(f"axle {a}" for a in axles) + " |", "|---|" + "---|" * len(axles)]
    first = next(iter(axles.values()))
    for kind, unit in (("speeds", " m/s"), ("groups", "")):
        for name in first[kind]:
            cells = [f"{pct(f[kind][name]['warned'])} of {f[kind][name]['warned'].count}" for f in axles.values()]
            out.append(f"| {name}{unit} | " + " | ".join(cells) + " |")
    out += [
        "",
        f"False warnings: {false['count']} in {false['hours']:.2f} h of a train, {fig(false['per_hour'])} an hour.",
        f"Frames falsely called low: {low['with']} with fusion, {low['without']} without; adhesion frames "
        + ("the same byte for byte." if result["same_frames"] else "NOT the same."),
        "",
        "| goal | value | bound | |",
        "|---|---|---|---|",
    ]
    for goal in result["goals"]:
        sign = "≥" if goal["at_least"] else "≤"
        out.append(f"| {goal['what']} | {fig(goal['figure'], 3)} | {sign} {goal['bound']:g} | {goal['verdict']} |")
    return out
