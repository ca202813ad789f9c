"""Bokeh's figures, without data: the script in the browser gives them what is in view."""

from typing import Any

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

from wrcd.tools.report.layout import Curve, Plot

LEFT, RIGHT = 84, 24  # pixels beside the frame, the same for all: plots stand exactly below each other
HATCHES = {"warn": "right_diagonal_line", "bad": "cross", "c3": "dot", "c4": "vertical_line"}  # by class
AXES = {"time": "s", "distance": "km", "age": "ms"}


def item(plot: Plot) -> dict[str, Any]:
    """A figure as BokehJS reads it. Its renderers bear the places of curves; those of strips patterns, and "words"."""
    logarithmic = plot.axis == "age"
    bottom, top = (plot.high, plot.low) if plot.rows else (plot.low, plot.high)  # the first row is the highest
    f = figure(
        height=plot.height,
        sizing_mode="stretch_width",
        x_range=Range1d(start=0.0, end=1.0),
        y_range=Range1d(start=bottom, end=top),
        y_axis_type="log" if logarithmic else "linear",
        toolbar_location=None,
        tools="",
        min_border_left=LEFT,
        min_border_right=RIGHT,
        min_border_top=6,
        border_fill_color=None,
        border_line_color=None,
        lod_threshold=None,
        output_backend="canvas",
    )
    f.xaxis.axis_label = None
    f.xaxis.formatter = PrintfTickFormatter(format=f"%.8g {AXES[plot.axis]}")
    f.xaxis.ticker = AdaptiveTicker()  # as many ticks as the browser has room for
    if not logarithmic:
        f.yaxis.ticker = AdaptiveTicker(desired_num_ticks=5)
    else:
        f.yaxis.formatter = NumeralTickFormatter(format="0[.][000]")
    f.axis.minor_tick_line_color = None
    f.axis.major_label_text_font_size = "12px"
    f.axis.major_label_text_font = "system-ui, sans-serif"
    if plot.rows:
        _strip(f, plot)
    else:
        for place, curve in enumerate(plot.curves):
            _curve(f, curve, str(place))
    found: dict[str, Any] = dict(json_item(f))
    return found


def _curve(f: figure, curve: Curve, name: str) -> None:
    source = ColumnDataSource({"x": [], "y": []})
    if curve.shape == "band":
        f.patch("x", "y", source=source, name=name, fill_alpha=curve.alpha, line_color=None)
    elif curve.shape == "step":
        f.step(
            "x", "y", source=source, name=name, mode="after", line_width=curve.width, line_dash=curve.dash,
            line_alpha=curve.alpha,
        )  # fmt: skip
    else:
        f.line(
            "x", "y", source=source, name=name, line_width=curve.width, line_dash=curve.dash, line_alpha=curve.alpha,
            line_join="bevel",
        )  # fmt: skip


def _strip(f: figure, plot: Plot) -> None:
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
    words = ColumnDataSource({"x": [], "y": [], "text": [], "colour": [], "ground": []})
    glyph = Text(
        x="x", y="y", text="text", text_color="colour", text_font_size="11px", text_baseline="middle",
        text_font=value("system-ui, sans-serif"), background_fill_color="ground",
    )  # fmt: skip
    f.add_glyph(words, glyph, name="words")
    f.yaxis.ticker = FixedTicker(ticks=[i + 0.5 for i in range(len(plot.rows))])
    f.yaxis.major_label_overrides = {i + 0.5: r.label for i, r in enumerate(plot.rows)}
    f.yaxis.major_tick_line_color = None
    f.ygrid.grid_line_color = None
