"""A rail's picture: each law's fronts with wrcd and without, and the energy of one over that of the other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from sim_ecu.loop import WITH
from sim_ecu.loop.fronts.front_figures import FrontComparison, envelope
from sim_ecu.loop.fronts.front_sentences import says
from sim_ecu.reporting import plots
from sim_ecu.reporting.plots import Picture, PictureLook

BARE_COLOUR, WITH_COLOUR, TOLD_COLOUR = "tab:orange", "tab:blue", "0.55"


def picture(rail: str, stop: str, laws: Mapping[str, Mapping[str, Any]]) -> Picture:
    """Return it; below it stands what it shows."""

    def make(look: PictureLook) -> Drawing:
        figure, axes = plots.fields(look, 2 * len(laws), 2.9, columns=2)
        for (law, of), (plane, over) in zip(laws.items(), zip(axes[::2], axes[1::2], strict=True), strict=True):
            _plane(plane, law, of)
            _over(over, law, of["with_over_bare"])
        plots.legend(figure, look)
        return figure

    sentences = [says(law, of["with_over_bare"]) for law, of in laws.items()]
    return Picture(
        f"{rail}: {stop}",
        " ".join(sentences) + " Left: a sign for each set point, of medians; the line is the front; numbers are "
        "what a lie tells, in percent. Right: the band is the 90 % interval of the ratio, place by place. It is of "
        "runs that both fronts share, and narrower than that of a median: stops differ more than fronts do.",
        "Slip energy over distance of both fronts, and their ratio. " + " ".join(sentences), make,
    )  # fmt: skip


def _plane(ax: Axes, law: str, of: Mapping[str, Any]) -> None:
    for controller, colour, style in ((law, BARE_COLOUR, "--"), (WITH[law], WITH_COLOUR, "-")):
        full = controller == WITH[law]
        _signs(ax, of["points"][controller], colour, "o", colour if full else "none")
        points = np.array([[p["distance_m"].value, p["energy_kJ"].value] for p in of["points"][controller]])
        label = "with wrcd" if full else "without wrcd"
        ax.plot(*envelope(points).T, style, color=colour, lw=1.6, label=label)
    _signs(ax, of["told"], TOLD_COLOUR, "x", TOLD_COLOUR)
    for t in of["told"]:
        ax.annotate(f"{t['told_pct']:g}", (t["distance_m"].value, t["energy_kJ"].value), fontsize=7,
                    xytext=(3, 3), textcoords="offset points", color=TOLD_COLOUR)  # fmt: skip
    ax.plot([], [], "x", color=TOLD_COLOUR, label="told a constant, %")
    ax.set_title(law, fontsize=9)
    ax.set_xlabel("distance, m", fontsize=8)
    ax.set_ylabel("slip energy of a wheel, kJ", fontsize=8)
    ax.set_ylim(bottom=0)
    ax.tick_params(labelsize=8)


def _signs(ax: Axes, points: Sequence[Mapping[str, Any]], colour: str, marker: str, face: str) -> None:
    for p in points:
        ax.plot(p["distance_m"].value, p["energy_kJ"].value, marker, color=colour, mfc=face, ms=5, mew=1.4, zorder=3)


def _over(ax: Axes, law: str, c: FrontComparison) -> None:
    r = c.energy
    if not np.isfinite(r.at).any():
        ax.text(0.5, 0.6, "no stop without wrcd is so short", transform=ax.transAxes, ha="center", fontsize=8)
        ax.set_xticks([])
    elif r.at[0] == r.at[-1]:  # a front of one point
        ax.errorbar(r.at[0], r.ratio[0], np.abs([[r.low[0]], [r.high[0]]] - np.array(r.ratio[0])), fmt="o",
                    color=WITH_COLOUR, ecolor=WITH_COLOUR, elinewidth=1.6)  # fmt: skip
    else:
        ax.plot(r.at, r.ratio, color=WITH_COLOUR, lw=1.6)
        ax.fill_between(r.at, r.low, r.high, color=WITH_COLOUR, alpha=0.2, lw=0)
    ax.axhline(1.0, color=plots.text_colour(), lw=0.8)
    ax.set_title(f"{law}: energy with wrcd over that without", fontsize=9)
    ax.set_xlabel("distance, m", fontsize=8)
    ax.set_ylim(0.0, 2.0)
    ax.tick_params(labelsize=8)
