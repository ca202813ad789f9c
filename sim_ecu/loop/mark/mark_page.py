"""The figures of stops at the mark as tables for a terminal, and as one page with pictures."""

from collections.abc import Mapping
from typing import Any

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.driver import REACTION_S
from sim_ecu.loop.mark.lines import LATE_M, LINE_M_S, MARK_WORLDS, MIX, STATIONS, STAYS
from sim_ecu.loop.mark.mark_figures import ABOUT, LATE_S, OVERRUN_M, PolicyFigures
from sim_ecu.loop.mark.policies import DRY, KNOWS, LAST, REPORT, REPORT_STOPS, SLIPPERY, TESTS, UNTESTED, WRCD
from sim_ecu.reporting import page as reporting
from sim_ecu.reporting import verdicts
from sim_ecu.reporting.page import Items, PageSection, Part
from sim_ecu.reporting.plots import PictureLook
from sim_ecu.reporting.table import Row, Table
from sim_ecu.reporting.values import MISSED, Rounded, Share, number
from sim_ecu.score.sections import warnings

QUICK = ("QUICK", "one line of every world, to look, not to claim.")
_MIX = ", ".join(f"{share:.0%} {rail}" for rail, share in MIX.items())
WHAT = (
    f"Trains come to stations at {LINE_M_S[0]:g} to {LINE_M_S[1]:g} m/s, ten stations on a line, and are to stand at a "
    f"mark. Rails: {_MIX}; at {STAYS:.0%} of the stations as at the one before. Who drives decides when to begin "
    "braking, and brakes so that the train stands at the mark; slide protection by thresholds. Past it: more "
    f"than {OVERRUN_M:g} m. Seconds lost: after who knows the rail, of stops in which neither overran. In brackets: "
    "90 % intervals, of whole lines."
)
WHO = {
    DRY: "thinks of nothing",
    SLIPPERY: "thinks of slippery rail everywhere",
    LAST: "the slippery rate for one stop after a slide, else the dry one",
    REPORT: f"the same for {REPORT_STOPS} stops: a slide is reported, and the report holds for a while",
    "told 3 to 40 %": f"believes one adhesion everywhere: {RATES.kept:g} of it, {RATES.least:g} to {RATES.dry:g} m/s²",
    TESTS: f"brakes with {RATES.dry:g} m/s² for {RATES.test_s:g} s before every stop, where the slippery rate would "
    "begin; a wheel slides: the slippery rate, else the dry one; it never plans with less",
    UNTESTED: "the lower end that AdhesionAdvice states, on the approach",
    WRCD: f"the same, and where that is not enough for the dry rate, a test: {RATES.tests:g} m/s² for "
    f"{RATES.test_s:g} s",
    KNOWS: f"{RATES.kept:g} of the lowest adhesion on the way",
}
LATE_FILM = (
    f"Late film: on low and very low rail some films begin {LATE_M[0]:g} to {LATE_M[1]:g} m before the mark, after wet "
    "rail. Where that is within the braking distance of who knows the rail, no wheel has met it in time; "
    "these stops have a table of their own."
)
ASSUMED = (
    f"Assumed, and ours: the mix of rails, {REACTION_S:g} s from the decision to the brake, full service of 1.2 m/s²; "
    "both wheelsets of one bogie stand for the train."
)
GOALS = "what wrcd is held to; a goal that is missed stays here. Beside it what a policy without wrcd reaches"


def sections(result: Mapping[str, Any]) -> list[PageSection]:
    """All tables."""
    out = [PageSection("", parts=[WHAT, LATE_FILM, ASSUMED, Items([f"{who}: {what}." for who, what in WHO.items()])])]
    out += [PageSection(name, _about(name, of), [_policies(of)]) for name, of in result["groups"].items()]
    if result["rails"]:
        table = Table(
            ["as trained, film met before braking", *(f"{p}: overruns, s lost" for p in (DRY, SLIPPERY, TESTS, WRCD))],
            [[rail, *(_both(of[p]) for p in (DRY, SLIPPERY, TESTS, WRCD))] for rail, of in result["rails"].items()],
        )
        out.append(PageSection("rails", "the same by rail", [table]))
    worlds = Table(
        ["world", "lines", "family"], [[w.name, str(w.lines), w.family] for w in MARK_WORLDS],
        note=f"Lines of {STATIONS} stations; the worlds are those of the score.",
    )  # fmt: skip
    return [*out, PageSection("worlds", "what is driven", [worlds]), PageSection("goals", GOALS, [_goals(result)])]


def text(result: Mapping[str, Any]) -> list[str]:
    """Return all as lines for a terminal, and for a page of docs."""
    head = [line for word, text in warnings(result, QUICK) for line in (f"{word}: {text}", "")]
    return head + reporting.markdown(sections(result))


def page(result: Mapping[str, Any]) -> str:
    """Return all as HTML; two pictures come first."""
    from sim_ecu.loop.mark.mark_pictures import pictures

    head: list[Part] = [*verdicts.head(result["goals"])] if result["goals"] else []
    heading = "What is wrcd worth to who stops at a mark?"
    return reporting.html(reporting.Page(
        "sim-ecu mark", heading, sections(result), head, warnings(result, QUICK), pictures(result),
    ))  # fmt: skip


def picture(result: Mapping[str, Any]) -> bytes:
    """Return the first picture as PNG."""
    from sim_ecu.loop.mark.mark_pictures import pictures

    return next(iter(pictures(result))).draw(PictureLook(wide=True, dark=False))


def _about(name: str, of: Mapping[str, PolicyFigures]) -> str:
    return f"{next(iter(of.values())).stops} stops of every policy, {ABOUT[name]}"


def _policies(of: Mapping[str, PolicyFigures]) -> Table:
    head = [
        "policy", "past the mark", "of these, median m", "worst, m", "seconds lost a stop", "slip energy, kJ a wheel",
        "late for nothing", "tests",
    ]  # fmt: skip
    rows = [
        Row([
            name, Share(p.overruns), number(p.median_m, 0), number(p.worst_m, 0), Rounded(p.lost_s, 1),
            Rounded(p.energy_kJ, 0), Share(p.false), Share(p.tested),
        ])
        for name, p in of.items()
    ]  # fmt: skip
    note = f"Late for nothing: more than {LATE_S:g} s after who knows the rail, on rails that bear the dry rate."
    return Table(head, rows, note=note)


def _both(p: PolicyFigures) -> str:
    return f"{100 * p.overruns.value:.0f} %, {number(p.lost_s.value, 1)} s"


def _goals(result: Mapping[str, Any]) -> Table:
    rows = []
    for g in result["goals"]:
        beside = "" if g["beside"] is None else number(g["beside"].value, 3)
        row = [g["what"], Rounded(g["figure"], 3), verdicts.bound(dict(g)), beside, g["verdict"]]
        rows.append(Row(row, css="missed" * (g["verdict"] == MISSED)))
    return Table(["goal", "value", "bound", "without wrcd", ""], rows)
