"""The pictures of stops at the mark: metres past against seconds lost, and a line of ten stations."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from sim_ecu.loop.mark.mark_figures import ABOUT, ALL, OVERRUN_M, PolicyFigures
from sim_ecu.loop.mark.policies import DRY, KNOWS, LAST, REPORT, SLIPPERY, TESTS, TOLD, UNTESTED, WRCD
from sim_ecu.reporting import plots
from sim_ecu.reporting.plots import Picture, PictureLook

COLOURS = {
    DRY: "tab:red", SLIPPERY: "tab:brown", LAST: "tab:pink", REPORT: "tab:orange", TESTS: "tab:purple",
    UNTESTED: "tab:cyan", WRCD: "tab:blue", KNOWS: "tab:green",
}  # fmt: skip
ON_THE_LINE = (DRY, SLIPPERY, TESTS, WRCD, KNOWS)
LEAST_M = 0.01  # a mean of less is drawn as so much


def pictures(result: Mapping[str, Any]) -> Iterator[Picture]:
    """The policies, then the line with most kinds of rail."""
    groups = result["groups"]
    if groups:
        name = ALL if ALL in groups else next(iter(groups))
        yield _plane(name, groups[name])
    if result["stops"]:
        yield _line(_varied(result["stops"]))


def _plane(name: str, of: Mapping[str, PolicyFigures]) -> Picture:
    """Every policy a point."""
    liars = "/".join(f"{pct}" for pct in TOLD.values())

    def make(look: PictureLook) -> Drawing:
        figure, ax = plots.single(look, 4.6)
        for policy, p in of.items():
            colour = COLOURS.get(policy, plots.text_colour())
            x, y = p.lost_s, p.past_m
            ax.plot([x.low, x.high], [max(y.value, LEAST_M)] * 2, color=colour, lw=1.0)
            ax.plot([x.value] * 2, [max(y.low, LEAST_M), max(y.high, LEAST_M)], color=colour, lw=1.0)
            bold = policy == WRCD
            ax.plot(x.value, max(y.value, LEAST_M), "*" if policy == KNOWS else "o", color=colour, ms=11 if bold else 7,
                    mec=plots.text_colour() if bold else colour, zorder=4 if bold else 3,
                    label=policy if policy not in TOLD else f"told {liars} %")  # fmt: skip
            if policy in TOLD:
                ax.annotate(f"{TOLD[policy]} %", (x.value, max(y.value, LEAST_M)), fontsize=8, xytext=(4, 4),
                            textcoords="offset points")  # fmt: skip
        ax.set_yscale("symlog", linthresh=1.0)
        ax.set_ylim(bottom=0.0)
        ax.set(xlabel="seconds lost a stop, after who knows the rail", ylabel="mean metres past the mark")
        plots.legend(figure, look, columns=5)
        return figure

    said = "; ".join(f"{n} {p.past_m.value:.1f} m and {p.lost_s.value:.1f} s" for n, p in of.items())
    return Picture(
        "Metres past the mark against seconds lost",
        f"{next(iter(of.values())).stops} stops of every policy, {ABOUT[name]}. Down is safer, left is faster. Lines: "
        "90 % intervals. Seconds are of stops that did not overrun.",
        f"Mean metres past the mark and seconds lost. {said}.", make,
    )  # fmt: skip


def _varied(stops: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The line with most kinds of rail, the first of them."""
    lines: dict[tuple[str, int], list[Mapping[str, Any]]] = {}
    for s in stops:
        lines.setdefault((s["world"], s["line"]), []).append(s)
    return max(lines.values(), key=lambda line: len({s["rail"] for s in line}))


def _line(line: Sequence[Mapping[str, Any]]) -> Picture:
    """Planned rates, metres past and seconds, station by station."""
    at = np.arange(len(line))

    def make(look: PictureLook) -> Drawing:
        figure, axes = plots.fields(look, 3, 2.2, columns=1)
        for k, policy in enumerate(ON_THE_LINE):
            of = [s["policies"][policy] for s in line]
            knows = [s["policies"][KNOWS]["seconds"] for s in line]
            x = at + 0.15 * (k - 2)
            over = [o["past_m"] > OVERRUN_M for o in of]
            axes[0].plot(x, [o["rate_m_s2"] for o in of], "o", color=COLOURS[policy], ms=5, label=policy)
            axes[1].bar(x, [max(o["past_m"], 0.0) for o in of], 0.14, color=COLOURS[policy])
            seconds = [np.nan if late else o["seconds"] - s for o, s, late in zip(of, knows, over, strict=True)]
            axes[2].bar(x, seconds, 0.14, color=COLOURS[policy])
        for ax, label in zip(axes, ("planned, m/s²", "past the mark, m", "seconds lost"), strict=True):
            ax.set_ylabel(label, fontsize=8)
            ax.set_xticks(at, [])
        names = [f"{s['rail']}{', late film' if s['late'] else ''}" for s in line]
        axes[2].set_xticks(at, names, rotation=0 if look.wide else 60, fontsize=8)
        plots.legend(figure, look, columns=5)
        return figure

    first = line[0]
    said = "; ".join(
        f"{s['rail']}: " + ", ".join(f"{p} {max(s['policies'][p]['past_m'], 0.0):.0f} m" for p in ON_THE_LINE)
        for s in line
    )
    return Picture(
        "A line of ten stations",
        f"{first['world']}, line {first['line']}: what each policy planned with, how far past the mark it stood, what "
        "it lost; below, the rail of each approach.",
        f"Metres past the mark, station by station. {said}.", make,
    )  # fmt: skip
