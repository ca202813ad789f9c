"""The goals of a score as a picture: how far each figure is from its bound."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from sim_ecu.reporting.result_files import save
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW
from sim_ecu.reporting.verdicts import bound

COLOURS = {MET: "#009E73", MET_CHANCE: "#56B4E9", CHANCE: "#E69F00", MISSED: "#D55E00", TOO_FEW: "0.6"}
NEAREST, FURTHEST = 0.1, 10.0  # a ratio beyond is drawn there
TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
ROW_IN = 0.25


def write_picture(goals: Sequence[Mapping[str, Any]], file: Path) -> None:
    """Draw a row for each goal with its 90 % interval. Raises InputError where the file cannot be written."""
    figure, ax = plt.subplots(figsize=(11.0, 1.4 + ROW_IN * len(goals)), layout="constrained")
    for row, goal in enumerate(goals):
        of, colour = goal["figure"], COLOURS[goal["verdict"]]
        low, at, high = (beyond(goal, x) for x in (of.low, of.value, of.high))
        ax.plot([low, high], [row, row], color=colour)
        ax.plot(at, row, "o", color=colour, label=goal["verdict"])
        words = f"{goal['what']}: {of.value:.3g} ({bound(goal)})"
        ax.text(-0.01, row, words, transform=ax.get_yaxis_transform(), ha="right", va="center", fontsize="small")
    ax.axvline(1.0, color="0.3")
    ax.set(xscale="log", xlim=(NEAREST / 1.1, FURTHEST * 1.1), ylim=(len(goals) - 0.4, -0.6), yticks=[])
    ax.set_xticks(TICKS, [f"{x:g}" for x in TICKS])
    ax.set_xlabel("below 1 is met: figure over bound (≤), 1 − figure over 1 − bound (≥); lines: 90 %", fontsize="small")
    handles = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    shown = [verdict for verdict in COLOURS if verdict in handles]
    ax.legend(
        [handles[verdict] for verdict in shown], shown,
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(shown), fontsize="small", frameon=False,
    )  # fmt: skip
    ax.grid(axis="x", alpha=0.3)
    save(file, lambda beside: figure.savefig(beside, format="png", dpi=110))
    plt.close(figure)


def beyond(goal: Mapping[str, Any], value: float) -> float:
    """Above 1 where it is on the wrong side of its bound; NaN of NaN. A bound of 0 is met by 0 alone. What must be at
    least a bound is a share."""
    over, under = (1.0 - value, 1.0 - goal["bound"]) if goal["at_least"] else (value, goal["bound"])
    ratio = over / under if under else (1.0 if over == under else math.inf)
    return ratio if math.isnan(ratio) else min(max(ratio, NEAREST), FURTHEST)
