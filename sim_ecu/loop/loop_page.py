"""The loop's figures as tables for a terminal, and as one page with pictures."""

from collections.abc import Mapping, Sequence
from typing import Any

from sim_ecu.loop import BROAD, EVERY, LAWS
from sim_ecu.loop.comparison_figures import RAILS, Against, Spread
from sim_ecu.loop.loop_rides import RideResult
from sim_ecu.loop.ride_figures import ALLOWED_S
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting import page as reporting
from sim_ecu.reporting import verdicts
from sim_ecu.reporting.page import PageSection, Part
from sim_ecu.reporting.table import Row, Table
from sim_ecu.reporting.values import CHANCE, MISSED, UNKNOWN, Rounded, Share, number
from sim_ecu.score.sections import warnings

QUICK = ("QUICK", "a tenth of the runs, to look, not to claim. No goal is judged: there are too few runs.")
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
IDEAL_IS = (
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
GOALS = (
    "what wrcd is held to; a goal that is missed stays here. Beside it what the ideal reaches against the same "
    "controller without wrcd. Out of reach: the ideal, which knows the rail, misses it too"
)
WRONG = (
    "runs with an axle that was Valid, with the truth outside the 90 % interval, for more than "
    f"{ALLOWED_S:g} s at a stretch. After a drop of the rail an interval may be wrong for so long "
    "(docs/reference/score.md, drops). In brackets: seconds; + where the truth was below the interval for as long"
)


def sections(result: Mapping[str, Any]) -> list[PageSection]:
    """Return the sentences and tables of all suites, the runs whose daemon was wrong, and the goals."""
    run = result["run"]
    broad = run["seeds_of_broad"]
    seeds = f"{run['seeds']}" + (f", of {', '.join(BROAD)} {broad}" if broad != run["seeds"] else "")
    out = [PageSection("", parts=[
        f"Runs of every row: {seeds}, seeds from {FIRST_TEST_SEED} on; the controllers were tuned on seeds below 1000.",
        "In brackets: 5 to 95 % of the runs; of a ratio, its 90 % interval, of whole runs.", WHAT, IDEAL_IS,
    ])]  # fmt: skip
    for name, cases in result["suites"].items():
        tables = [_controllers(*item) for item in cases.items()] if name in RAILS else []
        out.append(PageSection(name, SUITES[name], [*tables, *_against(cases)]))
    out.append(PageSection("wrong", WRONG, [_wrong(result["wrong"])]))
    return [*out, PageSection("goals", GOALS, [_goals(result["goals"])])]


def text(result: Mapping[str, Any]) -> list[str]:
    """Return all as lines for a terminal, and for a page of docs."""
    head = [line for word, text in warnings(result, QUICK) for line in (f"{word}: {text}", "")]
    return head + reporting.markdown(sections(result))


def page(result: Mapping[str, Any], outcomes: Sequence[RideResult]) -> str:
    """Return all as HTML, with pictures inside."""
    from sim_ecu.loop.loop_pictures import pictures

    wrong = len({(w["suite"], w["case"], w["controller"], w["seed"]) for w in result["wrong"]})
    played = sum(bool(r["said"]) for r in result["runs"])
    head: list[Part] = [
        *verdicts.head(result["goals"]),
        f"{wrong} of {played} runs had a daemon that was wrong for longer than its interval allows: they are named "
        "below.",
    ]
    heading = "What is wrcd worth to a controller?"
    return reporting.html(reporting.Page(
        "sim-ecu loop", heading, sections(result), head, warnings(result, QUICK), pictures(result, outcomes),
    ))  # fmt: skip


def _spread(s: Spread, digits: int = 1) -> str:
    """A median with its spread."""
    return number(s.median, digits) + (f" ({s.low:.{digits}f}–{s.high:.{digits}f})" if s.runs > 1 else "")


def _controllers(name: str, c: Mapping[str, Any]) -> Table:
    """One case: a row for each controller."""
    way, key = ("distance, m", "stop_m") if c["braking"] else ("impulse, kN·s", "impulse_kNs")
    head = {
        "beyond_s": ("beyond the peak, s", 2), "slides": ("slides above 8 m/s", 0), "locked_s": ("locked, s", 1),
        "max_slip_m_s": ("largest slip, m/s", 1), "slip_energy_kJ": ("slip energy, kJ", 1),
        "beyond_kJ": ("beyond the peak, kJ", 1), "utilisation": ("utilisation", 2), key: (way, 0),
    }  # fmt: skip
    rows = []
    for controller in EVERY:
        if (x := c["controllers"].get(controller)) is not None:
            cells = [_spread(x[of], digits) for of, (_, digits) in head.items()]
            cells[-1] += f", {x['not_stopped']} not stopped" if x["not_stopped"] else ""
            rows.append([controller, *cells])
    return Table([name, *(title for title, _ in head.values())], rows)


def _against(cases: Mapping[str, Any]) -> list[Table]:
    """With wrcd over without it, a row for each case and law; stops and starts apart."""
    out = []
    for braking, way in ((True, "distance"), (False, "impulse")):
        head = [
            "with wrcd over without", way, "the run that loses most", "slip energy", "time beyond the peak",
            "energy beyond the peak", "beyond the peak, s a run", "endless", "Valid", "outside", "wrong for too long",
        ]  # fmt: skip
        rows = [
            _ratios(f"{name}: {law}", c["against"][law], c["said"][law])
            for name, c in cases.items() if c["braking"] is braking
            for law in LAWS if law in c["against"]
        ]  # fmt: skip
        out += [Table(head, rows)] if rows else []
    return out


def _ratios(what: str, a: Against, honesty: Mapping[str, Any]) -> Row:
    return Row([
        what, Rounded(a.way, 3), Rounded(a.worst, 3), a.energy, a.beyond_time, a.beyond_energy,
        f"{a.beyond_s_before:.2f} → {a.beyond_s_now:.2f}",
        f"{a.endless}" + (f", {a.left_out} left out" if a.left_out else ""),
        Share(honesty["valid"]), Share(honesty["outside"]), f"{honesty['wrong_runs']} of {honesty['runs']}",
    ])  # fmt: skip


def _wrong(wrong: Sequence[Mapping[str, Any]]) -> Table | str:
    """By name."""
    rows: dict[tuple[str, str, str], list[str]] = {}
    for w in wrong:
        axle = f" axle {w['axle']}" if w["axle"] > 1 else ""
        over = "+" if w["over_s"] > ALLOWED_S else ""
        rows.setdefault((w["suite"], w["case"], w["controller"]), []).append(
            f"{w['seed']}{axle} ({w['outside_s']:.2f}{over})"
        )
    if not rows:
        return "None."
    return Table(["suite", "case", "controller", "runs"], [[*key, ", ".join(found)] for key, found in rows.items()])


def _goals(goals: Sequence[Mapping[str, Any]]) -> Table:
    """A row each, with what the ideal reaches; and where the goal is missed, whether the ideal would miss it, too."""
    rows = []
    for g in goals:
        reached, missed = g["ideal"], g["verdict"] in (MISSED, CHANCE)
        ideal = "" if reached is None else number(reached, 3)
        ideal += ", out of reach" if missed and ideal not in ("", UNKNOWN) and reached > g["bound"] else ""
        css = "missed" * (g["verdict"] == MISSED)
        rows.append(Row([g["what"], Rounded(g["figure"], 3), verdicts.bound(dict(g)), ideal, g["verdict"]], css=css))
    return Table(["goal", "value", "bound", "ideal over the same", ""], rows)
