"""The pictures of the score's page: each with words for those who do not see it, in a wide and a narrow, a light and a
dark look."""

import io
import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from sim_ecu.score.goals import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW
from sim_ecu.score.metrics.accuracy import BINS, judged
from sim_ecu.score.metrics.frames import OURS, Frames, gather
from sim_ecu.score.play import Trace

MIN_FRAMES = 20  # of which a mean is drawn
MAX_DOTS = 4000


@dataclass(frozen=True, slots=True)
class Look:
    """How wide (inches), and on what."""

    wide: bool
    dark: bool

    @property
    def width(self) -> float:
        """Of the picture, in inches of 10-point text."""
        return 10.0 if self.wide else 4.4


# wide and light is for paper too: the last
LOOKS = (Look(False, True), Look(True, True), Look(False, False), Look(True, False))
DARK = {"figure.facecolor": "#16191c", "axes.facecolor": "#16191c", "savefig.facecolor": "#16191c"}


@dataclass(frozen=True, slots=True)
class Picture:
    """A title, a sentence below it, what it shows in words, and how it is drawn."""

    title: str
    caption: str
    alt: str
    _make: Callable[[Look], Figure]

    def draw(self, look: Look) -> bytes:
        """As PNG."""
        with plt.style.context(["dark_background", DARK] if look.dark else ["default"]):
            figure = self._make(look)
            data = io.BytesIO()
            figure.savefig(data, format="png", dpi=100 if look.wide else 150)
            plt.close(figure)
        return data.getvalue()


def pictures(result: dict[str, Any], traces: Sequence[Trace]) -> Iterator[Picture]:
    """Those that the suites played can show."""
    if result["goals"]:
        yield _goals(result["goals"])
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


def _has_means(suite: dict[str, Any]) -> bool:
    compared = suite.get("compared", {})
    return OURS in compared and "mean" in compared[OURS] and bool(compared[OURS]["mean"].count)


def _text() -> str:
    """The colour of what is neither an estimate nor a verdict."""
    return str(plt.rcParams["text.color"])


def _color(name: str, names: Sequence[str]) -> str:
    """An estimator's, the same in every picture."""
    others = [n for n in names if n != OURS]
    return _text() if name == OURS else f"C{others.index(name) % 10}"


VERDICTS = {
    MET: ("o", "tab:green", "met"), MET_CHANCE: ("P", "tab:olive", "met, within chance"),
    CHANCE: ("D", "tab:orange", "missed, within chance"),
    MISSED: ("X", "tab:red", "missed"), TOO_FEW: ("$?$", "0.55", "too few runs to judge"),
}  # fmt: skip


def _goals(goals: Sequence[dict[str, Any]]) -> Picture:
    """A sign for each goal, by suite."""
    rows: dict[str, list[str]] = {}
    for g in goals:
        rows.setdefault(g["what"].partition(":")[0], []).append(g["verdict"])

    def make(look: Look) -> Figure:
        figure, ax = plt.subplots(figsize=(look.width, 1.1 + 0.3 * len(rows)), layout="constrained")
        for verdict, (marker, color, label) in VERDICTS.items():
            at = [(k, y) for y, row in enumerate(rows.values()) for k, v in enumerate(row) if v == verdict]
            if at:
                x, y = zip(*at, strict=True)
                ax.scatter(x, y, marker=marker, color=color, s=70 if look.wide else 26, label=label)
        ax.set_yticks(range(len(rows)), list(rows))
        ax.set_xticks([])
        ax.set_ylim(len(rows) - 0.5, -0.5)
        ax.spines[["top", "right", "bottom"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=4 if look.wide else 2, frameon=False)
        return figure

    told = []
    for name, row in rows.items():
        n = Counter(row)
        told.append(f"{name}: " + ", ".join(f"{n[v]} {label}" for v, (_, _, label) in VERDICTS.items() if n[v]))
    return Picture(
        "Goals", "A sign for each goal, by suite. The last table says what each is and what was measured.",
        "Verdicts by suite. " + "; ".join(told) + ".", make,
    )  # fmt: skip


def _by_suite(compared: dict[str, dict[str, Any]]) -> Picture:
    """Mean error of every estimator in every suite that compares them."""
    names = list(dict.fromkeys(name for s in compared.values() for name in s))

    def make(look: Look) -> Figure:
        figure, ax = plt.subplots(figsize=(look.width, 1.5 + 0.55 * len(compared)), layout="constrained")
        for k, name in enumerate(reversed(names)):
            ours = name == OURS
            for y, s in enumerate(compared.values()):
                mean = s[name]["mean"] if name in s else None
                if mean is None or not mean.count:
                    continue
                at, color = y + 0.28 * (k / max(len(names) - 1, 1) - 0.5), _color(name, names)
                label = name if y == 0 else None
                ax.plot([mean.low, mean.high], [at, at], color=color, lw=2.5 if ours else 1.0)
                ax.plot(mean.value, at, "o" if ours else ".", color=color, ms=8 if ours else 5, label=label)
        ax.set_yticks(range(len(compared)), list(compared))
        ax.set_ylim(len(compared) - 0.5, -0.5)
        ax.set_xscale("log")
        ax.set_xlabel("mean error, percentage points (log scale)")
        ax.grid(alpha=0.3)
        figure.legend(loc="outside lower center", ncols=4 if look.wide else 2, frameon=False)
        return figure

    told = [
        f"{suite}: " + ", ".join(f"{name} {s[name]['mean'].value:.2f}" for name in names if _counts(s, name))
        for suite, s in compared.items()
    ]
    return Picture(
        "Mean error by suite", "Dots are means, lines their 90 % intervals. Left is better.",
        "Mean errors in percentage points. " + "; ".join(told) + ".", make,
    )  # fmt: skip


def _counts(suite: dict[str, Any], name: str) -> bool:
    return name in suite and bool(suite[name]["mean"].count)


def _scatter(f: Frames) -> Picture:
    """Estimate over truth, beside that of the simplest baseline."""
    some = np.random.default_rng(1).permutation(np.flatnonzero(judged(f, OURS)))[:MAX_DOTS]
    names = [name for name in (OURS, "torque ratio") if name in f.mu]

    def make(look: Look) -> Figure:
        shape = (1, len(names)) if look.wide else (len(names), 1)
        height = 4.6 if look.wide else 3.6 * len(names)
        figure, axes = plt.subplots(
            *shape, figsize=(look.width, height), sharex=True, sharey=True, layout="constrained", squeeze=False
        )
        for ax, name in zip(axes.flat, names, strict=True):
            dots = ax.scatter(
                f.true[some], f.mu[name][some], c=f.utilisation[some], s=5, cmap="viridis", vmin=0, vmax=1
            )
            ax.plot([0, 50], [0, 50], color=_text(), lw=0.8)
            ax.set_title(name)
            ax.set_ylabel("estimate, %")
            ax.grid(alpha=0.3)
        axes.flat[-1].set_xlabel("available, truth, %")
        figure.colorbar(dots, ax=axes, label="utilisation", location="right" if look.wide else "bottom")
        return figure

    within = {name: float(np.mean(f.errors(name)[some] <= 3.0)) for name in names}
    told = ", ".join(f"{100 * share:.0f} % of those of {name}" for name, share in within.items())
    return Picture(
        "Estimate against truth, grid",
        "Each dot is a Valid frame. On the line it is right; yellow: nearly all of the adhesion is in use.",
        f"{len(some)} Valid frames. Within 3 percentage points of the truth are {told}.", make,
    )  # fmt: skip


def _by_utilisation(f: Frames) -> Picture:
    """Mean error over utilisation, of every estimator."""
    u = f.utilisation
    middles = [(low + min(high, 1.0)) / 2 for low, high in itertools.pairwise(BINS)]
    lines: dict[str, list[float]] = {}
    for name in f.mu:
        error, ok = f.errors(name), judged(f, name)
        parts = [error[ok & (u >= low) & (u < high)] for low, high in itertools.pairwise(BINS)]
        lines[name] = [float(np.mean(part)) if len(part) >= MIN_FRAMES else float("nan") for part in parts]

    def make(look: Look) -> Figure:
        figure, ax = plt.subplots(figsize=(look.width, 4.2), layout="constrained")
        for name, means in lines.items():
            ours = name == OURS
            ax.plot(middles, means, marker="o", lw=2.6 if ours else 1.2, label=name, color=_color(name, list(lines)))
        ax.set_xlabel("utilisation: adhesion in use over available")
        ax.set_ylabel("mean error, percentage points")
        ax.set_ylim(bottom=0)
        ax.grid(alpha=0.3)
        figure.legend(loc="outside lower center", ncols=4 if look.wide else 2, frameon=False)
        return figure

    shown = [f"{x:.2f}: {y:.2f}" for x, y in zip(middles, lines[OURS], strict=True) if y == y]
    return Picture(
        "Error by utilisation, grid", "The more of the adhesion is in use, the more the wheelset tells of the rail.",
        f"Mean error of {OURS} in percentage points by utilisation: {', '.join(shown) or 'too few frames'}.", make,
    )  # fmt: skip


def _changes(traces: Sequence[Trace]) -> Picture:
    """Every run through a change of rail."""
    curves = sorted({t.curve for t in traces})

    def make(look: Look) -> Figure:
        figure, axes = plt.subplots(
            len(curves), 1, figsize=(look.width, 2.1 * len(curves)), sharex=True, layout="constrained", squeeze=False
        )
        for ax, curve in zip(axes.flat, curves, strict=True):
            part = [t for t in traces if t.curve == curve]
            for t in part:
                ax.plot(t.time_s, t.mu_pct, lw=0.6, alpha=0.6, color="tab:blue")
            ax.plot(part[0].time_s, part[0].true_mu_pct, color=_text(), lw=1.4)
            ax.set_ylabel(f"{curve}, %")
            ax.set_ylim(0, 60)
            ax.grid(alpha=0.3)
        axes.flat[-1].set_xlabel("time, s")
        return figure

    return Picture(
        "Changes of rail", "Thick: the truth of one of the runs. Blue: the estimates of all.",
        f"{len(traces)} runs from dry rail to curve {', '.join(curves)} and back; the table of transitions has the "
        "delays.", make,
    )  # fmt: skip
