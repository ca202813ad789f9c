"""How the paper's figures are drawn: one colour for each model and its curve, the truth black, the estimate purple."""

from collections.abc import Iterator, Mapping
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim_ecu.design.rules import PAPER_POLYNOMIAL
from sim_ecu.physics.contact import CURVES, peak, traction_ratio
from sim_ecu.score.figure_data import (
    LINEAR,
    OVER_TIME,
    SETTLED_S,
    SPEED,
    Data,
    FloatArray,
    HeldTrace,
    nearest,
    own_range,
)
from wrcd.core.terms import MODELS

WIDTH, MARGIN = 10.0, 0.8  # inches; the margin is for what is not in a field
MODEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00")
OTHER_CURVES = ("0.35", "0.6")  # those that no model is designed for
ESTIMATE, TRUTH, USED, PRINTED = "#7B3294", "black", "0.85", "0.5"
SET_STYLES = ("-", "--", ":", "-.")
OWN_RANGE = "what the rules see,\nin own range (0: Low, 1: High)"
MAX_CREEP = 0.10  # of Fig. 1


def draw(d: Data) -> Iterator[tuple[int, str, Figure]]:
    """Yield the figures: number, caption, picture."""
    paper, below = d.subject.design.form == "paper", d.subject.points[-1].creep_of_peak
    seen = "as they are" if paper else f"1 to {MODELS - 1} over residual {MODELS}, and {MODELS} itself"
    yield 1, (
        f"creep curves at {SPEED:g} m/s; solid: a model is designed on it; ring: its design point"
    ), _creep_curves(d)  # fmt: skip
    for number, where, runs in (
        (3, "at the peak of curve A", {"": d.at_peak["A"]}),
        (4, "at the peak of curve C", {"": d.at_peak["C"]}),
        (5, "below the peak of curve A", {
            f"linear region: {LINEAR:g} of the peak's creep": d.linear,
            f"as model 4 is designed: {below:g} of the peak's creep": d.below,
        }),
    ):  # fmt: skip
        yield number, (
            f"residuals with the wheelset held {where} (left) and what the rules see (right: {seen});\n"
            "line: mean of the tracks, band: all of them"
        ), _residuals(d, runs)  # fmt: skip
    yield 6, (
        f"residuals (top) and what the rules see (bottom: {seen}) over adhesion, interpolated;\nmarkers: conditions "
        "simulated, band: all their windows"
    ), _levels(d)  # fmt: skip
    for number, model in ((8, 1), (9, 2)):
        one = f"residual {model}" + f" over residual {MODELS}" * (not paper)
        yield number, (
            f"membership functions of {one}, which is what the rules see, for all speeds and tracks; below: Fig. 6's "
            "windows"
        ), _sets(d, model, one + ", the sensors' noise taken off" * (not paper))  # fmt: skip
    yield 10, (
        "what the rules say in the middle of their sets (beyond 0 and 100: counted at the ends),\n"
        "and the polynomial from fuzzy output to adhesion"
    ), _output(d)  # fmt: skip
    for number, curve in zip((11, 12, 13), OVER_TIME, strict=True):
        yield number, (
            f"held at the peak of curve {curve}, from the filters' standstill; thick: one track, thin: others"
        ), _estimate(d.at_peak[curve], d.subject.design.window_s)  # fmt: skip


def _creep_curves(d: Data) -> Figure:
    """Fig. 1."""
    figure, (ax,) = _fields(1, 5.2)
    contact, points = d.subject.wheelset.contact, d.subject.points
    creep = np.linspace(1e-5, MAX_CREEP, 600)
    colours = {p.curve.name: MODEL_COLOURS[m] for m, p in enumerate(points)}
    others = iter(OTHER_CURVES * len(CURVES))
    for name, c in sorted(CURVES.items(), key=lambda item: -item[1].mu_0):
        mu = [traction_ratio(x, SPEED, contact, *c.row()) for x in creep]
        label = f"{name}: {c.surface}, peak {100 * peak(SPEED, contact, *c.row())[1]:.1f} %"
        ax.plot(100 * creep, mu, "-" if name in colours else "--", color=colours.get(name) or next(others), label=label)
    for m, p in enumerate(points):
        x = p.creep_of_peak * peak(SPEED, contact, *p.curve.row())[0]
        y = traction_ratio(x, SPEED, contact, *p.curve.row())
        ax.plot(100 * x, y, "o", ms=8, mfc="white", mec=MODEL_COLOURS[m], mew=2)
        ax.annotate(f"model {m + 1}", (100 * x, y), xytext=(14, -12), textcoords="offset points", fontsize=8)
    ax.set(xlabel="creepage, %", ylabel="traction ratio μ", xlim=(0, 100 * MAX_CREEP), ylim=(0, None))
    _legend(figure, 3)
    return figure


def _by_model(ax: Axes, d: Data, x: FloatArray, every: FloatArray, mark: str = "-") -> None:
    """Draw a line and a band for each model: mean, least and most of every (places of x, many, models)."""
    for m, (name, colour) in enumerate(zip(d.subject.design.model_names, MODEL_COLOURS, strict=True)):
        values = every[..., m]
        ax.fill_between(x, values.min(axis=1), values.max(axis=1), color=colour, alpha=0.18, lw=0)
        middle = np.exp(np.log(values).mean(axis=1)) if ax.get_yscale() == "log" else values.mean(axis=1)
        ax.plot(x, middle, mark, ms=3, color=colour, label=f"model {m + 1}: {name}")


def _unit(d: Data) -> str:
    return "residual (1: sensor noise)" if d.subject.design.form == "paper" else "residual (1: as expected)"


def _residuals(d: Data, runs: Mapping[str, HeldTrace]) -> Figure:
    """Figs. 3 to 5: windowed residuals over time, as they are and within each model's own range; a row per run."""
    figure, axes = _fields(2 * len(runs), 3.4, columns=2, sharex=True)
    for row, (title, t) in enumerate(runs.items()):
        late = t.t_s >= d.subject.design.window_s / 2
        whole, own = axes[2 * row : 2 * row + 2]
        whole.set(yscale="log", ylabel=_unit(d), ylim=(t.residuals[late].min() / 1.2, 1.2 * t.residuals[late].max()))
        own.set(ylabel=OWN_RANGE, ylim=(t.own_range[late].min() - 0.1, t.own_range[late].max() + 0.2))
        for ax, values in ((whole, t.residuals), (own, t.own_range)):
            _by_model(ax, d, t.t_s, values)
            ax.set(xlim=(0, t.t_s[-1]), xlabel="time, s", title=title)
            _filling(ax, d.subject.design.window_s)
    _legend(figure, 2)
    return figure


def _levels(d: Data) -> Figure:
    """Fig. 6."""
    figure, axes = _fields(4, 3.8, columns=2, sharex=True, sharey="row")
    contact, (_, below) = d.subject.wheelset.contact, d.regions
    titles = "saturated: held at the peak", f"below saturation: held at {below.creep_of_peak:g} of the peak's creep"
    for whole, own, levels, title in zip(axes[:2], axes[2:], d.regions, titles, strict=True):
        whole.set(title=title, yscale="log", ylabel=_unit(d))
        own.set(xlabel="available adhesion, %; dotted: design points", xscale="log", ylabel=OWN_RANGE)
        for ax, windows in ((whole, levels.windows), (own, own_range(d.subject.design.residual_sets, levels.seen))):
            _by_model(ax, d, levels.adhesion_pct, windows.swapaxes(0, 1), "o-")
            for m, p in enumerate(d.subject.points):
                if nearest(p, *d.regions) is levels:
                    mu = 100 * peak(SPEED, contact, *p.curve.row())[1]
                    ax.axvline(mu, color=MODEL_COLOURS[m], lw=1, ls=":")
        own.set_xticks(ticks := (2, 3, 5, 10, 20, 40), [f"{t:g}" for t in ticks])
    _legend(figure, 2)
    return figure


def _sets(d: Data, model: int, what: str) -> Figure:
    """Figs. 8, 9: the membership functions of what the rules see of a residual, and where Fig. 6's windows lie."""
    figure, (top, bottom) = _fields(2, 2.7, columns=1, sharex=True)
    sets, colour = d.subject.design.residual_sets[model - 1], MODEL_COLOURS[model - 1]
    every = [levels.seen[..., model - 1].ravel() for levels in d.regions]
    low, high = min(sets.centres[0], *(v.min() for v in every)), max(sets.centres[-1], *(v.max() for v in every))
    x = np.unique(np.concatenate((np.linspace(low - 0.15, high + 0.15, 400), sets.centres)))
    for j, (name, degree) in enumerate(zip(sets.names, sets.memberships(x).T, strict=True)):
        top.plot(10**x, degree, color=colour, ls=SET_STYLES[j % len(SET_STYLES)], lw=2, label=name)
    top.set(ylabel="degree of membership", ylim=(0, 1.05), xscale="log")
    labels, bins = ["saturated", "below saturation"], 10 ** np.linspace(x[0], x[-1], 50)
    bottom.hist([10**v for v in every], bins=bins.tolist(), stacked=True, color=[colour, "0.65"], label=labels)
    bottom.set(xlabel=what, ylabel="windows", xlim=(10 ** x[0], 10 ** x[-1]))
    _legend(figure, 5)
    return figure


def _output(d: Data) -> Figure:
    """Fig. 10: what the rules say in the middle of their sets, and what turns the output into adhesion."""
    figure, (bars, ax) = _fields(2, 4.8, columns=2)
    design = d.subject.design
    bars.hist(np.clip(design.bases, 0.0, 100.0), list(range(0, 105, 5)), color=ESTIMATE, alpha=0.8)
    bars.set(xlabel="fuzzy output in the middle of a rule's sets", ylabel="rules", xlim=(0, 100))
    n = np.linspace(0, 100, 401)
    ax.plot(n, np.polyval(design.polynomial, n), color=ESTIMATE, lw=2, label="our polynomial")
    ax.plot(n, np.polyval(PAPER_POLYNOMIAL, n), color=PRINTED, ls="--", lw=2, label="(16) as printed")
    ax.axhspan(*design.adhesion_range_pct, color=ESTIMATE, alpha=0.08, lw=0, label="range that we clamp to")
    ax.axhline(0, color="black", lw=0.8)
    ax.set(xlabel="fuzzy output", ylabel="adhesion, %", xlim=(0, 100))
    _legend(figure, 4)
    return figure


def _estimate(t: HeldTrace, window_s: float) -> Figure:
    """Figs. 11 to 13: fuzzy output and adhesion over time; one track thick, the others thin."""
    figure, (fuzzy, mu) = _fields(2, 3.1, columns=1, sharex=True)
    for ax, values, label in ((fuzzy, t.fuzzy, None), (mu, t.mu_pct, "available, estimate")):
        ax.plot(t.t_s, values[:, 1:], color=ESTIMATE, lw=0.6, alpha=0.5)
        ax.plot(t.t_s, values[:, 0], color=ESTIMATE, lw=1.8, label=label)
        _filling(ax, window_s)
    low, high = (t.mu_pct[:, 0] + sign * t.half_width_pp[:, 0] for sign in (-1, 1))
    mu.fill_between(t.t_s, t.used_pct[:, 0], color=USED, lw=0, label="in use, truth")
    mu.fill_between(t.t_s, np.maximum(low, 0), high, color=ESTIMATE, alpha=0.2, lw=0, label="90 % interval")
    mu.plot(t.t_s, t.unbounded_pct[:, 0], color=ESTIMATE, lw=1.2, ls=":", label="from the fuzzy output alone")
    mu.plot(t.t_s, t.truth_pct[:, 0], color=TRUTH, lw=1.5, label="available, truth")
    late = t.t_s >= window_s
    top = 1.25 * max(np.nanmax(high[late]), np.nanmax(t.mu_pct[late]), t.truth_pct.max())
    fuzzy.set(ylabel="fuzzy output", ylim=(0, 100))
    mu.set(xlabel="time, s", ylabel="adhesion, %", xlim=(0, t.t_s[-1]), ylim=(0, top))
    _legend(figure, 5)
    return figure


def _filling(ax: Axes, window_s: float) -> None:
    """Mark where the window is not full yet and the daemon says NotAvailable; and the paper's two seconds."""
    ax.axvline(SETTLED_S, color="0.4", lw=0.8, ls=":")
    ax.axvspan(0, window_s, facecolor="none", edgecolor="0.88", hatch="//", lw=0, zorder=0)
    ax.text(window_s / 2, 0.98, "window fills", transform=ax.get_xaxis_transform(), ha="center", va="top", fontsize=7)


def _fields(n: int, height: float, columns: int = 1, **more: Any) -> tuple[Figure, list[Axes]]:
    """Return a picture of n fields, each so high."""
    rows = n // columns
    figure, axes = plt.subplots(
        rows, columns, figsize=(WIDTH, MARGIN + height * rows), layout="constrained", squeeze=False, **more
    )
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    return figure, list(axes.flat)


def _legend(figure: Figure, columns: int) -> None:
    """Put a legend below the fields: of all labels, each once."""
    found = [ax.get_legend_handles_labels() for ax in figure.axes]
    handles = {name: h for artists, names in found for h, name in zip(artists, names, strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns, frameon=False)
