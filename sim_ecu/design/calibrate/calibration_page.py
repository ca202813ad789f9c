"""The page of a calibration: measured and fitted spectra, constants, sensors, stretches. It asks nothing of any
network, and has no script."""

import html
import io
from collections.abc import Iterable, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from sim_ecu.design.calibrate.calibration import Calibration
from sim_ecu.design.calibrate.calibration_words import KEYS, WORDS, constants, sensors, to_record, used
from wrcd.fit.stretches import Blocks, ComplexArray
from wrcd.fit.whittle import BogieFit
from wrcd.report.picture import STYLE

COLOURS = ("#0072B2", "#E69F00")  # apart for all eyes (Okabe and Ito)
TICKS_HZ = (1, 2, 5, 10, 15)
GROUPS = 3  # of blocks, by speed
PAIRS = ((0, 2, "yaw rates of both wheelsets"), (0, 1, "yaw rate and acceleration, leading"))
ROWS = ("yaw rate, rad/s per √Hz", "lateral acceleration, m/s² per √Hz", "coherence", "phase, degrees")
CSS = """
body { margin: 0 auto; max-width: 1200px; padding: 0 24px; font: 15px/1.5 system-ui, sans-serif; color: #1d2530 }
table { border-collapse: collapse }
td, th { padding: 2px 14px 2px 0; text-align: left; border-bottom: 1px solid #d5dbe3 }
td.n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }
.bad { color: #a8321a; font-weight: 600 }
svg { max-width: 100%; height: auto }
"""


def page_of(c: Calibration, logs: Sequence[str]) -> str:
    """Return the whole page."""
    verdict = f'<p class="bad">Refused: {html.escape(c.refused)}. No vehicle was written.</p>' if c.refused else ""
    parts = [
        "<!doctype html>", '<html lang="en"><meta charset="utf-8">',
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">",
        f"<title>Calibration</title><style>{CSS}</style>", f"<h1>Calibration from {html.escape(', '.join(logs))}</h1>",
        verdict, *_list("Stretches", [*used(c), *to_record(c)]),
    ]  # fmt: skip
    if c.fit is not None:
        parts += ["<h2>Measured and fitted</h2>", _explained(c.fit), _drawn(c.fit), *_constants(c)]
        parts += _list("Sensors", sensors(c) or ["nothing is wrong with them beyond doubt"])
    return "\n".join(parts) + "\n"


def _list(title: str, items: Iterable[str]) -> list[str]:
    return [f"<h2>{title}</h2><ul>", *(f"<li>{html.escape(item.strip())}</li>" for item in items), "</ul>"]


def _explained(fit: BogieFit) -> str:
    return (
        "<p>Dots: measured. Lines: what the constants below make of the track. Where lines go through the dots in all "
        "rows, believe it; a bend that dots have and lines have not is something that the model lacks. "
        f"{100 * fit.incoherence:.1f} % of the amplitude is explained by neither track nor noise: 3 to 6.5 % in good "
        "fits.</p>"
    )


def _constants(c: Calibration) -> list[str]:
    rows = [
        f'<tr><td>{WORDS[name]}</td><td><code>{name}</code></td><td class="n">{value:.4g}</td>'
        f'<td class="n">{ends}</td><td>{html.escape(KEYS[name].unit)}</td>'
        f"<td{' class=bad' * ('needed' in remark)}>{html.escape(remark)}</td></tr>"
        for name, value, ends, remark in constants(c)
    ]
    head = "<tr><th>constant</th><th>key</th><th>value</th><th>90 % interval</th><th>unit</th><th></th></tr>"
    return ["<h2>Constants</h2>", f"<table>{head}", *rows, "</table>"]


def _drawn(fit: BogieFit) -> str:
    """The picture as SVG."""
    order = np.argsort(fit.blocks.speed_m_s)
    groups = [part for part in np.array_split(order, GROUPS) if len(part)]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(12, 11), layout="constrained")
        axes = figure.subplots(len(ROWS), len(groups), sharex=True, sharey="row", squeeze=False)
        for column, part in zip(axes.T, groups, strict=True):
            v = fit.blocks.speed_m_s[part]
            column[0].set_title(f"{v.min():.1f} to {v.max():.1f} m/s, {fit.blocks.stretches[part].sum():.0f} stretches")
            _column(column, fit.blocks, *(_mean(s, fit, part) for s in (fit.blocks.cross, fit.expected)))
            column[-1].set_xlabel("Hz")
            column[-1].set_xticks(TICKS_HZ, [f"{hz:g}" for hz in TICKS_HZ])
            column[-1].xaxis.set_minor_formatter(NullFormatter())
        for axis, label in zip(axes[:, 0], ROWS, strict=True):
            axis.set_ylabel(label)
        for axis in axes[[0, 2], -1]:
            axis.legend(loc="lower right")
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue().partition("<svg")[1] + text.getvalue().partition("<svg")[2]


def _mean(spectra: ComplexArray, fit: BogieFit, part: np.ndarray[tuple[int], np.dtype[np.intp]]) -> ComplexArray:
    """(F, CHANNELS, CHANNELS): of some blocks, each scaled to one level, so that none outweighs the others."""
    level = np.einsum("bfii->bi", fit.expected[part]).real / spectra.shape[1]
    unit = np.sqrt(level.mean(axis=0) / level)
    scaled = spectra[part] * unit[:, None, :, None] * unit[:, None, None, :]
    return np.asarray(np.average(scaled, axis=0, weights=fit.blocks.stretches[part]))


def _column(axes: Sequence[Axes], blocks: Blocks, measured: ComplexArray, fitted: ComplexArray) -> None:
    f = blocks.frequency_hz
    for k, (name, colour) in enumerate(zip(("leading", "trailing"), COLOURS, strict=True)):
        for quantity in range(2):
            channel = 2 * k + quantity
            for S, style in ((measured, "."), (fitted, "-")):
                density = np.sqrt(2 * blocks.tick_s * S[:, channel, channel].real)
                label = name if style == "-" else None
                axes[quantity].loglog(f, density, style, color=colour, markersize=4, linewidth=1.4, label=label)
    for (i, j, name), colour in zip(PAIRS, COLOURS, strict=True):
        for S, style in ((measured, "."), (fitted, "-")):
            both = S[:, i, j] / np.sqrt(S[:, i, i].real * S[:, j, j].real)
            kwargs = {"color": colour, "markersize": 4, "linewidth": 1.4, "label": name if style == "-" else None}
            axes[2].semilogx(f, np.abs(both), style, **kwargs)
            axes[3].semilogx(f, np.degrees(np.angle(both)), style, **kwargs)
    axes[2].set_ylim(0, 1)
    axes[3].set_ylim(-180, 180)
