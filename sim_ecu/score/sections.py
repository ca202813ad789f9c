"""The score as sections of tables, for the terminal and docs/reference/score.md."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sim_ecu.reporting import verdicts
from sim_ecu.reporting.table import Chapter, Table
from sim_ecu.reporting.values import UNKNOWN, Figure, Rounded, Share, Value, number, share
from sim_ecu.score.low_rail import BLOCK_M
from sim_ecu.score.metrics.accuracy import OURS, WRONG_OF_TRUTH, WRONG_PP
from sim_ecu.score.metrics.map_metrics import AS_DRIVEN, FAMILIES

QUICK = (
    "QUICK",
    f"a twelfth of the runs, to look, not to claim. A figure of less than {verdicts.MIN_QUICK_RUNS} runs judges no "
    "goal: it is too few to judge. The intervals say how little is known.",
)
HOLES = "NOT WHOLE"
INTERVALS = "In brackets: the 90 % interval, of whole runs. Only Valid frames are judged; the others are counted."
WRONG = "Valid and wrong"
WRONGS = (
    f"{WRONG}: of all judged frames, Valid or not, those that are Valid, have the truth outside the interval on the "
    f"bus, and are more than {WRONG_PP:g} pp or {100 * WRONG_OF_TRUTH:g} % of the truth off."
)
BASELINES = (
    "Beside it, on the same frames: the paper's own form, where a packaged design has one; torque ratio, the least "
    "there can be."
)


def warnings(result: Mapping[str, Any], quick: tuple[str, str] = QUICK) -> list[tuple[str, str]]:
    """Return what comes first: that suites are left out, and that it is a quick one, in the words of `quick`."""
    run = result.get("run", {})
    left_out = run.get("left_out")
    holes = [(HOLES, f"{', '.join(left_out)} left out, because runs failed.")] if left_out else []
    return holes + ([quick] if run.get("quick") else [])


def sections(result: Mapping[str, Any]) -> list[Chapter]:
    """Return a section for each suite, before them how to read them, behind them the goals."""
    d = result["design"]
    out = [
        Chapter("", "", [
            f"design {d['name']} {d['checksum'][:12]}, window {d['window_s']:g} s; "
            "errors in percentage points (pp) of MuAvailable",
            result["seeds"], INTERVALS, WRONGS, BASELINES,
        ])
    ]  # fmt: skip
    for name, s in result["suites"].items():
        about, parts = _SUITES[name](s)
        out.append(Chapter(name, about, parts))
    every = {name: s["not_valid_of"]["all"] for name, s in result["suites"].items() if "not_valid_of" in s}
    lost = Table(
        ["suite", "not Valid", "a sensor accused", "causes"],
        [[name, Share(n["share"]), Share(n["accused"]), _causes(n)] for name, n in every.items()],
    )
    return [
        *out,
        *([Chapter("not Valid", "share of the frames from when they are judged on", [lost])] if every else []),
        Chapter("goals", "what the design is held to", [verdicts.table(result["goals"])]),
    ]


Shown = tuple[str, list[str | Table]]


def apart(ours: Figure, theirs: Figure) -> str:
    """Return how wrcd's error stands to another's."""
    if not math.isfinite(ours.value) or not math.isfinite(theirs.value):
        return UNKNOWN
    if ours.below(theirs):
        return "better"
    if theirs.below(ours):
        return "worse"
    return "better, intervals overlap" if ours.value < theirs.value else "not better, intervals overlap"


def _accuracy(compared: Mapping[str, Any], more: Mapping[str, Any] | None = None) -> Table:
    ours = compared[OURS]["mean"]
    rows: list[list[Value]] = []
    for name, v in (*compared.items(), *(more or {}).items()):
        if v["mean"].count:
            beside = [apart(ours, v["mean"]), v["ours_over_it"]] if "ours_over_it" in v else ["", ""]
            wrong = Share(v["valid_and_wrong"]) if "valid_and_wrong" in v else ""
            rows.append([name, v["mean"], v["p95"], v["below_half"], v["above_0.9"], wrong, *beside])
    head = ["", "mean", "p95", "below half", "above 0.9", WRONG, f"{OURS} is", f"{OURS}'s error over it"]
    return Table(head, rows)


def _causes(n: Mapping[str, Any]) -> str:
    return ", ".join(f"{c} {share(part)}" for c, part in n["causes"].items())


def _not_valid(n: Mapping[str, Any]) -> str:
    causes = _causes(n)
    return f"Not Valid: {share(n['share'])} of the frames{f' ({causes})' if causes else ''}."


def _grid(s: Mapping[str, Any]) -> Shown:
    lo, hi = s["speeds"]
    tactical = {f"{OURS}, tactical sensors": s["tactical"]} if s["tactical"] else {}
    out: list[str | Table] = [_accuracy(s["compared"], tactical)]
    if s["tactical"]:
        out.append(f"Tactical over mems on the same conditions: {number(s['tactical']['ratio'])}.")
    out += [Table([key, *(row := s["by"][key])], [["mean error", *row.values()]]) for key in ("utilisation", "curve")]
    names = list(s["surfaces"])
    called = [[t, *(Share(row.get(n, 0.0)) for n in names)] for t, row in s["surfaces"].items()]
    c, k = s["confidence"], s["contact"]
    levels = [[n, Share(v["share"]), Share(v["covers"])] for n, v in c["levels"].items()]
    return f"curves A to F and between, {lo:g} to {hi:g} m/s, good and poor track, mems sensors", [
        *out, Table(["truly", *(f"called {n}" for n in names)], called),
        Table(["Confidence", "share of Valid frames", "holds the truth"], levels),
        f"Over all levels the interval holds the truth in {share(c['covers'])}. Half-width: median "
        f"{number(c['median_half_width'])}, mean {number(c['mean_half_width'])} pp (the bus's levels: median "
        f"{c['median_on_bus']:g}); a constant one that holds the truth as often needs "
        f"{number(c['constant_half_width'])} pp.",
        f"ContactState right in {share(k['right'])} outside utilisations of 0.85 … 1; of the frames from 0.98 on, "
        f"{share(k['saturated_right'])} are called Saturated. {_not_valid(s['not_valid'])}",
    ]  # fmt: skip


def _variants(about: str) -> Callable[[Mapping[str, Any]], Shown]:
    def parts(s: Mapping[str, Any]) -> Shown:
        others = [n for n in s["compared"] if n != OURS]
        paired = any("ratio" in g for g in s["groups"].values())
        beside = ["over the nominal error", "more by, pp"] if paired else []
        rows = [
            [name, (a := g["accuracy"])["mean"], *([g["ratio"], g["difference"]] if paired else []),
             Rounded(a["p95"], 1), Share(g["covers"]), Share(g["not_valid"]["share"]), Share(a["valid_and_wrong"]),
             *(g["others"][n] for n in others)]
            for name, g in s["groups"].items()
        ]  # fmt: skip
        return about, [
            _accuracy(s["compared"]),
            Table([f"mean error of {OURS}", "", *beside, "p95", "interval holds", "not Valid", WRONG, *others], rows),
            f"Over all the interval holds the truth in {share(s['confidence']['covers'])}. "
            + _not_valid(s["not_valid"]),
        ]

    return parts


def _worlds(s: Mapping[str, Any]) -> Shown:
    beside = any(len(row["designs"]) > 1 for row in s["rows"].values())
    head = [
        "", "family", *(["design"] if beside else []), "mean", "p95", "below half", "level holds the truth",
        "own interval holds it", "Valid", WRONG, "losses of Valid an axle-hour", "runs",
    ]  # fmt: skip
    rows = [
        [world, row["family"], *([design] if beside else []), v["mean"], v["p95"], v["below_half"],
         *(Share(v[k]) for k in ("covers", "own_covers", "valid", "valid_and_wrong")), Rounded(v["losses"], 0),
         v["valid_and_wrong"].runs]
        for world, row in s["rows"].items()
        for design, v in row["designs"].items()
    ]  # fmt: skip
    return "named worlds: as trained, wider than the training, and of kinds that it has not", [Table(head, rows)]


def _paper(s: Mapping[str, Any]) -> Shown:
    names = list(s["compared"])
    rows = [
        [c, Rounded(v["true"], 1), Share(v["share"]), Share(v["valid_and_wrong"]), *(v["means"][n] for n in names)]
        for c, v in s["curves"].items()
    ]
    head = ["curve", "true, %", "within 1 pp or 10 %", WRONG, *(f"mean error of {n}" for n in names)]
    return "held at the peak at 25 m/s, from 1.0 s after the creep is there", [Table(head, rows)]


def _sound(about: str) -> Callable[[Mapping[str, Any]], Shown]:
    def parts(s: Mapping[str, Any]) -> Shown:
        head = ["", "a sensor accused", "Valid", "mean error", "p95", "interval holds", WRONG, "why not Valid"]
        rows = [
            [name, Share(v["not_valid"]["accused"]), Share(v["valid"]), v["accuracy"]["mean"],
             Rounded(v["accuracy"]["p95"], 1), Share(v["covers"]), Share(v["accuracy"]["valid_and_wrong"]),
             _causes(v["not_valid"])]
            for name, v in s["rows"].items()
        ]  # fmt: skip
        seconds = " to ".join(map(str, sorted(set(s["seconds"]))))
        return f"{about}, sound sensors, runs of {seconds} s", [Table(head, rows)]

    return parts


def _transitions(s: Mapping[str, Any]) -> Shown:
    found = [*s["compared"].items()] + [
        (f"{OURS}, dry to {c}" if way == "from dry" else f"{OURS}, {c} to dry", v)
        for c, both in s["curves"].items()
        for way, v in both.items()
    ]
    rows = [[name, v["median"], v["p95"], v["changes"], v["already_there"]] for name, v in found]
    head = ["", "median", "95th percentile", "changes", "on that side before"]
    return "seconds from a change of rail until the estimate crosses the geometric mean", [Table(head, rows)]


def _drops(s: Mapping[str, Any]) -> Shown:
    def ends(v: Mapping[str, Any], digits: int = 2) -> list[Value]:
        return [Rounded(v["median"], digits), Rounded(v["p95"], digits),
                Rounded(v["most"], digits) if "most" in v else ""]  # fmt: skip

    rows: Sequence[Sequence[Value]] = [
        ["Valid with the truth below the interval, s", *ends(s["lie"])],
        ["until within 1 pp or 10 % (Valid, for 0.2 s), s", *ends(s["settled"])],
        ["worst over-estimate while Valid, pp", *ends(s["over"], 1)],
        ["longest over-estimate by more than 3 pp and the interval, s", *ends(s["far"])],
        *([f"until {n} is within 1 pp or 10 %, s", *ends(v)] for n, v in s["others"].items()),
    ]
    curves = [
        [c, v["drops"], *(v[k][q] for k in ("lie", "settled") for q in ("median", "p95")), Rounded(v["over"], 1)]
        for c, v in s["curves"].items()
    ]
    return f"{s['drops']} drops to a lower rail, half of them end unsaturated", [
        Table(["", "median", "95th percentile", "most"], rows),
        Table(["down to", "drops", "lie", "p95", "settled", "p95", "worst over, pp"], curves),
        _not_valid(s["not_valid"]),
    ]


def _cycles(s: Mapping[str, Any]) -> Shown:
    rows = [[c, v["mean"], Share(v["covers"]), Share(v["valid_and_wrong"])] for c, v in s["curves"].items()]
    return "torque in slip cycles through the peak, 0.5 and 1 Hz", [
        _accuracy(s["compared"]),
        Table(["curve", "mean error", "interval holds", WRONG], rows),
        f"The truth lies outside the interval in {share(s['outside'])} of the Valid frames. "
        + _not_valid(s["not_valid"]),
    ]


def _dead(s: Mapping[str, Any]) -> Shown:
    head = [
        "", "Valid after it, median s", "longest s", "not Valid at the end, axles", "interval holds", "mean error",
        WRONG,
    ]  # fmt: skip
    rows = [
        [n, g["valid_s"]["median"], g["valid_s"]["most"], Share(g["found"]), Share(g["covers"]), g["mean"],
         Share(g["valid_and_wrong"])]
        for n, g in s["groups"].items()
    ]  # fmt: skip
    return f"sensors that give their own noise alone, from {s['dies_s']:g} s on or from the start", [Table(head, rows)]


def _foreign(s: Mapping[str, Any]) -> Shown:
    head = [
        "", "not Valid after 10 s, axles", "frames not Valid", "interval holds where Valid", "mean error there", WRONG,
    ]  # fmt: skip
    rows = [
        [n, Share(g["found"]), Share(g["not_valid"]["share"]), Share(g["covers"]), g["mean"],
         Share(g["valid_and_wrong"])]
        for n, g in s["groups"].items()
    ]  # fmt: skip
    return "mounted wrongly, or another wheelset (which cannot be seen)", [Table(head, rows)]


def _dry(s: Mapping[str, Any]) -> Shown:
    none = f": less than {s['at_most_per_hour']:.2f} times an hour, at 95 %" if not s["episodes"] else ""
    return (
        f"called Low or worse {s['episodes']} times, {number(s['seconds'])} s in all, in {s['hours']:.2f} h of dry "
        f"rail, poor track ({s['valid_hours']:.2f} h Valid){none}",
        [],
    )


def _map(s: Mapping[str, Any]) -> Shown:
    head = ["", *(f"{what}, {family}" for what in ("found", "slides find") for family in FAMILIES),
            *(f"false alarms per 100 km, {family}" for family in FAMILIES), "film blocks", "good rail, km"]  # fmt: skip
    rows = [
        [name, *(Share(row[f][what]) for what in ("found", "slides") for f in FAMILIES),
         *(Rounded(row[f]["alarms"], 1) for f in FAMILIES), sum(row[f]["found"].count for f in FAMILIES),
         round(sum(row[f]["alarms"].count for f in FAMILIES) * BLOCK_M / 1000)]
        for name, row in s["rows"].items()
    ]  # fmt: skip
    (rule, of_three), either = (s["rule"], s["rule_of_three"]), {f: s["rows"][AS_DRIVEN][f]["either"] for f in FAMILIES}
    return f"low rail of 3 to 8 % found in ordinary running, by blocks of {BLOCK_M:g} m", [
        f"{s['passages']} passages of two bogies over {s['places']} places, {s['good_km']:.0f} km of good rail.",
        f"Low: every axle's upper end below {rule['upper_pct']:g} %, and below {rule['of_rest']:g} times the best of "
        f"the passage's rest; in most of three passages {of_three['upper_pct']:g} % and {of_three['of_rest']:g}.",
        Table(head, rows),
        f"As driven, slides or wrcd: {', '.join(f'{f} {share(v)}' for f, v in either.items())}.",
    ]  # fmt: skip


_SUITES: dict[str, Callable[[Mapping[str, Any]], Shown]] = {
    "paper": _paper, "grid": _grid, "transitions": _transitions, "drops": _drops, "cycles": _cycles,
    "dead": _dead, "foreign": _foreign, "dry-hours": _dry, "worlds": _worlds, "map": _map,
    "robust": _variants("the same conditions in a world that is not as the design thinks, mems sensors"),
    "rough": _variants("tracks smoother and rougher than any in the training, mems sensors"),
    "harsh": _variants("what a real axle box feels and the track's spectrum lacks, mems sensors"),
    "long": _sound("some of the grid's conditions for longer"),
    "canted": _sound("through curves each way with what the cant does not balance"),
    "peak": _sound("all of the rail in use throughout"),
    "slow": _variants("coasting, below the grid's speeds, and stops by full service, mems sensors"),
}  # fmt: skip
