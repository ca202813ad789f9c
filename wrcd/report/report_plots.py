"""Which plots a page has, as records, and Bokeh's figures of them, without data: the script in the browser gives them
what is in view."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.core.properties import value
from bokeh.embed import json_item
from bokeh.models import (
    AdaptiveTicker,
    ColumnDataSource,
    FixedTicker,
    NumeralTickFormatter,
    PrintfTickFormatter,
    Range1d,
    Text,
)
from bokeh.plotting import figure
from numpy.typing import NDArray

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.vocabulary import words_of
from wrcd.logs.why import CONTACTS, SURFACES
from wrcd.report.data import ALL_MISSING, INPUTS, SOME_MISSING, STALE, PageTable

AGAINST = "against."  # before the names of the other side's tables
INPUT_WORDS = {"yaw": "yaw rate", "lateral": "lateral acc.", "torque": "torque", "speed": "speed"}
MAX_PCT = 100.0  # of adhesion: no plot goes beyond
MAX_COUNTS = 8  # curves of counts
DASHES = ("solid", "dashed", "dotted", "dotdash")
LEFT, RIGHT = 84, 24  # pixels beside the frame, the same for all: plots stand exactly below each other
HATCHES = {"warn": "right_diagonal_line", "bad": "cross", "c3": "dot", "c4": "vertical_line"}  # by class
UNITS = {"time": "s", "distance": "km", "age": "ms"}  # of an axis
FONT = "system-ui, sans-serif"
Values = NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class Curve:
    """A column over its table's times. shape: line, step, band (to the column `upper`)."""

    label: str
    table: str
    column: str
    colour: str  # a variable of page.css
    shape: str = "line"
    dash: str = "solid"
    upper: str = ""
    width: float = 1.5
    alpha: float = 1.0


@dataclass(frozen=True, slots=True)
class StripRow:
    """A line of a strip: codes of a column, each with its word and class (good, warn, none, bad, c0 …)."""

    label: str
    table: str
    column: str
    words: Mapping[int, tuple[str, str]]
    ends: bool = False  # the table has a column `end`, and a block is a row of it


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot. axis: time, distance; age is drawn once, over its own column."""

    key: str
    title: str
    unit: str
    low: float
    high: float
    height: int
    curves: tuple[Curve, ...] = ()
    rows: tuple[StripRow, ...] = ()
    axis: str = "time"
    axle: int = 0


@dataclass(frozen=True, slots=True)
class PagePart:
    """A section of the page that folds."""

    key: str
    title: str
    plots: tuple[Plot, ...]


def parts(tables: Mapping[str, PageTable], axles: Sequence[int], sides: tuple[str, str]) -> list[PagePart]:
    """Return all sections with plots. tables holds those of both sides, the other's with AGAINST before their names."""
    return list(_Plots(tables, axles, sides).parts())


def validity_words() -> dict[int, tuple[str, str]]:
    """Return words and classes by the code of an event's state: Validity times 32 plus cause."""
    words: dict[int, tuple[str, str]] = {}
    for v, (name, css) in enumerate((("NotAvailable", "none"), ("Valid", "good"), ("Degraded", "warn"))):
        words |= {32 * v + int(c): (c.label if c else name, css) for c in Cause}
    return words


class _Plots:
    def __init__(self, tables: Mapping[str, PageTable], axles: Sequence[int], sides: tuple[str, str]) -> None:
        self.tables, self.axles = tables, axles
        self.sides = [p for p in ("", AGAINST) if any(n.startswith(p + "axle") for n in tables)] or [""]
        self.names = dict(zip(("", AGAINST), sides, strict=True))

    def parts(self) -> Iterator[PagePart]:
        rows = [
            StripRow(f"{a}, against" if side else f"axle {a}", f"{side}axle{a}.events", "state", validity_words(), True)
            for a in self.axles
            for side in self.sides
        ]
        yield PagePart("overview", "All axles", self.strip("overview", "Validity and its cause, every axle", rows))
        for a in self.axles:
            if any(n.endswith(f"axle{a}.adhesion") for n in self.tables):
                yield PagePart(f"axle{a}", f"Axle {a}", tuple(self.axle(a)))
        yield PagePart("train", "Train", tuple(self.train()))
        yield PagePart("health", "Faults, rejects, link and reach", tuple(self.health()))
        yield PagePart("delays", "Delays", tuple(self.delays()))
        yield PagePart("bus", "Bus", tuple(self.bus()))

    def label(self, text: str, side: str) -> str:
        return text if len(self.sides) == 1 else f"{text}, {self.names[side]}"

    def values(self, tables: Sequence[str], column: str) -> list[Values]:
        return [self.tables[n][column].values for n in tables if n in self.tables]

    def of_curves(self, curves: Sequence[Curve]) -> list[Values]:
        return [self.tables[c.table][c.column].values for c in curves]

    def strip(self, key: str, title: str, rows: Sequence[StripRow], axle: int = 0) -> tuple[Plot, ...]:
        """Return a plot of the rows whose tables are there; none where there is none."""
        there = tuple(r for r in rows if r.column in self.tables.get(r.table, {}))
        plot = Plot(key, title, "", 0, len(there), 34 + 24 * max(len(there), 1), rows=there, axle=axle)
        return (plot,) if there else ()

    def axle(self, a: int) -> Iterator[Plot]:
        adhesion = [f"{side}axle{a}.adhesion" for side in self.sides]
        truth = [f"{side}axle{a}.truth" for side in self.sides]
        top = _top([*self.values(adhesion, "available"), *self.values(truth, "available")])
        there = [self.tables[n] for n in adhesion if n in self.tables]
        # a band that the plot's edge cuts looks narrower than it is
        ends = [float(np.nanmax(t["available"].values + t["high"].values, initial=0.0)) for t in there]
        top = max(top, min(float(np.ceil(max(ends, default=0.0) / 5.0) * 5.0), MAX_PCT))
        curves: list[Curve] = []
        for side in reversed(self.sides):
            if (table := f"{side}axle{a}.adhesion") in self.tables:
                main, used, dash = ("against", "against-used", "dashed") if side else ("available", "used", "solid")
                curves += [
                    Curve(self.label("90 % interval", side), table, "low", main, "band", upper="high", alpha=0.22),
                    Curve(self.label("in use", side), table, "used", used, dash=dash),
                    Curve(self.label("available", side), table, "available", main, width=2.0),
                ]
        alone = [side for side in self.sides if "MuAvailableOwn" in self.tables.get(f"{side}axle{a}.own", {})][:1]
        curves += [
            Curve(self.label("alone", s), f"{s}axle{a}.own", "MuAvailableOwn", "available", dash="dotted")
            for s in alone
        ]
        true = [side for side in self.sides if f"{side}axle{a}.truth" in self.tables][:1]
        curves += [
            Curve(self.label("truth", s), f"{s}axle{a}.truth", "available", "truth", dash="dashed") for s in true
        ]
        drawn = tuple(curves)
        yield Plot(f"axle{a}.time", "Adhesion against time", "%", 0, top, 260, drawn, axle=a)
        yield from self.states(a)
        yield from self.residuals(a)
        if "distance" in self.tables:
            title = "Adhesion against distance"
            yield Plot(f"axle{a}.distance", title, "%", 0, top, 220, drawn, axis="distance", axle=a)

    def states(self, a: int) -> Iterator[Plot]:
        models = {0: ("none", "none"), **{m: (f"model {m}", f"m{m}") for m in range(1, 5)}}
        rows: list[StripRow] = []
        for side in self.sides:
            own, base = " 2" if side else "", f"{side}axle{a}"
            contacts = dict(enumerate(zip(CONTACTS, ("none", "good", "warn"), strict=True)))
            surfaces = dict(enumerate(zip(SURFACES, ("none", "c0", "c1", "c2", "c3", "c4"), strict=True)))
            rows += [
                StripRow(f"validity{own}", f"{base}.events", "state", validity_words(), True),
                StripRow(f"contact{own}", f"{base}.adhesion", "contact", contacts),
                StripRow(f"surface{own}", f"{base}.adhesion", "surface", surfaces),
                StripRow(f"model{own}", f"{base}.detail", "winner", models),
            ]
        yield from self.strip(f"axle{a}.states", "Validity with its cause, contact, surface, winning model", rows, a)

    def residuals(self, a: int) -> Iterator[Plot]:
        curves: list[Curve] = []
        for side in reversed(self.sides):
            if (table := f"{side}axle{a}.detail") not in self.tables:
                continue
            if not side:
                curves.append(Curve("winner", table, "winning", "winner", width=7.0, alpha=0.35))
            alpha, width = (0.45, 1.0) if side else (1.0, 1.5)
            curves += [
                Curve(self.label(f"model {m}", side), table, f"residual{m}", f"m{m}", dash=DASHES[m - 1], alpha=alpha,
                      width=width)
                for m in range(1, 5)
            ]  # fmt: skip
        if curves:
            low, high = _span(self.of_curves([c for c in curves if c.column != "winning"]))
            title = "Residuals of the four models, the winner's marked"
            yield Plot(f"axle{a}.residuals", title, "dB", low, high, 190, tuple(curves), axle=a)

    def axle_curves(self, kind: str, column: str, shape: str = "line") -> tuple[Curve, ...]:
        return tuple(
            Curve(f"axle {a}", f"axle{a}.{kind}", column, f"a{(a - 1) % 4 + 1}", shape, DASHES[i // 4 % 4])
            for i, a in enumerate(self.axles)
            if f"axle{a}.{kind}" in self.tables
        )

    def train(self) -> Iterator[Plot]:
        if "speed" in self.tables:
            curve = Curve("speed", "speed", "speed_m_s", "available")
            yield Plot("speed", "Speed", "m/s", 0, _top(self.of_curves([curve]), 5.0), 150, (curve,))
        if torques := self.axle_curves("torque", "torque_Nm"):
            low, high = _span(self.of_curves(torques), 1000.0)
            yield Plot("torque", "Torque at the axles", "N m", low, high, 190, torques)

    def health(self) -> Iterator[Plot]:
        codes: dict[int, tuple[str, str]] = {0: ("all came", "good")}
        codes |= {i + 1: (f"refused: {r.value}", "bad") for i, r in enumerate(Reason)}
        codes |= {SOME_MISSING: ("some missing", "warn"), ALL_MISSING: ("silent", "none"), STALE: ("stale", "warn")}
        for a in self.axles:
            rows = [StripRow(INPUT_WORDS[i], f"axle{a}.inputs", i, codes) for i in INPUTS]
            yield from self.strip(f"axle{a}.inputs", f"Inputs of axle {a}: reach and refusals", rows, a)
        states = []
        for table, column, label in (("status", "State", "daemon"), ("link", "LinkState", "link")):
            names = words_of(f"{table}_message", column)
            found = {i: (w, "bad" if i else "good") for i, w in enumerate(names)}
            states.append(StripRow(label, table, column, found))
        yield from self.strip("daemon", "Daemon and link", states)
        if counts := tuple(self.counts()):
            top = max(float(np.nanmax(v, initial=0.0)) for v in self.of_curves(counts)) * 1.1
            yield Plot("counts", "What was counted since the message before", "", 0, max(1.0, top), 170, counts)

    def counts(self) -> Iterator[Curve]:
        """Return counts that have moved, by size."""
        found = [
            (float(np.nansum(column.values)), side, table, name)
            for side in self.sides
            for table in ("rejects", "status", "link")
            for name, column in self.tables.get(side + table, {}).items()
            if name not in ("time", "State", "LastReason", "LinkState", "RejectedFrames")
        ]
        found = sorted((f for f in found if f[0] > 0), key=lambda f: -f[0])
        for i, (_, side, table, name) in enumerate(found[:MAX_COUNTS]):
            plain = "".join(f" {c.lower()}" if c.isupper() else c for c in name.removeprefix("Rejected")).strip()
            label = self.label(f"refused: {plain}" if name.startswith("Rejected") else plain, side)
            yield Curve(label, side + table, name, f"a{i % 4 + 1}", "step", DASHES[i // 4])

    def delays(self) -> Iterator[Plot]:
        if ages := self.axle_curves("adhesion", "age"):
            title = "Age of the oldest measurement at the tick (SampleAge)"
            yield Plot("age", title, "ms", 0, _top(self.of_curves(ages)), 170, ages)
            title = "Distribution of SampleAge: share of frames that are older (powers of ten) against age"
            yield Plot("ages", title, "%", 0.001, 100, 200, self.axle_curves("ages", "share", "step"), axis="age")

    def bus(self) -> Iterator[Plot]:
        for key, title, unit, step in (("rate", "Frames a second", "1/s", 10.0), ("load", "Bus load", "%", 5.0)):
            curves = tuple(
                Curve(self.label(key, s), f"{s}bus", key, "against" if s else "available", "step")
                for s in self.sides
                if f"{s}bus" in self.tables and len(self.tables[f"{s}bus"]["time"].values)
            )
            if curves:
                top = _top(self.of_curves(curves), 10.0, step)
                yield Plot(key, title, unit, 0, min(top, 100.0) if unit == "%" else top, 140, curves)


def _top(columns: Sequence[Values], least: float = 10.0, step: float = 5.0) -> float:
    """Return the upper end of an axis: above all but one in a thousand values."""
    finite = [c[np.isfinite(c)] for c in columns]
    high = max([least, *(float(np.quantile(c, 0.999)) * 1.08 for c in finite if len(c))])
    return float(np.ceil(high / step) * step)


def _span(columns: Sequence[Values], step: float = 5.0) -> tuple[float, float]:
    finite = [v for c in columns if len(v := c[np.isfinite(c)])]
    if not finite:
        return 0.0, step
    low = float(np.floor(min(np.quantile(v, 0.001) for v in finite) / step) * step)
    high = float(np.ceil(max(np.quantile(v, 0.999) for v in finite) / step) * step)
    return (low, high) if high > low else (low - step, high + step)


def item(plot: Plot) -> dict[str, Any]:
    """Return a figure as BokehJS reads it. Its renderers bear the places of curves; those of strips patterns, and
    "words"."""
    logarithmic = plot.axis == "age"
    bottom, top = (plot.high, plot.low) if plot.rows else (plot.low, plot.high)  # the first row is the highest
    f = figure(
        height=plot.height, sizing_mode="stretch_width", x_range=Range1d(start=0.0, end=1.0),
        y_range=Range1d(start=bottom, end=top), y_axis_type="log" if logarithmic else "linear", toolbar_location=None,
        tools="", min_border_left=LEFT, min_border_right=RIGHT, min_border_top=6, border_fill_color=None,
        border_line_color=None, lod_threshold=None, output_backend="canvas",
    )  # fmt: skip
    f.xaxis.axis_label = None
    f.xaxis.formatter = PrintfTickFormatter(format=f"%.8g {UNITS[plot.axis]}")
    f.xaxis.ticker = AdaptiveTicker()  # as many ticks as the browser has room for
    if not logarithmic:
        f.yaxis.ticker = AdaptiveTicker(desired_num_ticks=5)
    else:
        f.yaxis.formatter = NumeralTickFormatter(format="0[.][000]")
    f.axis.minor_tick_line_color = None
    f.axis.major_label_text_font_size = "12px"
    f.axis.major_label_text_font = FONT
    for place, curve in enumerate(plot.curves):
        _draw_curve(f, curve, str(place))
    if plot.rows:
        _draw_strip(f, plot)
    found: dict[str, Any] = dict(json_item(f))
    return found


def _draw_curve(f: figure, curve: Curve, name: str) -> None:
    shared: dict[str, Any] = {"source": ColumnDataSource({"x": [], "y": []}), "name": name}
    line: dict[str, Any] = {"line_width": curve.width, "line_dash": curve.dash, "line_alpha": curve.alpha}
    if curve.shape == "band":
        f.patch("x", "y", **shared, fill_alpha=curve.alpha, line_color=None)
    elif curve.shape == "step":
        f.step("x", "y", **shared, **line, mode="after")
    else:
        f.line("x", "y", **shared, **line, line_join="bevel")


def _draw_strip(f: figure, plot: Plot) -> None:
    patterns = {HATCHES.get(css, "blank") for row in plot.rows for _, css in row.words.values()} | {"blank"}
    for pattern in sorted(patterns):
        blocks = ColumnDataSource({"left": [], "right": [], "top": [], "bottom": [], "colour": []})
        # one pattern for all of its blocks: Bokeh makes a canvas for each of a column of patterns
        f.quad(
            "left", "right", "top", "bottom", source=blocks, name=pattern, fill_color="colour", line_color=None,
            hatch_pattern=None if pattern == "blank" else pattern, hatch_color="#000000",
            hatch_alpha=0.16, hatch_scale=9.0, hatch_weight=2.0,
        )  # fmt: skip
    # each word on its block's plain colour: a pattern's lines go through the letters
    glyph = Text(
        x="x", y="y", text="text", text_color="colour", text_font_size="11px", text_baseline="middle",
        text_font=value(FONT), background_fill_color="ground",
    )  # fmt: skip
    f.add_glyph(ColumnDataSource({n: [] for n in ("x", "y", "text", "colour", "ground")}), glyph, name="words")
    f.yaxis.ticker = FixedTicker(ticks=[i + 0.5 for i in range(len(plot.rows))])
    f.yaxis.major_label_overrides = {i + 0.5: r.label for i, r in enumerate(plot.rows)}
    f.yaxis.major_tick_line_color = None
    f.ygrid.grid_line_color = None
