"""How the figures are drawn: one colour for each model and its curve, the truth black, the estimate purple."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sim_ecu.design.source import Source
from sim_ecu.physics.contact import CURVES, peak, traction_ratio
from sim_ecu.score.figure_data import OFF_PEAK, SATURATED, SETTLED_S, SPEED, Levels, Trace, nearest, own_range
from sim_ecu.score.statements import Statement
from wrcd.estimator.design import MODELS

FloatArray = NDArray[np.float64]

MODEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00")
OTHER_CURVES = ("0.35", "0.6")  # those that no model is designed for
ESTIMATE, TRUTH, USED, PRINTED = "#7B3294", "black", "0.85", "0.5"
SET_STYLES = ("-", "--", ":", "-.")
OWN_RANGE = "what the rules see,\nin own range (0: Low, 1: High)"
MAX_CREEP = 0.10  # of Fig. 1
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "legend.fontsize": 8,
    "legend.framealpha": 0.9,
}


class Drawing:
    """One figure per method; captions gathers what stands under each."""

    def __init__(self, subject: Source, found: Sequence[Statement]) -> None:
        self._s, self._d, self._found = subject, subject.design, found
        paper = subject.design.form == "paper"
        self._seen = "as they are" if paper else f"1 to {MODELS - 1} over residual {MODELS}, and {MODELS} itself"
        self._one = "" if paper else f" over residual {MODELS}"
        self._unit = "residual (1: sensor noise)" if paper else "residual (1: as expected)"
        self.captions: dict[int, str] = {}

    def _new(self, number: int, caption: str, rows: int, columns: int, height: float, **more: Any) -> tuple[
        Figure, NDArray[np.object_]
    ]:  # fmt: skip
        """An empty figure with its caption and its statements' verdicts below."""
        self.captions[number] = caption
        with mpl.rc_context(STYLE):
            figure = Figure(figsize=(9.5, height), layout="constrained")
            axes = figure.subplots(rows, columns, squeeze=False, **more)
        verdicts = [f"  {s.verdict}: {s.says}" for s in self._found if s.figure == number]
        figure.supxlabel("\n".join((f"Fig. {number}: {caption}", *verdicts)), fontsize=8.5, x=0.01, ha="left")
        return figure, axes

    def _label(self, model: int) -> str:
        return f"model {model + 1}: {self._d.model_names[model]}"

    def creep_curves(self) -> Figure:
        """Fig. 1."""
        figure, axes = self._new(
            1, f"creep curves at {SPEED:g} m/s; solid: a model is designed on it; ring: its design point", 1, 1, 5.2
        )
        ax: Axes = axes[0, 0]
        contact = self._s.wheelset.contact
        creep = np.linspace(1e-5, MAX_CREEP, 600)
        colours = {p.curve.name: MODEL_COLOURS[m] for m, p in enumerate(self._s.points)}
        others = iter(OTHER_CURVES * len(CURVES))
        for name, c in sorted(CURVES.items(), key=lambda item: -item[1].mu_0):
            mu = [traction_ratio(x, SPEED, contact, *c.row()) for x in creep]
            designed = name in colours
            ax.plot(
                100 * creep, mu, color=colours[name] if designed else next(others), ls="-" if designed else "--",
                label=f"{name}: {c.surface}, peak {100 * peak(SPEED, contact, *c.row())[1]:.1f} %",
            )  # fmt: skip
        for m, p in enumerate(self._s.points):
            x = p.creep_of_peak * peak(SPEED, contact, *p.curve.row())[0]
            y = traction_ratio(x, SPEED, contact, *p.curve.row())
            ax.plot(100 * x, y, "o", ms=8, mfc="white", mec=MODEL_COLOURS[m], mew=2)
            away = (7, 7) if p.creep_of_peak >= SATURATED else (14, -12)  # where no curve is
            ax.annotate(f"model {m + 1}", (100 * x, y), xytext=away, textcoords="offset points", fontsize=8)
        ax.set(
            xlabel="creepage, %", ylabel="traction ratio μ", xlim=(0, 100 * MAX_CREEP), ylim=(0, 1.3 * ax.dataLim.y1)
        )
        ax.legend(loc="upper right", ncols=3)
        return figure

    def residuals(self, number: int, where: str, runs: Mapping[str, Trace]) -> Figure:
        """Figs. 3 to 5: windowed residuals over time, as they are and within each model's own range; a row per run."""
        n = next(iter(runs.values())).residuals.shape[1]
        figure, axes = self._new(
            number,
            f"residuals with the wheelset held {where} (left) and what the rules see (right: {self._seen});\n"
            f"line: mean of {n} tracks, band: all of them",
            len(runs), 2, 1.6 + 3.4 * len(runs), sharex=True,
        )  # fmt: skip
        for row, (title, trace) in zip(axes, runs.items(), strict=True):
            late = trace.t_s >= self._d.window_s / 2
            for ax, values in zip(row, (np.log10(trace.residuals), trace.own_range), strict=True):
                lines = np.stack([f(values, axis=1) for f in (np.min, np.mean, np.max)])  # (3, k, 4)
                bottom, top = values[late].min(), values[late].max()
                margin = 0.08 * (top - bottom)
                ends = np.array([bottom - margin, top + 2 * margin])
                if ax is row[0]:
                    lines, ends = 10**lines, 10**ends
                for m in range(MODELS):
                    ax.fill_between(trace.t_s, lines[0, :, m], lines[2, :, m], color=MODEL_COLOURS[m], alpha=0.18, lw=0)
                    ax.plot(trace.t_s, lines[1, :, m], color=MODEL_COLOURS[m], label=self._label(m))
                ax.set(xlim=(0, trace.t_s[-1]), ylim=ends)
                ax.set_title(title, fontsize=9)
                self._filling(ax)
            row[0].set(yscale="log", ylabel=self._unit)
            row[1].set(ylabel=OWN_RANGE)
        for ax in axes[-1]:
            ax.set_xlabel("time, s")
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return figure

    def levels(self, saturated: Levels, below: Levels) -> Figure:
        """Fig. 6."""
        figure, axes = self._new(
            6,
            f"residuals (top) and what the rules see (bottom: {self._seen}) over adhesion, "
            "interpolated;\nmarkers: conditions simulated, band: all their windows; the verdicts off the saturation "
            f"points also take {', '.join(f'{share:g}' for share in OFF_PEAK)} of the peak's creep",
            2, 2, 8.0, sharex=True, sharey="row",
        )  # fmt: skip
        contact = self._s.wheelset.contact
        for column, (levels, title) in enumerate(
            ((saturated, "saturated: held at the peak"),
             (below, f"below saturation: held at {below.creep_of_peak:g} of the peak's creep"))
        ):  # fmt: skip
            grid = np.geomspace(levels.adhesion_pct[0], levels.adhesion_pct[-1], 200)
            between = np.array([levels.at(float(mu)) for mu in grid])
            seen_between = np.array([levels.seen_at(float(mu)) for mu in grid])
            places = [own_range(self._d.residual_sets, v) for v in (seen_between, levels.seen_mean, levels.seen)]
            for m in range(MODELS):
                for ax, line, points, windows in (
                    (axes[0, column], between, levels.mean, levels.windows),
                    (axes[1, column], *places),
                ):
                    colour = MODEL_COLOURS[m]
                    low, high = windows[..., m].min(axis=0), windows[..., m].max(axis=0)
                    ax.fill_between(levels.adhesion_pct, low, high, color=colour, alpha=0.18, lw=0)
                    ax.plot(grid, line[:, m], color=colour, label=self._label(m))
                    ax.plot(levels.adhesion_pct, points[:, m], "o", ms=3, color=colour)
            for m, p in enumerate(self._s.points):
                if nearest(p, saturated, below) is levels:
                    mu = 100 * peak(SPEED, contact, *p.curve.row())[1]
                    for ax in axes[:, column]:
                        ax.axvline(mu, color=MODEL_COLOURS[m], lw=1, ls=":")
            axes[0, column].set_title(title, fontsize=9)
            axes[1, column].set(xlabel="available adhesion, %; dotted: design points", xscale="log")
            _plain(axes[1, column], (2, 3, 5, 10, 20, 40))
        axes[0, 0].set(yscale="log", ylabel=self._unit)
        axes[1, 0].set(ylabel=OWN_RANGE)
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return figure

    def sets(self, number: int, model: int, saturated: Levels, below: Levels) -> Figure:
        """Figs. 8, 9: the membership functions of what the rules see of a residual, and where Fig. 6's windows lie."""
        figure, axes = self._new(
            number,
            f"membership functions of residual {model}{self._one}, which is what the rules see, "
            "for all speeds and tracks; below: Fig. 6's windows",
            2, 1, 5.4, sharex=True, gridspec_kw={"height_ratios": [2.2, 1]},
        )  # fmt: skip
        sets, colour = self._d.residual_sets[model - 1], MODEL_COLOURS[model - 1]
        every = [levels.seen[..., model - 1].ravel() for levels in (saturated, below)]
        low, high = min(sets.centres[0], *(v.min() for v in every)), max(sets.centres[-1], *(v.max() for v in every))
        x = np.unique(np.concatenate((np.linspace(low - 0.15, high + 0.15, 400), sets.centres)))
        degrees = sets.memberships(x)
        for j, name in enumerate(sets.names):
            axes[0, 0].plot(10**x, degrees[:, j], color=colour, ls=SET_STYLES[j % len(SET_STYLES)], lw=2, label=name)
        axes[0, 0].set(ylabel="degree of membership", ylim=(0, 1.05), xscale="log")
        axes[0, 0].legend(loc="center right")
        axes[1, 0].hist(
            [10**v for v in every], bins=10 ** np.linspace(x[0], x[-1], 50), stacked=True, color=[colour, "0.65"],
            label=["saturated", "below saturation"],
        )  # fmt: skip
        axes[1, 0].set(
            xlabel=f"residual {model}{self._one}" + ", the sensors' noise taken off" * bool(self._one), ylabel="windows"
        )
        axes[1, 0].legend(loc="upper right")
        _plain(axes[1, 0], (0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50))
        axes[1, 0].set_xlim(10 ** x[0], 10 ** x[-1])
        return figure

    def output(self, printed: Sequence[float]) -> Figure:
        """Fig. 10: what the rules say in the middle of their sets, and what turns the output into adhesion."""
        figure, axes = self._new(
            10,
            "what the rules say in the middle of their sets (beyond 0 and 100: counted at the ends),\n"
            "and the polynomial from fuzzy output to adhesion",
            1, 2, 4.8,
        )  # fmt: skip
        d = self._d
        levels = np.clip(d.bases, 0.0, 100.0)
        axes[0, 0].hist(levels, np.arange(0.0, 105.0, 5.0), color=ESTIMATE, alpha=0.8)
        axes[0, 0].set(xlabel="fuzzy output in the middle of a rule's sets", ylabel="rules", xlim=(0, 100))
        n = np.linspace(0, 100, 401)
        ax: Axes = axes[0, 1]
        ax.plot(n, np.polyval(d.polynomial, n), color=ESTIMATE, lw=2, label="our polynomial")
        ax.plot(n, np.polyval(printed, n), color=PRINTED, ls="--", lw=2, label="(16) as printed")
        ax.axhspan(*d.adhesion_range_pct, color=ESTIMATE, alpha=0.08, lw=0, label="range that we clamp to")
        ax.axhline(0, color="black", lw=0.8)
        ax.set(xlabel="fuzzy output", ylabel="adhesion, %", xlim=(0, 100))
        ax.legend()
        return figure

    def estimate(self, number: int, curve: str, t: Trace) -> Figure:
        """Figs. 11 to 13: fuzzy output and adhesion over time; one track thick, the others thin."""
        figure, axes = self._new(
            number, f"held at the peak of curve {curve}, from the filters' standstill; thick: one track, thin: others",
            2, 1, 6.2, sharex=True,
        )  # fmt: skip
        x, fuzzy, mu = t.t_s, axes[0, 0], axes[1, 0]
        fuzzy.plot(x, t.fuzzy[:, 1:], color=ESTIMATE, lw=0.6, alpha=0.5)
        fuzzy.plot(x, t.fuzzy[:, 0], color=ESTIMATE, lw=1.8)
        fuzzy.set(ylabel="fuzzy output", ylim=(0, 100))
        mu.fill_between(x, t.used_pct[:, 0], color=USED, lw=0, label="in use, truth")
        low, high = (t.mu_pct[:, 0] + sign * t.half_width_pp[:, 0] for sign in (-1, 1))
        mu.fill_between(x, np.maximum(low, 0), high, color=ESTIMATE, alpha=0.2, lw=0, label="90 % interval")
        mu.plot(x, t.mu_pct[:, 1:], color=ESTIMATE, lw=0.6, alpha=0.5)
        mu.plot(x, t.mu_pct[:, 0], color=ESTIMATE, lw=1.8, label="available, estimate")
        mu.plot(x, t.unbounded_pct[:, 0], color=ESTIMATE, lw=1.2, ls=":", label="from the fuzzy output alone")
        mu.plot(x, t.truth_pct[:, 0], color=TRUTH, lw=1.5, label="available, truth")
        late = x >= self._d.window_s
        top = 1.25 * max(np.nanmax(high[late]), np.nanmax(t.mu_pct[late]), t.truth_pct.max())
        mu.set(xlabel="time, s", ylabel="adhesion, %", xlim=(0, x[-1]), ylim=(0, top))
        for ax in (fuzzy, mu):
            self._filling(ax)
        handles, labels = mu.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=5)
        return figure

    def _filling(self, ax: Axes) -> None:
        """Where the window is not full yet and the daemon says NotAvailable; and the paper's two seconds."""
        end = self._d.window_s
        ax.axvline(SETTLED_S, color="0.4", lw=0.8, ls=":")
        ax.axvspan(0, end, facecolor="none", edgecolor="0.88", hatch="//", lw=0, zorder=0)
        ax.text(end / 2, 0.98, "window fills", transform=ax.get_xaxis_transform(), ha="center", va="top", fontsize=7,
                color="0.35", bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip


def _plain(ax: Axes, ticks: Sequence[float]) -> None:
    """Plain numbers at chosen ticks of a logarithmic x axis."""
    ax.set_xticks(ticks, [f"{t:g}" for t in ticks])
    ax.set_xticks([], minor=True)
