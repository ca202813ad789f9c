"""The pictures of the score's page."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Drawing

from sim_ecu.reporting import plots
from sim_ecu.reporting.plots import Picture, PictureLook, text_colour
from sim_ecu.score.metrics.accuracy import BINS, OURS, JudgedFrames, gather, judged
from sim_ecu.score.score_play import Trace

MIN_FRAMES = 20  # of which a mean is drawn
MAX_DOTS = 4000


def pictures(result: Mapping[str, Any], traces: Sequence[Trace]) -> Iterator[Picture]:
    """Yield those that the suites played can show."""
    if result["goals"]:
        yield plots.goals(result["goals"])
    if compared := {name: s["compared"] for name, s in result["suites"].items() if _has_means(s)}:
        yield _by_suite(compared)
    of: dict[str, list[Trace]] = {}
    for t in traces:
        of.setdefault(t.suite, []).append(t)
    if (grid := [t for t in of.get("grid", []) if t.group == "mems"]) and judged(f := gather(grid), OURS).any():
        yield _scatter(f)
        yield _by_utilisation(f)
    if changes := of.get("transitions"):
        yield _changes(changes)


def _has_means(suite: Mapping[str, Any]) -> bool:
    compared = suite.get("compared", {})
    return OURS in compared and "mean" in compared[OURS] and bool(compared[OURS]["mean"].count)


def _colours(names: Sequence[str]) -> dict[str, str]:
    """Return a colour for each estimator, the same in every picture."""
    return {OURS: text_colour()} | {n: f"C{k % 10}" for k, n in enumerate(n for n in names if n != OURS)}


def _by_suite(compared: Mapping[str, Mapping[str, Any]]) -> Picture:
    """Return the mean error of every estimator in every suite that compares them."""
    names = list(dict.fromkeys(name for s in compared.values() for name in s))
    means = {
        suite: {name: s[name]["mean"] for name in names if name in s and s[name]["mean"].count}
        for suite, s in compared.items()
    }

    def make(look: PictureLook) -> Drawing:
        figure, ax = plots.single(look, 1.5 + 0.55 * len(compared))
        colours = _colours(names)
        for k, name in enumerate(reversed(names)):
            for y, of in enumerate(means.values()):
                if name in of:
                    at = y + 0.28 * (k / max(len(names) - 1, 1) - 0.5)
                    ours = name == OURS
                    plots.interval(ax, at, of[name], colours[name], "o" if ours else ".", None if y else name, ours)
        plots.rows(ax, list(compared), look)
        ax.set_xscale("log")
        ax.set_xlabel("mean error, percentage points (log scale)")
        plots.legend(figure, look)
        return figure

    words = [f"{suite}: " + ", ".join(f"{name} {m.value:.2f}" for name, m in of.items()) for suite, of in means.items()]
    return Picture(
        "Mean error by suite", "Dots are means, lines their 90 % intervals. Left is better.",
        "Mean errors in percentage points. " + "; ".join(words) + ".", make,
    )  # fmt: skip


def _scatter(f: JudgedFrames) -> Picture:
    """Return estimate over truth, beside that of the simplest baseline."""
    some = np.random.default_rng(1).permutation(np.flatnonzero(judged(f, OURS)))[:MAX_DOTS]
    names = [name for name in (OURS, "torque ratio") if name in f.mu]

    def make(look: PictureLook) -> Drawing:
        height = 4.6 if look.wide else 3.6
        figure, axes = plots.fields(look, len(names), height, margin=0.0, sharex=True, sharey=True)
        for ax, name in zip(axes, names, strict=True):
            dots = ax.scatter(
                f.true[some], f.mu[name][some], c=f.utilisation[some], s=5, cmap="viridis", vmin=0, vmax=1
            )
            ax.plot([0, 50], [0, 50], color=text_colour(), lw=0.8)
            ax.set(title=name, ylabel="estimate, %")
        axes[-1].set_xlabel("available, truth, %")
        figure.colorbar(dots, ax=axes, label="utilisation", location="right" if look.wide else "bottom")
        return figure

    within = {name: float(np.mean(f.errors(name)[some] <= 3.0)) for name in names}
    words = ", ".join(f"{100 * share:.0f} % of those of {name}" for name, share in within.items())
    return Picture(
        "Estimate against truth, grid",
        "Each dot is a Valid frame. On the line it is right; yellow: nearly all of the adhesion is in use.",
        f"{len(some)} Valid frames. Within 3 percentage points of the truth are {words}.", make,
    )  # fmt: skip


def _by_utilisation(f: JudgedFrames) -> Picture:
    """Return the mean error over utilisation, of every estimator."""
    u, bins = f.utilisation, list(itertools.pairwise(BINS))
    middles = [(low + min(high, 1.0)) / 2 for low, high in bins]
    means: dict[str, Sequence[float]] = {}
    for name in f.mu:
        error, ok = f.errors(name), judged(f, name)
        parts = [error[ok & (u >= low) & (u < high)] for low, high in bins]
        means[name] = [float(np.mean(part)) if len(part) >= MIN_FRAMES else float("nan") for part in parts]

    def make(look: PictureLook) -> Drawing:
        labels = "utilisation: adhesion in use over available", "mean error, percentage points"
        return plots.lines(look, middles, means, labels, _colours(list(means)), OURS)

    shown = [f"{x:.2f}: {y:.2f}" for x, y in zip(middles, means[OURS], strict=True) if y == y]
    return Picture(
        "Error by utilisation, grid", "The more of the adhesion is in use, the more the wheelset tells of the rail.",
        f"Mean error of {OURS} in percentage points by utilisation: {', '.join(shown) or 'too few frames'}.", make,
    )  # fmt: skip


def _changes(traces: Sequence[Trace]) -> Picture:
    """Return every run through a change of rail."""
    curves = sorted({t.curve for t in traces})

    def make(look: PictureLook) -> Drawing:
        figure, axes = plots.fields(look, len(curves), 2.1, columns=1, margin=0.0, sharex=True)
        for ax, curve in zip(axes, curves, strict=True):
            part = [t for t in traces if t.curve == curve]
            for t in part:
                ax.plot(t.time_s, t.mu_pct, lw=0.6, alpha=0.6, color="tab:blue")
            ax.plot(part[0].time_s, part[0].true_mu_pct, color=text_colour(), lw=1.4)
            ax.set(ylabel=f"{curve}, %", ylim=(0, 60))
        axes[-1].set_xlabel("time, s")
        return figure

    return Picture(
        "Changes of rail", "Thick: the truth of one of the runs. Blue: the estimates of all.",
        f"{len(traces)} runs from dry rail to curve {', '.join(curves)} and back; the table of transitions has the "
        "delays.", make,
    )  # fmt: skip
