"""The score as one page without anything outside it: the tables, and pictures where people would rather look."""

import base64
import html
import io
import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from sim_ecu.score.metrics.accuracy import BINS, judged
from sim_ecu.score.metrics.frames import OURS, gather
from sim_ecu.score.play import Trace
from sim_ecu.score.tables import tables

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 64rem; margin: 2rem auto; padding: 0 1rem; color: #222 }
table { border-collapse: collapse; margin: .6rem 0 1.4rem }
td, th { border: 1px solid #ccc; padding: .15rem .6rem; text-align: right }
td:first-child, th:first-child { text-align: left }
img { max-width: 100% } h2 { margin-top: 2.2rem } .missed { background: #fbd5d0 }
@media (prefers-color-scheme: dark) {
  body { background: #1b1b1b; color: #ddd } img { background: #fff } .missed { background: #702020 }
}
"""


def page(result: dict[str, Any], traces: Sequence[Trace]) -> str:
    """HTML, in English, with pictures inside."""
    by_suite: dict[str, list[Trace]] = {}
    for t in traces:
        by_suite.setdefault(t.suite, []).append(t)
    pictures = []
    if grid := [t for t in by_suite.get("grid", []) if t.group == "mems"]:
        pictures += [
            ("Estimate against truth, grid", _scatter(grid)),
            ("Error by utilisation, grid", _by_utilisation(grid)),
        ]
    if changes := by_suite.get("transitions"):
        pictures.append(("Changes of rail", _changes(changes)))
    body = [f"<h1>How good is the design {html.escape(result['design']['name'])}?</h1>", *_markdown(tables(result))]
    body += [f"<h2>{html.escape(title)}</h2>\n{_image(figure, title)}" for title, figure in pictures]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>sim-ecu score</title>\n'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n<body>\n'
        + "\n".join(body)
        + "\n</body></html>\n"
    )


def _markdown(lines: list[str]) -> list[str]:
    """The few forms that `tables` uses: paragraphs, **a heading**: text, tables."""
    out: list[str] = []
    inside = False
    for line in lines:
        if not line.startswith("|"):
            if inside:
                out.append("</table>")
                inside = False
            if line.startswith("**"):
                name, _, rest = line[2:].partition("**")
                out.append(f"<h2>{html.escape(name)}</h2><p>{html.escape(rest.lstrip(': '))}</p>")
            elif line:
                out.append(f"<p>{html.escape(line)}</p>")
            continue
        cells = [html.escape(c.strip()) for c in line.strip().strip("|").split("|")]
        if set("".join(cells)) <= {"-"}:
            continue
        tag = "td" if inside else "th"
        if not inside:
            out.append("<table>")
            inside = True
        mark = ' class="missed"' if cells[-1] == "MISSED" else ""
        out.append(f"<tr{mark}>" + "".join(f"<{tag}>{c}</{tag}>" for c in cells) + "</tr>")
    return [*out, "</table>"] if inside else out


def _image(figure: Figure, title: str) -> str:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=100)
    plt.close(figure)
    return f'<img alt="{html.escape(title)}" src="data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}">'


def _scatter(traces: list[Trace]) -> Figure:
    f = gather(traces)
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6), sharex=True, sharey=True)
    some = np.random.default_rng(1).permutation(np.flatnonzero(judged(f, OURS)))[:4000]
    for ax, name in zip(axes, (OURS, "torque ratio"), strict=True):
        if name not in f.mu:
            continue
        dots = ax.scatter(f.true[some], f.mu[name][some], c=f.utilisation[some], s=5, cmap="viridis", vmin=0, vmax=1)
        ax.plot([0, 50], [0, 50], color="black", lw=0.8)
        ax.set_xlabel("available, truth, %")
        ax.set_title(name)
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("estimate, %")
    figure.tight_layout()
    figure.colorbar(dots, ax=axes, label="utilisation")
    return figure


def _by_utilisation(traces: list[Trace]) -> Figure:
    f = gather(traces)
    u = f.utilisation
    figure, ax = plt.subplots(figsize=(10, 4.2), layout="constrained")
    middles = [(lo + min(hi, 1.0)) / 2 for lo, hi in itertools.pairwise(BINS)]
    for name in f.mu:
        error, ok = f.errors(name), judged(f, name)
        if ok.any():
            means = [np.mean(error[ok & (u >= lo) & (u < hi)]) for lo, hi in itertools.pairwise(BINS)]
            ax.plot(middles, means, marker="o", lw=2.2 if name == OURS else 1.2, label=name)
    ax.set_xlabel("utilisation: adhesion in use over adhesion available")
    ax.set_ylabel("mean error, percentage points")
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)
    ax.legend()
    return figure


def _changes(traces: list[Trace]) -> Figure:
    curves = list(dict.fromkeys(t.curve for t in traces))
    figure, axes = plt.subplots(len(curves), 1, figsize=(10, 2.1 * len(curves)), sharex=True, layout="constrained")
    for ax, curve in zip(np.atleast_1d(axes), sorted(curves), strict=True):
        part = [t for t in traces if t.curve == curve]
        for t in part:
            ax.plot(t.time_s, t.mu_pct, lw=0.6, alpha=0.6, color="tab:blue")
        ax.plot(part[0].time_s, part[0].true_mu_pct, color="black", lw=1.4)
        ax.set_ylabel(f"{curve}, %")
        ax.set_ylim(0, 60)
        ax.grid(alpha=0.3)
    np.atleast_1d(axes)[-1].set_xlabel("time, s (black: the truth of one of the runs; blue: the estimates of all)")
    return figure
