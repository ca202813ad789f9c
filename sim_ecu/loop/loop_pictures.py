"""The pictures of the loop's page: distance against slip energy, and a ride over time."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim_ecu.loop import BARE_AND_WITH, CREEP, EVERY, IDEAL, LAWS, THRESHOLDS, WITH
from sim_ecu.loop.comparison_figures import RAILS
from sim_ecu.loop.loop_rides import Drawn, RideResult
from sim_ecu.reporting import plots
from sim_ecu.reporting.plots import Picture, PictureLook

# a law has one colour; hollow without wrcd, full with it
COLOURS = {THRESHOLDS: "tab:blue", CREEP: "tab:orange", IDEAL: "tab:green"}
LAW = {**{law: law for law in LAWS}, **{WITH[law]: law for law in LAWS}, IDEAL: IDEAL}
MARKERS = {THRESHOLDS: "o", CREEP: "s", IDEAL: "*"}
NEWTON = 1e3


def pictures(result: Mapping[str, Any], outcomes: Sequence[RideResult]) -> Iterator[Picture]:
    """The fronts of the suites that differ in the rail, what wrcd changes in the others, and a run of every suite."""
    for suite, cases in result["suites"].items():
        if suite in RAILS:
            yield _fronts(suite, cases)
        else:
            yield _changes(suite, cases)
        of_suite = {o.controller: o for o in outcomes if o.suite == suite and o.drawn is not None}
        if of_suite:
            yield _over_time(suite, of_suite)


def _fronts(suite: str, cases: Mapping[str, Any]) -> Picture:
    """A field for each case: every controller's median with its spread, the bare ones joined, those with wrcd too."""

    def make(look: PictureLook) -> Figure:
        figure, axes = plots.fields(look, len(cases), 2.6)
        for ax, (name, case) in zip(axes, cases.items(), strict=True):
            _front(ax, name, case)
        plots.legend(figure, look, columns=5)
        return figure

    reported = []
    for name, case in cases.items():
        key, unit = ("stop_m", "m") if case["braking"] else ("impulse_kNs", "kN·s")
        each = [
            f"{c} {x[key].median:.0f} {unit} and {x['slip_energy_kJ'].median:.0f} kJ"
            for c, x in case["controllers"].items()
        ]
        reported.append(f"{name}: {', '.join(each)}")
    return Picture(
        f"Distance against wear: {suite}",
        "Down is shorter (where the train pulls: more impulse), left is less slip energy. Signs are medians, lines 5 "
        "to 95 % of the runs; hollow: without wrcd, full: with it. Lines join the two controllers.",
        "Medians of distance or impulse and of slip energy. " + ". ".join(reported) + ".", make,
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
            ax.plot(
                *zip(*(middles[n] for n in names), strict=True), style, color=plots.text_colour(), lw=1.0, alpha=0.8
            )
    ax.set_title(name, fontsize=9)
    ax.set_xlabel("slip energy of a wheel, kJ", fontsize=8)
    ax.set_ylabel("distance, m" if braking else "1000 / impulse, 1/kN·s", fontsize=8)
    ax.tick_params(labelsize=8)
    ax.set_xlim(left=0)


def _changes(suite: str, cases: Mapping[str, Any]) -> Picture:
    """Stopping distance with wrcd over that without, case by case."""
    shown = {name: c["against"] for name, c in cases.items() if c["against"]}

    def make(look: PictureLook) -> Figure:
        figure, ax = plots.single(look, 1.4 + (0.34 if look.wide else 0.45) * len(shown))
        for k, law in enumerate(LAWS):
            for y, a in enumerate(shown.values()):
                at, way = y + (k - 0.5) * 0.3, a[law].way
                ax.plot(a[law].worst, at, "|", color=COLOURS[law], ms=9, mew=1.5)
                plots.interval(ax, at, way, COLOURS[law], MARKERS[law], law if y == 0 else None)
        ax.axvline(1.0, color=plots.text_colour(), lw=0.8)
        ax.axvline(1.03, color=plots.text_colour(), lw=0.8, ls=":")
        plots.rows(ax, list(shown), look)
        ax.set_xlabel("distance with wrcd over that without")
        plots.legend(figure, look)
        return figure

    reported = [f"{name}: " + ", ".join(f"{law} {a[law].way.value:.3f}" for law in LAWS) for name, a in shown.items()]
    return Picture(
        f"What wrcd does to the distance: {suite}",
        "Signs are medians, thick lines their 90 % intervals, strokes the run that loses most. Left of 1 the stop is "
        "shorter; dotted: 3 % longer.",
        "Ratios of stopping distance. " + "; ".join(reported) + ".", make,
    )  # fmt: skip


def _over_time(suite: str, runs: Mapping[str, RideResult]) -> Picture:
    """Speeds, torque and adhesion of one run, of both laws with wrcd and without."""
    names = [n for n in BARE_AND_WITH if n in runs]
    first = runs[names[0]]

    def make(look: PictureLook) -> Figure:
        # wide: a column for each controller; narrow: one below the other
        n, height = len(names), 2.3 if look.wide else 1.7
        figure, axes = plots.fields(look, 3 * n, height, columns=n, margin=0.1, sharey="row" if look.wide else False)
        for k, name in enumerate(names):
            drawn = runs[name].drawn
            assert drawn is not None
            parts = axes[k::n] if look.wide else axes[3 * k : 3 * k + 3]
            _run(parts, name, drawn)
            for ax in parts if k and look.wide else ():
                ax.set_ylabel("")
        plots.legend(figure, look, columns=5)
        return figure

    reported = ", ".join(
        f"{n}: {r.figures.beyond_s:.2f} s beyond the peak, {r.figures.stop_m:.0f} m, {r.figures.slip_energy_kJ:.0f} kJ"
        for n, r in runs.items() if n in EVERY
    )  # fmt: skip
    return Picture(
        f"A run of {suite}: {first.case}",
        "The first seed, its first axle. Time counts from the demand on. Dots are Valid frames of the daemon, the band "
        "is the interval that Confidence claims; without wrcd nobody estimates.",
        f"One run over time. {reported}.", make,
    )  # fmt: skip


def _run(axes: Sequence[Axes], name: str, d: Drawn) -> None:
    speeds, torque, adhesion = axes
    speeds.set_title(name, fontsize=9)
    speeds.plot(d.time_s, d.wheel_m_s, color="tab:orange", lw=0.9, label="wheel")
    speeds.plot(d.time_s, d.speed_m_s, color=plots.text_colour(), lw=1.2, label="train")
    # a wheel that spins away would leave nothing to see of the rest
    speeds.set_ylim(min(0.0, float(d.wheel_m_s.min())), 1.3 * float(d.speed_m_s.max()))
    speeds.set_ylabel("speed, m/s", fontsize=8)
    torque.plot(d.time_s, d.torque_kN_m, color="tab:purple", lw=1.0)
    torque.set_ylabel("torque, kN·m", fontsize=8)
    adhesion.plot(d.time_s, d.available_pct, color="tab:green", lw=1.4, label="adhesion, truth")
    if d.reported is not None:
        t = d.reported
        at = (t.stamps_us[t.valid] - d.demand_us) * 1e-6
        mu, half = t.mu_pct[t.valid], np.minimum(t.half_width_pp[t.valid], 100.0)
        adhesion.vlines(at, np.maximum(mu - half, 0.0), mu + half, color="tab:blue", alpha=0.12, lw=1.5)
        adhesion.plot(at, mu, ".", color="tab:blue", ms=2.5, label="adhesion, Valid")
    top = float(d.available_pct.max())
    adhesion.set_ylim(0.0, min(1.6 * top, 70.0))
    adhesion.set_ylabel("adhesion, %", fontsize=8)
    adhesion.set_xlabel("time, s", fontsize=8)
    for ax in axes:
        ax.tick_params(labelsize=8)
