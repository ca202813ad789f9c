"""Bars of classes as SVG within a page: no picture file, no script."""

import html
import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sim_ecu.campaign.fleet.classes import CLASSES, FloatArray, N, merged

MAX_COLUMNS = 48  # of a log's bar: more are narrower than can be seen
HEIGHT = 100
# from the bottom: the most slippery lies on the line where it is looked for; not Valid on top
ORDER = (*reversed(range(N - 1)), N - 1)
CSS = tuple(f"c{k}" for k in range(N - 1)) + ("nv",)  # by place in CLASSES


def steps_of(detail: Mapping[str, Any]) -> tuple[str, FloatArray]:
    """What a column stands for, and (n, N) all axles' metres by class; seconds where the train did not move."""
    axles: Sequence[Mapping[str, Any]] = detail["axles"]
    of, step, unit = ("way", "step_m", "m") if any(a["way"] for a in axles) else ("time", "step_s", "s")
    rows = [a for a in axles if a[of]]
    if not rows:
        return "", np.zeros((0, N))
    width = float(rows[0][step])  # that of all axles of a log
    n = max(len(a[of]) for a in rows)
    sums = np.zeros((n, N))
    for a in rows:
        sums[: len(a[of])] += np.array(a[of], dtype=np.float64)
    many = -(-n // MAX_COLUMNS)
    return _words(width * many, unit), merged(sums, many)


def _words(width: float, unit: str) -> str:
    if unit == "m":
        return f"{width / 1000:g} km" if width >= 1000 else f"{width:g} m"
    return f"{width / 60:g} min" if width >= 60 else f"{width:g} s"


def columns(detail: Mapping[str, Any]) -> str:
    """A column for each step of a log, each class its share of it."""
    width, sums = steps_of(detail)
    totals = sums.sum(axis=1, keepdims=True)
    if not len(sums) or not totals.any():
        return ""
    shares = np.divide(sums, totals, out=np.zeros_like(sums), where=totals > 0)[:, ORDER]
    tops = np.round(HEIGHT * np.cumsum(shares, axis=1)).astype(int)
    parts = []
    for k, of in enumerate(ORDER):
        low = tops[:, k - 1] if k else np.zeros(len(tops), int)
        path = "".join(_runs(low.tolist(), tops[:, k].tolist()))
        if path:
            parts.append(f'<path class="{CSS[of]}" d="{path}"/>')
    label = f"a column for each {width}, {spoken(sums.sum(axis=0))}"
    return _svg(len(sums), HEIGHT, "".join(parts), label, "columns")


def _runs(lows: Sequence[int], tops: Sequence[int]) -> list[str]:
    """Rectangles of neighbouring columns that are alike, as a path."""
    out, x = [], 0
    for (low, top), group in itertools.groupby(zip(lows, tops, strict=True)):
        width = len(list(group))
        if top > low:
            out.append(f"M{x} {HEIGHT - top}h{width}v{top - low}h-{width}z")
        x += width
    return out


def share_bar(sums: FloatArray) -> str:
    """One bar, each class (N,) its share of it."""
    total = float(sums.sum())
    if not total > 0:
        return ""
    x, parts = 0.0, []
    for of in ORDER:
        width = 1000 * float(sums[of]) / total
        if width:
            parts.append(f'<rect class="{CSS[of]}" x="{x:.1f}" width="{width:.1f}" height="10"/>')
        x += width
    return _svg(1000, 10, "".join(parts), spoken(sums), "bar")


def spoken(sums: FloatArray) -> str:
    """Shares of the classes in words, those that there are."""
    total = float(sums.sum())
    return ", ".join(f"{CLASSES[of]} {_share(sums[of] / total)}" for of in ORDER if total and sums[of] > 0)


def _share(share: float) -> str:
    return "< 1 %" if share < 0.01 else f"{100 * share:.0f} %"


def legend() -> str:
    """The colours by name, from the most slippery on."""
    keys = "".join(f'<li><span class="key {CSS[of]}"></span>{html.escape(CLASSES[of])}</li>' for of in ORDER)
    return f'<ul class="legend" aria-label="Colours">{keys}</ul>'


def _svg(width: int, height: int, inner: str, label: str, css: str) -> str:
    return (
        f'<svg class="{css}" viewBox="0 0 {width} {height}" preserveAspectRatio="none" role="img" '
        f'aria-label="{html.escape(label)}">{inner}</svg>'
    )
