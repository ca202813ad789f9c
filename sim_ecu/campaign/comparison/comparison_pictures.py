"""The pictures of a comparison: every difference with its interval, and the second's figures over the first's."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sim_ecu.campaign.comparison.compare import BETTER, CHANCE, DIFFERS, SAME, TOO_FEW, WORSE, Comparison, Result
from sim_ecu.campaign.kind import Type
from sim_ecu.reporting.plots import Picture, PictureLook, fields, legend, rows, text_colour

# colours that the colour-blind can distinguish; shapes differ too
MARKS = {
    WORSE: ("#D55E00", "v"), BETTER: ("#0072B2", "^"), DIFFERS: ("#9467BD", "D"), CHANCE: ("0.55", "o"),
    TOO_FEW: ("0.55", "x"), SAME: ("0.55", "|"),
}  # fmt: skip
LEGEND = (WORSE, BETTER, DIFFERS, CHANCE, TOO_FEW, SAME)
MAX_SCATTERS = 6
MAX_DOTS = 4000  # of a suite in a field
SUITE_MARKS = "osD^v<>Pph*X"


def pictures(result: Result) -> Iterator[Picture]:
    """The differences by figure, then the figures that differ most, each over the other side's."""
    names = list(dict.fromkeys(c.figure.name for c in result.comparisons if c.verdict != SAME))
    if names:
        yield _differences(result, names)
    ranked = sorted(names, key=lambda name: min(c.found.p for c in result.comparisons if c.figure.name == name))
    if drawn := [n for n in ranked if any(_drawn(c) for c in _of(result, n))][:MAX_SCATTERS]:
        yield _beside(result, drawn)


def _of(result: Result, name: str) -> list[Comparison]:
    return [c for c in result.comparisons if c.figure.name == name]


def _drawn(c: Comparison) -> bool:
    """Return whether dots show anything: a flag's lie on four places."""
    return c.figure.type is not Type.FLAG and all(map(len, c.values))


def _differences(result: Result, names: Sequence[str]) -> Picture:
    """A field for each figure, a row for each suite."""
    suites = [s.name for s in result.matched.suites]
    share = 100 * (1 - result.alpha)

    def make(look: PictureLook) -> Figure:
        figure, axes = fields(look, len(names), 0.8 + 0.24 * len(suites), margin=0.9, sharey=True)
        for ax, name in zip(axes, names, strict=True):
            _forest(ax, {c.suite: c for c in _of(result, name)}, suites, look)
        shown = {c.verdict for c in result.comparisons if c.figure.name in names}
        legend(figure, look, {v: _handle(v) for v in LEGEND if v in shown}, 6)
        return figure

    parts = [
        f"{c.suite}, {c.figure.name}: {c.found.difference:.3g}, {c.verdict}" for c in result.claims
    ]  # fmt: skip
    return Picture(
        "Differences by figure and suite",
        f"Second less first; lines are {share:g} % intervals, each by itself. Colours and shapes are the corrected "
        "verdicts.",
        f"Differences of {len(names)} figures. " + ("; ".join(parts) or "None is more than chance") + ".", make,
    )  # fmt: skip


def _handle(verdict: str) -> Line2D:
    colour, marker = MARKS[verdict]
    return Line2D([], [], color=colour, marker=marker, ls="none", label=verdict)


def _forest(ax: Axes, of: dict[str, Comparison], suites: Sequence[str], look: PictureLook) -> None:
    for at, suite in enumerate(suites):
        c = of.get(suite)
        if c is None or math.isnan(c.found.difference):
            continue
        colour, marker = MARKS[c.verdict]
        if not math.isnan(c.found.low):
            ax.plot([c.found.low, c.found.high], [at, at], color=colour, lw=1.6)
        ax.plot(c.found.difference, at, marker=marker, color=colour, ms=6)
    figure = next(iter(of.values())).figure
    ax.axvline(0.0, color=text_colour(), lw=0.8)
    rows(ax, suites, look)
    ax.set_title(figure.name, fontsize=10)
    way = {"less": "less is better", "more": "more is better"}.get(figure.better, "")
    ax.set_xlabel("; ".join(part for part in (figure.unit, way) if part), fontsize=9)
    ax.locator_params(axis="x", nbins=5)


def _beside(result: Result, names: Sequence[str]) -> Picture:
    """The second's values over the first's, a dot for each pair; of samples, quantile over quantile."""
    suites = [s.name for s in result.matched.suites]
    paired = all(c.paired for c in result.comparisons)

    def make(look: PictureLook) -> Figure:
        figure, axes = fields(look, len(names), 3.1)
        for ax, name in zip(axes, names, strict=True):
            _dots(ax, _of(result, name), suites)
        handles = {str(h.get_label()): h for ax in axes for h in ax.get_legend_handles_labels()[0]}
        legend(figure, look, {s: handles[s] for s in suites if s in handles}, 6)
        return figure

    what = "a dot is a pair" if paired else "dots are pairs, or quantiles where there are none"
    return Picture(
        "The second over the first", f"On the line both are equal; {what}.",
        f"{', '.join(names)} of the second over those of the first, by suite.", make,
    )  # fmt: skip


def _dots(ax: Axes, comparisons: Sequence[Comparison], suites: Sequence[str]) -> None:
    low, high = math.inf, -math.inf
    for c in comparisons:
        if not _drawn(c):
            continue
        a, b = c.values if c.paired else _quantiles(c)
        if len(a) > MAX_DOTS:
            some = np.random.default_rng(1).permutation(len(a))[:MAX_DOTS]
            a, b = a[some], b[some]
        at = suites.index(c.suite)
        ax.plot(a, b, ls="none", marker=SUITE_MARKS[at % len(SUITE_MARKS)], ms=4, alpha=0.7, color=f"C{at % 10}",
                label=c.suite)  # fmt: skip
        low, high = min(low, float(a.min()), float(b.min())), max(high, float(a.max()), float(b.max()))
    figure = comparisons[0].figure
    ax.axline((low, low), slope=1.0, color=text_colour(), lw=0.8)
    ax.set_title(figure.name, fontsize=10)
    unit = f", {figure.unit}" if figure.unit else ""
    ax.set(xlabel=f"first{unit}", ylabel=f"second{unit}")


def _quantiles(c: Comparison) -> tuple[np.ndarray, np.ndarray]:
    shares = (np.arange(n := min(map(len, c.values))) + 0.5) / n
    return np.quantile(c.values[0], shares), np.quantile(c.values[1], shares)
