"""The demo's picture: estimate with its interval, truth and adhesion in use, and when it was not Valid."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim_ecu.play.demo_screen import HALF_WIDTHS
from sim_ecu.play.observer import ObservedTrace
from sim_ecu.play.scenario import Scenario

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDEST_PP = 20.0  # what is drawn of an interval without a bound
SHADES: dict[str, dict[str, Any]] = {
    "NotAvailable": {"fc": "none", "ec": "0.75", "hatch": "//", "label": "NotAvailable: no estimate"},
    "Degraded": {"fc": "tab:orange", "alpha": 0.25, "label": "Degraded: not to be acted on"},
}


def draw(scenario: Scenario, traces: dict[int, ObservedTrace], picture: Path) -> None:
    """Write it as PNG."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(
        len(traces), 1, figsize=(9, 1.8 + 3.2 * len(traces)), squeeze=False, sharex=True, layout="constrained"
    )
    for (number, trace), ax in zip(traces.items(), axes[:, 0], strict=True):
        _axle(ax, trace)
        ax.set_ylabel(f"axle {number}: adhesion, %")
        ax.set_ylim(0, 55)
        ax.grid(alpha=0.3)
    axes[-1, 0].set_xlabel("time, s")
    labels = {label: h for ax in axes[:, 0] for h, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    figure.suptitle(f"{scenario.name}: {scenario.title}", fontsize=11)
    figure.legend(labels.values(), labels.keys(), loc="outside lower center", ncols=3, fontsize=8)
    figure.savefig(picture, dpi=110)
    plt.close(figure)


def _axle(ax: "Axes", trace: ObservedTrace) -> None:
    t = [row[0] for row in trace.truth]
    ax.fill_between(t, [row[1]["MuUsed"] for row in trace.truth], color="0.85", lw=0, label="in use, truth (=)")
    for from_s, until_s, validity in _spans(trace):
        if validity in SHADES:
            ax.axvspan(from_s, until_s, lw=0, **SHADES[validity])
    ax.plot(t, [row[1]["MuAvailable"] for row in trace.truth], color="black", lw=1.5, label="available, truth (T)")
    # where there is no estimate the line has a gap
    x = [s for s, _ in trace.adhesion]
    mu = [m if isinstance(m := a["MuAvailable"], float) else math.nan for _, a in trace.adhesion]
    half = [min(HALF_WIDTHS.get(str(a.get("Confidence")), 0.0), WIDEST_PP) for _, a in trace.adhesion]
    ax.fill_between(
        x, [max(m - h, 0) for m, h in zip(mu, half, strict=True)], [m + h for m, h in zip(mu, half, strict=True)],
        color="tab:blue", alpha=0.2, lw=0, label="90 % interval of the estimate",
    )  # fmt: skip
    ax.plot(x, mu, color="tab:blue", lw=1.2, label="available, wrcd's estimate (E)")


def _spans(trace: ObservedTrace) -> Iterator[tuple[float, float, str]]:
    """From when to when it said the same Validity."""
    if not trace.adhesion:
        return
    begin_s, validity = trace.adhesion[0][0], str(trace.adhesion[0][1]["Validity"])
    for t, a in trace.adhesion:
        if (now := str(a["Validity"])) != validity:
            yield begin_s, t, validity
            begin_s, validity = t, now
    yield begin_s, trace.adhesion[-1][0], validity
