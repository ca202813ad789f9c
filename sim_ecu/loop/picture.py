"""The pictures of the loop's page: distance against slip energy, and a run over time."""

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim_ecu.loop.names import BARE_AND_WITH, CREEP, EVERY, IDEAL, LAWS, THRESHOLDS, WITH
from sim_ecu.loop.play import Drawn, Outcome
from sim_ecu.loop.tables import FULL
from sim_ecu.score.page_pictures import Look, Picture

# a law has one colour; hollow without wrcd, full with it
COLOURS = {THRESHOLDS: "tab:blue", CREEP: "tab:orange", IDEAL: "tab:green"}
LAW = {**{law: law for law in LAWS}, **{WITH[law]: law for law in LAWS}, IDEAL: IDEAL}
MARKERS = {THRESHOLDS: "o", CREEP: "s", IDEAL: "*"}
NEWTON = 1e3
NARROW = 20  # characters of a row's name on a narrow page


def pictures(result: dict[str, Any], outcomes: Sequence[Outcome]) -> Iterator[Picture]:
    """The fronts of the suites that differ in the rail, what wrcd changes in the others, and a run of every suite."""
    for suite, cases in result["suites"].items():
        if suite in FULL:
            yield _fronts(suite, cases)
        else:
            yield _changes(suite, cases)
        of_suite = {o.controller: o for o in outcomes if o.suite == suite and o.drawn is not None}
        if of_suite:
            yield _over_time(suite, of_suite)


def _text() -> str:
    return str(plt.rcParams["text.color"])


def _grid(look: Look, n: int, height: float, columns: int = 3) -> tuple[Figure, Sequence[Axes]]:
    columns = min(columns if look.wide else 1, n)
    rows = math.ceil(n / columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(look.width, 0.8 + height * rows), layout="constrained", squeeze=False
    )
    for ax in axes.flat[n:]:
        ax.set_visible(False)
    return figure, list(axes.flat[:n])


def _fronts(suite: str, cases: Mapping[str, Any]) -> Picture:
    """A field for each case: every controller's median with its spread, the bare ones joined, those with wrcd too."""

    def make(look: Look) -> Figure:
        figure, axes = _grid(look, len(cases), 2.6)
        for ax, (name, case) in zip(axes, cases.items(), strict=True):
            _front(ax, name, case)
        handles = {str(h.get_label()): h for ax in axes for h in ax.get_legend_handles_labels()[0]}
        figure.legend(
            list(handles.values()),
            list(handles),
            loc="outside lower center",
            ncols=5 if look.wide else 2,
            frameon=False,
        )
        return figure

    told = []
    for name, case in cases.items():
        key, unit = ("stop_m", "m") if case["braking"] else ("impulse_kNs", "kN·s")
        each = [
            f"{c} {x[key].median:.0f} {unit} and {x['slip_energy_kJ'].median:.0f} kJ"
            for c, x in case["controllers"].items()
        ]
        told.append(f"{name}: {', '.join(each)}")
    return Picture(
        f"Distance against wear: {suite}",
        "Down is shorter (where the train pulls: more impulse), left is less slip energy. Signs are medians, lines 5 "
        "to 95 % of the runs; hollow: without wrcd, full: with it. Lines join the two controllers.",
        "Medians of distance or impulse and of slip energy. " + ". ".join(told) + ".", make,
    )  # fmt: skip


def _front(ax: Axes, name: str, case: Mapping[str, Any]) -> None:
    braking = case["braking"]
    middles: dict[str, tuple[float, float]] = {}
    for controller, x in case["controllers"].items():
        if controller not in LAW:
            continue
        law = LAW[controller]
        energy, way = x["slip_energy_kJ"], x["stop_m" if braking else "impulse_kNs"]

        def turn(v: float) -> float:
            return v if braking else NEWTON / v

        middles[controller] = at = (energy.median, turn(way.median))
        colour = COLOURS[law]
        ax.plot([energy.low, energy.high], [at[1]] * 2, color=colour, lw=0.8, alpha=0.6)
        ax.plot([at[0]] * 2, [turn(way.low), turn(way.high)], color=colour, lw=0.8, alpha=0.6)
        full = controller in WITH.values() or controller == IDEAL
        ax.plot(
            *at, MARKERS[law], color=colour, mfc=colour if full else "none", ms=9 if law == IDEAL else 7, mew=1.6,
            ls="none", label=controller, zorder=3,
        )  # fmt: skip
    for names, style in ((LAWS, ":"), (tuple(WITH.values()), "-")):
        if all(n in middles for n in names):
            ax.plot(*zip(*(middles[n] for n in names), strict=True), style, color=_text(), lw=1.0, alpha=0.8)
    ax.set_title(name, fontsize=9)
    ax.set_xlabel("slip energy of a wheel, kJ", fontsize=8)
    ax.set_ylabel("distance, m" if braking else "1000 / impulse, 1/kN·s", fontsize=8)
    ax.tick_params(labelsize=8)
    ax.set_xlim(left=0)
    ax.grid(alpha=0.3)


def _changes(suite: str, cases: Mapping[str, Any]) -> Picture:
    """Stopping distance with wrcd over that without, case by case."""
    shown = {name: c["against"] for name, c in cases.items() if c["against"]}

    def make(look: Look) -> Figure:
        figure, ax = plt.subplots(
            figsize=(look.width, 1.4 + (0.34 if look.wide else 0.45) * len(shown)), layout="constrained"
        )
        for k, law in enumerate(LAWS):
            for y, a in enumerate(shown.values()):
                at, way = y + (k - 0.5) * 0.3, a[law].way
                ax.plot([way.low, way.high], [at, at], color=COLOURS[law], lw=2)
                ax.plot(a[law].worst, at, "|", color=COLOURS[law], ms=9, mew=1.5)
                ax.plot(way.value, at, MARKERS[law], color=COLOURS[law], ms=6, label=law if y == 0 else None)
        ax.axvline(1.0, color=_text(), lw=0.8)
        ax.axvline(1.03, color=_text(), lw=0.8, ls=":")
        names = list(shown) if look.wide else [textwrap.fill(name, NARROW) for name in shown]
        ax.set_yticks(range(len(shown)), names, fontsize=8)
        ax.set_ylim(len(shown) - 0.5, -0.5)
        ax.set_xlabel("distance with wrcd over that without")
        ax.grid(alpha=0.3, axis="x")
        figure.legend(loc="outside lower center", ncols=2, frameon=False)
        return figure

    told = [f"{name}: " + ", ".join(f"{law} {a[law].way.value:.3f}" for law in LAWS) for name, a in shown.items()]
    return Picture(
        f"What wrcd does to the distance: {suite}",
        "Signs are medians, thick lines their 90 % intervals, strokes the run that loses most. Left of 1 the stop is "
        "shorter; dotted: 3 % longer.",
        "Ratios of stopping distance. " + "; ".join(told) + ".", make,
    )  # fmt: skip


def _over_time(suite: str, runs: Mapping[str, Outcome]) -> Picture:
    """Speeds, torque and adhesion of one run, of both laws with wrcd and without."""
    names = [n for n in BARE_AND_WITH if n in runs]
    first = runs[names[0]]

    def make(look: Look) -> Figure:
        columns = len(names) if look.wide else 1
        rows = 3 if look.wide else 3 * len(names)
        figure, axes = plt.subplots(
            rows, columns, figsize=(look.width, 7.0 if look.wide else 5.2 * len(names)), layout="constrained",
            squeeze=False, sharex=look.wide, sharey="row" if look.wide else False,
        )  # fmt: skip
        for k, name in enumerate(names):
            parts = axes[:, k] if look.wide else axes[3 * k : 3 * k + 3, 0]
            drawn = runs[name].drawn
            assert drawn is not None
            _run(list(parts), name, drawn)
            if k and look.wide:
                for ax in parts:
                    ax.set_ylabel("")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        more, names_of = (axes[2, -1] if look.wide else axes[-1, 0]).get_legend_handles_labels()
        figure.legend(
            [*handles, *more], [*labels, *names_of], loc="outside lower center", ncols=5 if look.wide else 2,
            frameon=False, fontsize=8,
        )  # fmt: skip
        return figure

    told = ", ".join(
        f"{n}: {r.figures.beyond_s:.2f} s beyond the peak, {r.figures.stop_m:.0f} m, {r.figures.slip_energy_kJ:.0f} kJ"
        for n, r in runs.items() if n in EVERY
    )  # fmt: skip
    return Picture(
        f"A run of {suite}: {first.case}",
        "The first seed, its first axle. Time counts from the demand on. Dots are Valid frames of the daemon, the band "
        "is the interval that Confidence claims; without wrcd nobody estimates.",
        f"One run over time. {told}.", make,
    )  # fmt: skip


def _run(axes: Sequence[Axes], name: str, d: Drawn) -> None:
    speeds, torque, adhesion = axes
    speeds.set_title(name, fontsize=9)
    speeds.plot(d.time_s, d.wheel_m_s, color="tab:orange", lw=0.9, label="wheel")
    speeds.plot(d.time_s, d.speed_m_s, color=_text(), lw=1.2, label="train")
    # a wheel that spins away would leave nothing to see of the rest
    speeds.set_ylim(min(0.0, float(d.wheel_m_s.min())), 1.3 * float(d.speed_m_s.max()))
    speeds.set_ylabel("speed, m/s", fontsize=8)
    torque.plot(d.time_s, d.torque_kN_m, color="tab:purple", lw=1.0)
    torque.set_ylabel("torque, kN·m", fontsize=8)
    adhesion.plot(d.time_s, d.available_pct, color="tab:green", lw=1.4, label="adhesion, truth")
    if d.told is not None:
        t = d.told
        at = (t.stamps_us[t.valid] - d.told_from_us) * 1e-6
        mu, half = t.mu_pct[t.valid], np.minimum(t.half_width_pp[t.valid], 100.0)
        adhesion.vlines(at, np.maximum(mu - half, 0.0), mu + half, color="tab:blue", alpha=0.12, lw=1.5)
        adhesion.plot(at, mu, ".", color="tab:blue", ms=2.5, label="adhesion, Valid")
    top = float(d.available_pct.max())
    adhesion.set_ylim(0.0, min(1.6 * top, 70.0))
    adhesion.set_ylabel("adhesion, %", fontsize=8)
    adhesion.set_xlabel("time, s", fontsize=8)
    for ax in axes:
        ax.tick_params(labelsize=8)
        ax.grid(alpha=0.3)
