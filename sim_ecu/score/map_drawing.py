"""The map of low rail as a picture: share of low rail found over false alarms, of wrcd and of slides."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from sim_ecu.reporting.result_files import save
from sim_ecu.score.metrics.map_metrics import FAMILIES, ONE, THREE

COLOURS, STYLES = dict(zip(FAMILIES, ("#0072B2", "#D55E00"), strict=True)), {ONE: "-", THREE: "--"}
MARKERS = {ONE: "o", THREE: "s"}
SLIDES, LEAST_ALARMS, MOST_ALARMS = "0.4", 0.1, 100.0  # false alarms per 100 km; none is drawn at the least


def write_picture(shown: Mapping[str, Any], file: Path) -> None:
    """Draw the figures of the suite map. Raises InputError where the file cannot be written."""
    figure, ax = plt.subplots(figsize=(7.5, 4.2), layout="constrained")
    for name, points in shown["curves"].items():
        passages, _, family = name.partition(", ")
        alarms, found = zip(*((max(x, LEAST_ALARMS), 100 * y) for x, y in points), strict=True)
        ax.plot(alarms, found, STYLES[passages], color=COLOURS[family], label=f"wrcd, {passages}, worlds {family}")
    for name, family in ((name, family) for name in STYLES for family in FAMILIES):
        of, colour = shown["rows"][name][family], COLOURS[family]
        at, ends = max(of["alarms"].value, LEAST_ALARMS), [[of["alarms"].low], [of["alarms"].high]]
        across = [[max(at - max(ends[0][0], LEAST_ALARMS), 0.0)], [ends[1][0] - at]]
        along = [[100 * (of["found"].value - of["found"].low)], [100 * (of["found"].high - of["found"].value)]]
        ax.errorbar(at, 100 * of["found"].value, along, across, fmt=MARKERS[name], color=colour, capsize=3)
    slides = sum(100 * shown["rows"][ONE][f]["slides"].value for f in FAMILIES) / len(FAMILIES)
    ax.axhline(slides, color=SLIDES, label="slides: wheels that slip, as a wheel-slide protection sees them")
    ax.set(xscale="log", xlim=(LEAST_ALARMS, MOST_ALARMS), ylim=(-2, 102), ylabel="low rail found, % of 100 m blocks",
           xlabel="false alarms per 100 km of good rail (left edge: 0.1 or fewer)")  # fmt: skip
    ax.set_title(
        f"Rail of 3 to 8 % in ordinary running; {shown['good_km']:.0f} km of good rail, simulated\n"
        "dots and squares: the rule, with 90 % intervals; lines: its numbers scaled", fontsize="medium",
    )  # fmt: skip
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 0.04), fontsize="small", frameon=False)
    ax.grid(alpha=0.3)
    save(file, lambda beside: figure.savefig(beside, format="png", dpi=120))
    plt.close(figure)
