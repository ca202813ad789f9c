"""The loop as tables for a person (Markdown; docs/reference/loop.md has them)."""

import math
from collections.abc import Sequence
from typing import Any

from sim_ecu.loop.goals import LONGEST
from sim_ecu.loop.names import BROAD, EVERY, LAWS
from sim_ecu.loop.said import ALLOWED_S
from sim_ecu.loop.statistics import Against, Spread
from sim_ecu.loop.suites.case import FIRST_TEST_SEED
from sim_ecu.score.goals import CHANCE, MET, MET_CHANCE, MISSED
from sim_ecu.score.tables import fig, holes, pct

QUICK = "QUICK: a tenth of the runs, to look, not to claim. No goal is judged: there are too few runs."
WHAT = (
    "Beyond the peak: seconds of all axles, and the part of the slip energy of a wheel, at more creep than at the peak "
    "of the rail's creep curve, where more slip carries less; over that without, where a run without wrcd counts as "
    "0.1 s and 0.1 kJ at least. Slide: slip beyond 1.5 m/s or 15 % of the ground speed, whichever is less; counted "
    "when it begins above 8 m/s, over below half of that. Locked: seconds of all axles below 5 % of the ground speed. "
    "Slip energy: of a wheel, from the demand on. Utilisation: adhesion used over available while the driver asks for "
    "more than there is. Nothing is judged below 3 m/s; distances are from the demand on to there. Endless: with wrcd "
    "the train did not stop; such a stop is infinitely long. A run that does not stop without wrcd has no ratio: it is "
    "left out and counted."
)
IDEAL = (
    "ideal: knows the rail at each axle's place and ahead of it, and asks the same actuators for 98 % of the lowest "
    "peak under the wheel and where it will be in 0.2 s (0.45 s where the friction brake takes part). A mark to "
    "compare with: no controller can be built so. One that slips beyond the peak, or asks for more before "
    "a patch ends, may be a little better."
)
SUITES = {
    "braking": "stops of one axle, by rail",
    "traction": "starts of one axle, by rail: ten seconds of full effort",
    "train": "four axles that follow each other over the same rail",
    "faults": "a fault of wrcd's inputs (sim-ecu inject) of 2 s, 2 s after the demand, in a stop from 15 to 17 m/s on "
    "a greasy rail known before; of two axles where it needs them",
    "worlds": "the same stops in worlds that are not as the daemon's design thinks",
    "actuators": "the same stops, and those into a leaf patch, with other actuators",
}
FULL = ("braking", "traction", "train")
WORDS = {"way": "distance", "energy": "slip energy"}
GOALS = (
    "what wrcd is held to; a goal that is missed stays here. Beside it what the ideal reaches against the same "
    "controller without wrcd. Out of reach: the ideal, which knows the rail, misses it too"
)


def tables(result: dict[str, Any]) -> list[str]:
    """Markdown, line by line."""
    run = result.get("run", {})
    out = holes(result)
    out += [QUICK, ""] if run.get("quick") else []
    out += [
        f"Runs of every row: {_runs(run)}, seeds from {FIRST_TEST_SEED} on; the controllers were tuned on seeds below "
        "1000.",
        "In brackets: 5 to 95 % of the runs; of a ratio, its 90 % interval, of whole runs.",
        WHAT,
        IDEAL,
    ]
    for name, cases in result["suites"].items():
        out += ["", f"**{name}**: {SUITES[name]}", ""]
        if name in FULL:
            for case, c in cases.items():
                out += _controllers(case, c)
        out += _beside(cases)
    out += _wrong(result["wrong"])
    return out + _goals(result["goals"])


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """A Markdown table."""
    return ["| " + " | ".join(r) + " |" for r in (head, ["---"] * len(head), *rows)]


def of(s: Spread, digits: int = 1) -> str:
    """A median with its spread."""
    if math.isnan(s.median):
        return "–"
    if s.runs < 2:
        return f"{s.median:.{digits}f}"
    return f"{s.median:.{digits}f} ({s.low:.{digits}f}–{s.high:.{digits}f})"


def _controllers(name: str, c: dict[str, Any]) -> list[str]:
    """One case: a row for each controller."""
    way, key = ("distance, m", "stop_m") if c["braking"] else ("impulse, kN·s", "impulse_kNs")
    head = [
        name, "beyond the peak, s", "slides above 8 m/s", "locked, s", "largest slip, m/s", "slip energy, kJ",
        "beyond the peak, kJ", "utilisation", way,
    ]  # fmt: skip
    rows = [
        [
            controller, of(x["beyond_s"], 2), of(x["slides"], 0), of(x["locked_s"]), of(x["max_slip_m_s"]),
            of(x["slip_energy_kJ"]), of(x["beyond_kJ"]), of(x["utilisation"], 2), of(x[key], 0) + _standing(x),
        ]
        for controller in EVERY if (x := c["controllers"].get(controller)) is not None
    ]  # fmt: skip
    return [*table(head, rows), ""]


def _runs(run: dict[str, Any]) -> str:
    broad = run["seeds_of_broad"]
    return f"{run['seeds']}" + (f", of {', '.join(BROAD)} {broad}" if broad != run["seeds"] else "")


def _standing(x: dict[str, Any]) -> str:
    return f", {x['not_stopped']} not stopped" if x["not_stopped"] else ""


def _beside(cases: dict[str, Any]) -> list[str]:
    """With wrcd over without it, a row for each case and law; stops and starts apart."""
    out: list[str] = []
    for braking, way in ((True, "distance"), (False, "impulse")):
        head = [
            "with wrcd over without", f"{way}", "the run that loses most", "slip energy", "time beyond the peak",
            "energy beyond the peak", "beyond the peak, s a run", "endless", "Valid", "outside", "wrong for too long",
        ]  # fmt: skip
        rows = [
            _ratios(f"{name}: {law}", c["against"][law], c["said"][law])
            for name, c in cases.items() if c["braking"] is braking
            for law in LAWS if law in c["against"]
        ]  # fmt: skip
        out += [*table(head, rows), ""] if rows else []
    return out[:-1]


def _goals(goals: Sequence[dict[str, Any]]) -> list[str]:
    """A row each; in the suites that do not differ in the rail, those of a kind that are met alike are one row."""
    out = ["", f"**goals**: {GOALS}", ""]
    rows: list[list[str]] = []
    met: dict[tuple[str, str, str, str], list[dict[str, Any]]] = {}
    for g in goals:
        if g["verdict"] in (MET, MET_CHANCE) and g["suite"] not in FULL and g["kind"] != LONGEST:
            alike = g["suite"], g["kind"], g["what"].rpartition(": ")[2], g["verdict"]
            met.setdefault(alike, []).append(g)
            continue
        rows.append([g["what"], fig(g["figure"], 3), _bound(g), _ideal(g), g["verdict"]])
    for (suite, _, what, verdict), some in met.items():
        best, worst = (f(g["figure"].value for g in some) for f in (min, max))
        cases = f"{len(some)} case{'s' * (len(some) > 1)}"
        rows.append([f"{suite}: {cases}: {what}", f"{best:.3f} to {worst:.3f}", _bound(some[0]), "", verdict])
    return out + table(["goal", "value", "bound", "ideal over the same", ""], rows)


def _bound(g: dict[str, Any]) -> str:
    return f"{'≥' if g['at_least'] else '≤'} {g['bound']:g}"


def _ideal(g: dict[str, Any]) -> str:
    """What it reaches; and where the goal is missed, whether it would miss it too."""
    if not g["ideal"]:
        return ""
    (_, first), *others = g["ideal"].items()
    text = "–" if math.isnan(first) else f"{first:.3f}"
    text += "".join(f" at {WORDS[key]} {value:.2f}" for key, value in others)
    return text + (", out of reach" if g["verdict"] in (MISSED, CHANCE) and g["ideal_is"] is False else "")


def _ratios(what: str, a: Against, said: dict[str, Any]) -> list[str]:
    return [
        what, fig(a.way, 3), "–" if math.isnan(a.worst) else f"{a.worst:.3f}", fig(a.energy), fig(a.beyond_time),
        fig(a.beyond_energy), f"{a.beyond_s_before:.2f} → {a.beyond_s_now:.2f}", endless(a), pct(said["valid"]),
        pct(said["outside"]), f"{said['wrong_runs']} of {said['runs']}",
    ]  # fmt: skip


def endless(a: Against) -> str:
    """Stops that did not end, with wrcd; and those left out because they did not without it."""
    return f"{a.endless}" + (f", {a.left_out} left out" if a.left_out else "")


def _wrong(wrong: Sequence[dict[str, Any]]) -> list[str]:
    """By name."""
    out = [
        "", f"**wrong**: runs with an axle that was Valid, with the truth outside the 90 % interval, for more than "
        f"{ALLOWED_S:g} s at a stretch. After a drop of the rail an interval may be wrong for so long "
        "(docs/reference/score.md, drops). In brackets: seconds; + where the truth was below the interval for as long",
        "",
    ]  # fmt: skip
    rows: dict[tuple[str, str, str], list[str]] = {}
    for w in wrong:
        axle = f" axle {w['axle']}" if w["axle"] > 1 else ""
        over = "+" if w["over_s"] > ALLOWED_S else ""
        rows.setdefault((w["suite"], w["case"], w["controller"]), []).append(
            f"{w['seed']}{axle} ({w['outside_s']:.2f}{over})"
        )
    if not rows:
        return [*out, "None."]
    return out + table(
        ["suite", "case", "controller", "runs"], [[*key, ", ".join(found)] for key, found in rows.items()]
    )
