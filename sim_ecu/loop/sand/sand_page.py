"""The figures of sand as sentences and tables for a terminal, and as one page with a picture."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from sim_ecu.loop.mark.lines import CLASSES
from sim_ecu.loop.sand.sand_figures import AGAIN, SandFigures
from sim_ecu.loop.sand.sanded_stops import (
    AHEAD_S,
    AT_SLIDE,
    AXLES,
    BEFORE,
    DEMAND_M_S2,
    RAILS,
    SANDED,
    SPEED_M_S,
    WHEN_LOW,
)
from sim_ecu.loop.suites.rides import KNOWN_S, LITTLE
from sim_ecu.reporting import page as reporting
from sim_ecu.reporting import verdicts
from sim_ecu.reporting.page import PageSection
from sim_ecu.reporting.table import Row, Table
from sim_ecu.reporting.values import Rounded, Share, number, share
from sim_ecu.score.sections import warnings

if TYPE_CHECKING:  # tables do not wait for matplotlib
    from matplotlib.figure import Figure as Drawing

    from sim_ecu.reporting.plots import Picture, PictureLook

QUICK = ("QUICK", "two stops on each rail, to look, not to claim.")
_RAILS = ", ".join(f"{rail} {CLASSES[rail][0]:g} to {CLASSES[rail][1]:g}" for rail in RAILS)
WHAT = (
    f"A train of {AXLES} axles with sanders ahead of axles {' and '.join(map(str, SANDED))} stops from {SPEED_M_S:g} "
    f"m/s, {DEMAND_M_S2:g} m/s² demanded after {KNOWN_S:g} s of {100 * LITTLE:.0f} % of the brake. Slide protection by "
    f"thresholds. Friction mu_0: {_RAILS}. Every policy drives the same stops. Metres from the demand to standstill; "
    f"kg on each rail. In brackets: 90 % intervals, of seeds. {BEFORE}: as when-low, and {AHEAD_S:g} s before the "
    "demand where the mean of wrcd's estimates is below what that needs."
)
FALSE = "false sand"
ABOUT = {FALSE: "greasy and wet rail bears the demand: sand there is for nothing"}
BY = (AT_SLIDE, WHEN_LOW)
MARKERS, COLOURS = "osD^", ("tab:red", "tab:brown", "tab:blue", "tab:purple", "tab:green")


def conclusions(result: Mapping[str, Any]) -> list[str]:
    """What the figures come to, in sentences."""
    again, before = result["again"][WHEN_LOW], result["again"][BEFORE]
    if math.isnan(again.value):
        return ["Sand at the slide saved nothing here."]
    said = f"Of the distance that sand at the slide saves, {WHEN_LOW} saves {share(again)} again"
    earlier = f"{number(result['earlier_s'])} s earlier than that for the slide"
    if again.value >= AGAIN:
        first = f"{said}: the {100 * AGAIN:.0f} % that are wanted, or more. Its first sand comes {earlier}."
    else:
        first = (
            f"{said}, not {100 * AGAIN:.0f} %. Its first sand comes only {earlier}: until the demand "
            "comes the estimate is no less than what is needed, and with the demand the wheels slide."
        )
    false = result["rails"].get(FALSE)
    return [
        first,
        f"A rail that bears the demand would save {share(result['most'])} again: no sand can save more.",
        f"{BEFORE}, which knows of the demand {AHEAD_S:g} s before, saves {share(before)} again. It sanded before the "
        f"demand in {share(result['ahead'])} of the stops on very low and low rail.",
        *(
            f"On rail that bears the demand {who} sands in {share(false[who].sanded)} of the stops."
            for who in BY
            if false
        ),
    ]


def sections(result: Mapping[str, Any]) -> list[PageSection]:
    """All tables."""
    out = [PageSection("", parts=[WHAT, *conclusions(result)])]
    for name, of in result["rails"].items():
        about = ABOUT.get(name) or f"{next(iter(of.values())).metres.count} stops of every policy"
        out.append(PageSection(name, about, [_table(of, false=name == FALSE)]))
    return [*out, PageSection("goals", "what sand before the slide is held to", [verdicts.table(result["goals"])])]


def _table(of: Mapping[str, SandFigures], false: bool) -> Table:
    if false:
        rows = [Row([who, Rounded(f.kg, 2), Share(f.sanded)]) for who, f in of.items()]
        return Table(["policy", "kg a stop", "stops with sand"], rows)
    rows = [Row([who, Rounded(f.metres, 0), Rounded(f.saved_m, 1), Rounded(f.kg, 2)]) for who, f in of.items()]
    return Table(["policy", "metres", "saved, m", "kg"], rows)


def text(result: Mapping[str, Any]) -> list[str]:
    """Return all as lines for a terminal, and for a page of docs."""
    head = [line for word, text in warnings(result, QUICK) for line in (f"{word}: {text}", "")]
    return head + reporting.markdown(sections(result))


def page(result: Mapping[str, Any]) -> str:
    """Return all as HTML; the picture comes first."""
    head = verdicts.head(result["goals"])
    return reporting.html(reporting.Page(
        "sim-ecu sand", "What is sand worth?", sections(result), head, warnings(result, QUICK), _pictures(result),
    ))  # fmt: skip


def _pictures(result: Mapping[str, Any]) -> Iterator["Picture"]:
    """Every policy on every rail a point."""
    from sim_ecu.reporting import plots

    rails = {name: of for name, of in result["rails"].items() if name != FALSE}

    def make(look: "PictureLook") -> "Drawing":
        figure, ax = plots.single(look, 4.6)
        for marker, (rail, of) in zip(MARKERS, rails.items(), strict=False):
            for colour, (who, f) in zip((plots.text_colour(), *COLOURS), of.items(), strict=True):
                ax.plot([f.kg.low, f.kg.high], [f.metres.value] * 2, color=colour, lw=1.0)
                ax.plot([f.kg.value] * 2, [f.metres.low, f.metres.high], color=colour, lw=1.0)
                ax.plot(f.kg.value, f.metres.value, marker, color=colour, label=f"{who}, {rail}")
        ax.set(xlabel="sand on each rail, kg", ylabel="metres from the demand")
        plots.legend(figure, look, columns=4)
        return figure

    said = "; ".join(
        f"{rail}: " + ", ".join(f"{who} {f.metres.value:.0f} m, {f.kg.value:.2f} kg" for who, f in of.items())
        for rail, of in rails.items()
    )
    yield plots.Picture(
        "Metres against sand", "Down is shorter, left is less sand. Lines: 90 % intervals.", f"Metres and kg. {said}.",
        make,
    )  # fmt: skip
