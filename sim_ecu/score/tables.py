"""The score as tables for a person (Markdown; docs/reference/score.md has them)."""

import math
from collections.abc import Mapping
from typing import Any

from sim_ecu.score.goals import MIN_QUICK_RUNS, apart
from sim_ecu.score.metrics.bootstrap import Figure
from sim_ecu.score.metrics.frames import OURS

QUICK = (
    f"QUICK: a twelfth of the runs, to look, not to claim. A figure of less than {MIN_QUICK_RUNS} runs judges no "
    "goal: it is too few to judge. The intervals say how little is known."
)
HOLES = "NOT WHOLE"
INTERVALS = "In brackets: the 90 % interval, of whole runs. Only Valid frames are judged; the others are counted."


# What stands beside wrcd in the tables.
BASELINES = (
    "Beside it, on the same frames and with the sensors' offsets taken off: torque ratio, the least there can be; "
    "filterless, the RMS of the raw signals (noise and trend taken off) through rules fitted alike; neural network, "
    "on the rules' own inputs, unreadable; EKF and a bank of 12, with the friction as a state. Interacting multiple "
    "models are left out: tuned for telling residuals they were no fair comparison, and too slow to be tuned anew."
)


def tables(result: dict[str, Any]) -> list[str]:
    """Markdown, line by line."""
    d = result["design"]
    out = holes(result)
    out += [QUICK, ""] if result.get("run", {}).get("quick") else []
    out += [
        f"design {d['name']} {d['checksum'][:12]}, window {d['window_s']:g} s; "
        "errors in percentage points (pp) of MuAvailable",
        result["seeds"],
        INTERVALS,
        BASELINES,
    ]
    for name, s in result["suites"].items():
        head, lines = _SUITES[name](s)
        out += ["", f"**{name}**: {head}", "", *lines]
    out += ["", "**not Valid**: share of the frames from when they are judged on", ""]
    every = {name: s["not_valid_of"]["all"] for name, s in result["suites"].items()}
    out += _table(
        ["suite", "not Valid", "a sensor accused", "causes"],
        [[name, pct(n["share"]), pct(n["accused"]), _causes(n)] for name, n in every.items()],
    )
    out += ["", "**goals**: what the default design is held to", ""]
    out += ["| goal | value | bound | |", "|---|---|---|---|"]
    for goal in result["goals"]:
        sign = "≥" if goal["at_least"] else "≤"
        out.append(f"| {goal['what']} | {fig(goal['figure'], 3)} | {sign} {goal['bound']:g} | {goal['verdict']} |")
    return out


def holes(result: dict[str, Any]) -> list[str]:
    """What stands above tables from which suites are left out; nothing where none is."""
    left_out = result.get("run", {}).get("left_out")
    return [f"{HOLES}: {', '.join(left_out)} left out, because runs failed.", ""] if left_out else []


def fig(f: Figure, digits: int = 2) -> str:
    """A figure with its interval."""
    if math.isnan(f.value):
        return "–"
    if math.isnan(f.low):
        return f"{f.value:.{digits}f}"
    return f"{f.value:.{digits}f} ({f.low:.{digits}f}–{f.high:.{digits}f})"


def pct(x: Figure | float) -> str:
    """A share, a figure's with its interval."""
    if isinstance(x, Figure):
        if math.isnan(x.value):
            return "–"
        ends = "" if math.isnan(x.low) else f" ({100 * x.low:.1f}–{100 * x.high:.1f})"
        return f"{100 * x.value:.1f}{ends} %"
    return "–" if math.isnan(x) else f"{100 * x:.1f} %"


def _table(head: list[str], rows: list[list[str]]) -> list[str]:
    out = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return out + ["| " + " | ".join(r) + " |" for r in rows]


def _accuracy(compared: Mapping[str, Any], more: Mapping[str, Any] | None = None) -> list[str]:
    ours = compared[OURS]["mean"]
    head = ["", "mean", "p95", "below half", "above 0.9", f"{OURS} is", f"{OURS}'s error over it"]
    rows = []
    for name, v in (*compared.items(), *(more or {}).items()):
        if not v["mean"].count:
            continue
        beside = [apart(ours, v["mean"]), fig(v["ours_over_it"])] if "ours_over_it" in v else ["", ""]
        rows.append([name, fig(v["mean"]), fig(v["p95"]), fig(v["below_half"]), fig(v["above_0.9"]), *beside])
    return _table(head, rows)


def _causes(n: Mapping[str, Any]) -> str:
    return ", ".join(f"{c} {pct(share)}" for c, share in n["causes"].items())


def _not_valid(n: Mapping[str, Any]) -> str:
    causes = _causes(n)
    return f"Not Valid: {pct(n['share'])} of the frames{f' ({causes})' if causes else ''}."


def _grid(s: dict[str, Any]) -> tuple[str, list[str]]:
    lo, hi = s["speeds"]
    more = {f"{OURS}, tactical sensors": s["tactical"]} if s["tactical"] else {}
    out = _accuracy(s["compared"], more) + [""]
    if s["tactical"]:
        out += [f"Tactical over mems on the same conditions: {fig(s['tactical']['ratio'])}.", ""]
    for key in ("utilisation", "curve"):
        row = s["by"][key]
        out += [*_table([key, *row], [["mean error", *(fig(v) for v in row.values())]]), ""]
    names = list(s["surfaces"])
    truly = [[t, *(pct(row.get(n, 0.0)) for n in names)] for t, row in s["surfaces"].items()]
    out += [*_table(["truly", *(f"said {n}" for n in names)], truly), ""]
    out += _confidence(s["confidence"])
    k = s["contact"]
    out += [f"ContactState right in {pct(k['right'])} outside utilisations of 0.85 … 1; of the frames from 0.98 on, "
            f"{pct(k['saturated_right'])} are called Saturated. {_not_valid(s['not_valid'])}"]  # fmt: skip
    return f"curves A to F and between, {lo:g} to {hi:g} m/s, good and poor track, mems sensors", out


def _confidence(c: dict[str, Any]) -> list[str]:
    rows = [[n, pct(v["share"]), pct(v["covers"])] for n, v in c["levels"].items()]
    return [
        *_table(["Confidence", "share of Valid frames", "holds the truth"], rows), "",
        f"Over all levels the interval holds the truth in {pct(c['covers'])}. Half-width: median "
        f"{fig(c['median_half_width'])}, mean {fig(c['mean_half_width'])} pp (the bus's levels: median "
        f"{c['median_on_bus']:g}); a constant one that holds the truth as often needs "
        f"{fig(c['constant_half_width'])} pp.",
        "",
    ]  # fmt: skip


def _worlds(head: str) -> Any:
    def lines(s: dict[str, Any]) -> tuple[str, list[str]]:
        others = [n for n in s["compared"] if n != OURS]
        paired = any("ratio" in g for g in s["groups"].values())
        beside = ["over the nominal error", "more by, pp"] if paired else []
        top = [f"mean error of {OURS}", "", *beside, "p95", "interval holds", "not Valid", *others]
        rows = []
        for name, g in s["groups"].items():
            a = g["accuracy"]
            pair = [fig(g["ratio"]), fig(g["difference"])] if paired else []
            rows.append(
                [name, fig(a["mean"]), *pair, fig(a["p95"], 1), pct(g["covers"]), pct(g["not_valid"]["share"])]
                + [fig(g["others"][n]) for n in others]
            )
        c = s["confidence"]
        out = [*_accuracy(s["compared"]), "", *_table(top, rows), ""]
        return head, [
            *out,
            f"Over all the interval holds the truth in {pct(c['covers'])}. {_not_valid(s['not_valid'])}",
        ]

    return lines


def _paper(s: dict[str, Any]) -> tuple[str, list[str]]:
    names = list(s["compared"])
    rows = [
        [c, f"{v['true']:.1f}", pct(v["share"]), *(fig(v["means"][n]) for n in names)] for c, v in s["curves"].items()
    ]
    head = ["curve", "true, %", "within 1 pp or 10 %", *(f"mean error of {n}" for n in names)]
    return "held at the peak at 25 m/s, from 1.0 s after the creep is there", _table(head, rows)


def _sound(head: str) -> Any:
    def lines(s: dict[str, Any]) -> tuple[str, list[str]]:
        top = ["", "a sensor accused", "Valid", "mean error", "p95", "interval holds", "why not Valid"]
        rows = [
            [name, pct(v["not_valid"]["accused"]), pct(v["valid"]), fig(v["accuracy"]["mean"]),
             fig(v["accuracy"]["p95"], 1), pct(v["covers"]), _causes(v["not_valid"])]
            for name, v in s["rows"].items()
        ]  # fmt: skip
        seconds = " to ".join(map(str, sorted(set(s["seconds"]))))
        return f"{head}, sound sensors, runs of {seconds} s", _table(top, rows)

    return lines


def _transitions(s: dict[str, Any]) -> tuple[str, list[str]]:
    rows = [[n, v] for n, v in s["compared"].items()] + [
        [f"{OURS}, dry to {c}" if way == "from dry" else f"{OURS}, {c} to dry", v]
        for c, both in s["curves"].items()
        for way, v in both.items()
    ]
    head = ["", "median", "95th percentile", "changes", "on that side before"]
    out = _table(
        head, [[n, fig(v["median"]), fig(v["p95"]), str(v["changes"]), str(v["already_there"])] for n, v in rows]
    )
    return "seconds from a change of rail until the estimate crosses the geometric mean", out


def _drops(s: dict[str, Any]) -> tuple[str, list[str]]:
    def ends(v: Mapping[str, Any], digits: int = 2) -> list[str]:
        return [fig(v["median"], digits), fig(v["p95"], digits), fig(v["most"], digits) if "most" in v else ""]

    rows = [
        ["Valid with the truth below the interval, s", *ends(s["lie"])],
        ["until within 1 pp or 10 % (Valid, for 0.2 s), s", *ends(s["settled"])],
        ["worst over-estimate while Valid, pp", *ends(s["over"], 1)],
        ["longest over-estimate by more than 3 pp and the interval, s", *ends(s["far"])],
        *([f"until {n} is within 1 pp or 10 %, s", *ends(v)] for n, v in s["others"].items()),
    ]
    curves = [
        [c, str(v["drops"]), *(fig(v[k][q]) for k in ("lie", "settled") for q in ("median", "p95")), f"{v['over']:.1f}"]
        for c, v in s["curves"].items()
    ]
    out = [
        *_table(["", "median", "95th percentile", "most"], rows),
        "",
        *_table(["down to", "drops", "lie", "p95", "settled", "p95", "worst over, pp"], curves),
        "",
        _not_valid(s["not_valid"]),
    ]
    return f"{s['drops']} drops to a lower rail, half of them end unsaturated", out


def _cycles(s: dict[str, Any]) -> tuple[str, list[str]]:
    rows = [[c, fig(v["mean"]), pct(v["covers"])] for c, v in s["curves"].items()]
    out = [*_accuracy(s["compared"]), "", *_table(["curve", "mean error", "interval holds"], rows), ""]
    return (
        "torque in slip cycles through the peak, 0.5 and 1 Hz",
        [
            *out,
            f"The truth lies outside the interval in {pct(s['outside'])} of the Valid frames. "
            + _not_valid(s["not_valid"]),
        ],
    )


def _dead(s: dict[str, Any]) -> tuple[str, list[str]]:
    head = ["", "Valid after it, median s", "longest s", "not Valid at the end, axles", "interval holds", "mean error"]
    rows = [
        [n, fig(g["valid_s"]["median"]), fig(g["valid_s"]["most"]), pct(g["found"]), pct(g["covers"]), fig(g["mean"])]
        for n, g in s["groups"].items()
    ]
    return f"sensors that give their own noise alone, from {s['dies_s']:g} s on or from the start", _table(head, rows)


def _foreign(s: dict[str, Any]) -> tuple[str, list[str]]:
    head = ["", "not Valid after 10 s, axles", "frames not Valid", "interval holds where Valid", "mean error there"]
    rows = [
        [n, pct(g["found"]), pct(g["not_valid"]["share"]), pct(g["covers"]), fig(g["mean"])]
        for n, g in s["groups"].items()
    ]
    return "mounted wrongly, or another wheelset (which cannot be seen)", _table(head, rows)


def _dry(s: dict[str, Any]) -> tuple[str, list[str]]:
    none = f": less than {s['at_most_per_hour']:.2f} times an hour, at 95 %" if not s["episodes"] else ""
    return (
        f"called Low or worse {s['episodes']} times, {fig(s['seconds'])} s in all, in {s['hours']:.2f} h of dry rail, "
        f"poor track ({s['valid_hours']:.2f} h Valid){none}",
        [],
    )


_SUITES = {
    "paper": _paper, "grid": _grid, "transitions": _transitions, "drops": _drops, "cycles": _cycles,
    "dead": _dead, "foreign": _foreign, "dry-hours": _dry,
    "robust": _worlds("the same conditions in a world that is not as the design thinks, mems sensors"),
    "rough": _worlds("tracks smoother and rougher than any in the training, mems sensors"),
    "harsh": _worlds("what a real axle box feels and the track's spectrum lacks, mems sensors"),
    "long": _sound("some of the grid's conditions for longer"),
    "canted": _sound("through curves each way with what the cant does not balance"),
    "peak": _sound("all of the rail in use throughout"),
    "slow": _worlds("coasting, and below the grid's speeds, mems sensors"),
}  # fmt: skip
