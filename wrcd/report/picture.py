"""`wrcd report --plot`: a log in one picture, an axle below the other. Drawn with matplotlib (extra report)."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wrcd.core.causes import Validity
from wrcd.core.terms import MODELS
from wrcd.logs.story_events import STALE_AFTER, VALID_PLACE
from wrcd.logs.story_records import AdhesionRecord, Detail, Event, Numbers, Story, StoryAxle, Times, percent
from wrcd.logs.why import CONTACTS

# colours that differ for all eyes (Okabe and Ito), and apart in grey
AVAILABLE, USED, TRUTH = "#0072B2", "#E69F00", "#000000"
MODEL_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7")
VALIDITY_COLOURS = {Validity.VALID: "#B7DFC9", Validity.DEGRADED: "#F2B05E", Validity.NOT_AVAILABLE: "#B5B5B5"}
CONTACT_COLOURS = {"Adhering": "#CFE3F1", "Saturated": "#E58A4A", "Unknown": "#EEEEEE", "": "#EEEEEE"}
WIDTH_IN, DPI = 12.0, 100
MIN_SPAN_S = 0.1  # of the axis: a log may be a single frame
HEIGHTS = (2.6, 0.32, 0.32, 1.5)  # of an axle's rows: adhesion, Validity, contact, residuals
USUAL_PCT = 95.0  # of the interval's upper bounds that the picture has room for
MAX_POINTS = 3000  # of a line: more than a picture has columns of dots
CHARACTER_IN = 0.062  # of the small print
SUFFIXES = (".png", ".svg", ".pdf")
SomeFrames = TypeVar("SomeFrames", AdhesionRecord, Detail)
STYLE: dict[Any, Any] = {
    "font.size": 9, "axes.grid": True, "grid.alpha": 0.25, "legend.fontsize": 8, "legend.framealpha": 0.9,
    "axes.spines.top": False, "axes.spines.right": False, "svg.hashsalt": "wrcd",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Span:
    """What of a log is drawn, in seconds since its first frame."""

    story: Story
    begin_s: float
    end_s: float

    def seconds(self, time_us: Times) -> NDArray[np.float64]:
        return np.asarray((time_us - self.story.begin_us) * 1e-6, dtype=np.float64)

    def rows(self, time_us: Times) -> slice:
        first, end = np.searchsorted(self.seconds(time_us), (self.begin_s, self.end_s))
        return slice(max(int(first) - 1, 0), int(end) + 1)

    def cut(self, begin_us: int, end_us: int) -> tuple[float, float]:
        """The part of a time that is drawn, as begin and length; none: a length of 0 or less."""
        begin = max((begin_us - self.story.begin_us) * 1e-6, self.begin_s)
        return begin, min((end_us - self.story.begin_us) * 1e-6, self.end_s) - begin

    @property
    def inches_per_s(self) -> float:
        return 0.88 * WIDTH_IN / max(self.end_s - self.begin_s, 1e-6)


def draw(story: Story, axles: Sequence[StoryAxle], begin_us: int, end_us: int, output: Path) -> None:
    """Write the picture, of the kind that the suffix says. Raises OSError."""
    span = _Span(story, (begin_us - story.begin_us) * 1e-6, (end_us - story.begin_us) * 1e-6)
    height = sum(HEIGHTS) + 0.55
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, len(axles) * height + 0.9), facecolor="white")
        figure.set_layout_engine("constrained", h_pad=0.02, hspace=0.02)
        panes = figure.subplots(4 * len(axles), 1, sharex=True, squeeze=False, height_ratios=HEIGHTS * len(axles))[:, 0]
        for place, axle in enumerate(axles):
            adhesion, validity, contact, residuals = panes[4 * place : 4 * place + 4]
            _adhesion(adhesion, axle, span)
            _validity(validity, axle, span)
            _contact(contact, axle, span)
            _residuals(residuals, axle, span)
        panes[-1].set_xlim(span.begin_s, max(span.end_s, span.begin_s + MIN_SPAN_S))
        began = datetime.fromtimestamp(story.begin_us * 1e-6, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        panes[-1].set_xlabel(f"seconds after the log's first frame ({began})")
        d = story.config.design
        figure.suptitle(
            f"{story.log.name}: {story.source}; design {d.name} {d.checksum[:12]}", x=0.01, ha="left", fontsize=10
        )
        # a date in the file would make two of one log differ
        dated = {".svg": "Date", ".pdf": "CreationDate"}.get(output.suffix.lower())
        figure.savefig(output, dpi=DPI, metadata={dated: None} if dated else None)


def _adhesion(pane: Axes, axle: StoryAxle, span: _Span) -> None:
    a = broken(axle.adhesion, _cycle_us(span.story, axle.number))
    rows = span.rows(a.time_us)
    t = span.seconds(a.time_us[rows])
    valid = a.validity[rows] == VALID_PLACE
    low, high, available = a.low_pct[rows], a.high_pct[rows], a.available_pct[rows]
    shown_t, least, _ = thinned(t, low)
    _, _, most = thinned(t, high)
    pane.fill_between(shown_t, least, most, color=AVAILABLE, alpha=0.18, linewidth=0, label="its 90 % interval")
    _line(pane, t, np.where(valid, available, np.nan), color=AVAILABLE, linewidth=1.6, label="available, Valid")
    if (~valid & np.isfinite(available)).any():
        _line(pane, t, np.where(valid, np.nan, available), color=AVAILABLE, linewidth=0.8, linestyle=":",
              label="available, not Valid")  # fmt: skip
    _line(pane, t, a.used_pct[rows], color=USED, linewidth=0.9, label="in use")
    if axle.truth is not None:
        own = span.rows(axle.truth.time_us)
        _line(pane, span.seconds(axle.truth.time_us[own]), axle.truth.available_pct[own], color=TRUTH, linewidth=1.0,
              linestyle="--", label="truth")  # fmt: skip
    bound = high[np.isfinite(high)]
    drawn = [np.asarray(line.get_ydata()) for line in pane.get_lines()]
    usual = [np.percentile(bound, USUAL_PCT)] if len(bound) else []
    pane.set_ylim(0, 1.12 * float(np.nanmax(np.concatenate([*drawn, usual, [5.0]]))))
    _falls(pane, axle, span)
    pane.set_ylabel("adhesion, %")
    pane.set_title(f"Axle {axle.number}", loc="left", fontsize=10, fontweight="bold")
    pane.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=5, borderaxespad=0.1, frameon=False)


def _falls(pane: Axes, axle: StoryAxle, span: _Span) -> None:
    """A mark where the level changed for good, and from what to what."""
    free_s = -np.inf
    for f in span.story.falls:
        at_s, length = span.cut(f.begin_us, f.end_us)
        if f.axle != axle.number or length <= 0:
            continue
        pane.axvspan(at_s, at_s + length, color="#D55E00", alpha=0.12, linewidth=0)
        text = f"{at_s:.1f} s: {percent(f.before_pct)} → {percent(f.after_pct)} %"
        width = len(text) * CHARACTER_IN / span.inches_per_s
        begin = min(at_s, span.end_s - width)
        if begin >= free_s:
            pane.text(begin, 0.99, text, transform=pane.get_xaxis_transform(), fontsize=8, va="top", color="#9A3D00")
            free_s = begin + width


def _validity(pane: Axes, axle: StoryAxle, span: _Span) -> None:
    """A strip, with the causes inside where there is room, else below, else left out."""
    free_s, free_below_s = -np.inf, -np.inf
    runs: dict[Validity, list[tuple[float, float]]] = {v: [] for v in Validity}
    for e in axle.spells.events:
        begin, length = span.cut(e.begin_us, e.end_us)
        if length <= 0:
            continue
        runs[e.validity].append((begin, length))
        text = _caption(e)
        width = len(text) * CHARACTER_IN / span.inches_per_s
        if width <= length and begin >= free_s:
            pane.text(begin + 0.5 * length, 0.5, text, ha="center", va="center", fontsize=8, clip_on=True)
        elif e.validity is not Validity.VALID and begin >= free_below_s and begin + width <= span.end_s:
            pane.annotate(text, (begin, 0.0), (0, -2), textcoords="offset points", va="top", fontsize=7.5,
                          color="#7A4A00", annotation_clip=False, zorder=5)  # fmt: skip
            free_below_s = begin + width
    _strip(pane, {VALIDITY_COLOURS[v]: found for v, found in runs.items()}, "Validity")


def _caption(e: Event) -> str:
    return e.validity.value if e.validity is Validity.VALID else f"{e.validity.value}: {e.name}"


def _contact(pane: Axes, axle: StoryAxle, span: _Span) -> None:
    a = broken(axle.adhesion, _cycle_us(span.story, axle.number))
    rows = span.rows(a.time_us)
    time_us, places = a.time_us[rows], a.contact[rows]
    runs: dict[str, list[tuple[float, float]]] = {colour: [] for colour in CONTACT_COLOURS.values()}
    if len(places):
        first = np.concatenate(([0], np.flatnonzero(np.diff(places)) + 1, [len(places)]))
        for a_, b in zip(first[:-1].tolist(), first[1:].tolist(), strict=True):
            word = CONTACTS[int(places[a_])] if places[a_] >= 0 else ""
            end_us = int(time_us[b]) if b < len(time_us) else int(time_us[-1])
            begin, length = span.cut(int(time_us[a_]), end_us)
            if length <= 0:
                continue
            runs[CONTACT_COLOURS[word]].append((begin, length))
            if len(word) * CHARACTER_IN / span.inches_per_s <= length:
                pane.text(begin + 0.5 * length, 0.5, word, ha="center", va="center", fontsize=8, clip_on=True)
    _strip(pane, runs, "contact")


def _strip(pane: Axes, runs: dict[str, list[tuple[float, float]]], label: str) -> None:
    for colour, spans in runs.items():
        pane.broken_barh(spans, (0.0, 1.0), facecolors=colour, linewidth=0, zorder=0.5)
    pane.set_ylim(0, 1)
    pane.set_yticks([])
    pane.grid(visible=False)
    pane.set_ylabel(label, rotation=0, ha="right", va="center")
    for side in pane.spines.values():
        side.set_visible(False)


def _residuals(pane: Axes, axle: StoryAxle, span: _Span) -> None:
    pane.set_ylabel("residual, dB")
    d = axle.detail
    if d is None:
        pane.text(0.01, 0.5, "the log has no AdhesionDetail", transform=pane.transAxes, va="center", fontsize=8)
        return
    own = next(a for a in span.story.config.axles if a.number == axle.number)
    d = broken(d, (own.detail or own.adhesion).cycle_us)
    rows = span.rows(d.time_us)
    t = span.seconds(d.time_us[rows])
    names = span.story.config.design.model_names
    for m in range(MODELS):
        wins = np.where(d.winner[rows] == m + 1, d.residual_db[rows, m], np.nan)
        _line(pane, t, d.residual_db[rows, m], color=MODEL_COLOURS[m], linewidth=0.9, label=f"{m + 1}: {names[m]}")
        _line(pane, t, wins, color=MODEL_COLOURS[m], linewidth=2.6, alpha=0.6)
    handles, labels = pane.get_legend_handles_labels()
    pane.legend(
        handles, labels, loc="upper right", ncols=MODELS, title="model (thick: fits best)", title_fontsize=8
    )  # fmt: skip
    low, high = pane.get_ylim()
    pane.set_ylim(low, high + 0.45 * (high - low))


def _cycle_us(story: Story, number: int) -> int:
    return next(a.adhesion.cycle_us for a in story.config.axles if a.number == number)


def broken(frames: SomeFrames, cycle_us: int) -> SomeFrames:
    """The same frames, with one of nothing where none comes for longer than three cycles: a line ends there."""
    at = np.flatnonzero(np.diff(frames.time_us) > STALE_AFTER * cycle_us) + 1
    if not len(at):
        return frames
    columns = frames.columns()
    nothing = {name: np.nan if c.dtype.kind == "f" else 0 if c.dtype.kind == "b" else -1 for name, c in columns.items()}
    made = {name: np.insert(c, at, nothing[name], axis=0) for name, c in columns.items()}
    made["time_us"] = np.insert(frames.time_us, at, frames.time_us[at - 1] + STALE_AFTER * cycle_us)
    return type(frames)(**made)


def _line(pane: Axes, t: NDArray[np.float64], values: Numbers, **style: Any) -> None:
    shown_t, least, most = thinned(t, values)
    if len(shown_t) == len(t):
        pane.plot(t, values, **style)
    else:
        pane.plot(np.repeat(shown_t, 2), np.stack([least, most], axis=1).ravel(), **style)


def thinned(t: NDArray[np.float64], values: Numbers) -> tuple[NDArray[np.float64], Numbers, Numbers]:
    """Times with the least and the most of a curve; of a long one for every so many points."""
    if len(t) <= 2 * MAX_POINTS:
        return t, values, values
    starts = np.linspace(0, len(t), MAX_POINTS, endpoint=False).astype(np.int64)
    between = np.diff(t)
    gaps = np.flatnonzero(between > 1.5 * np.median(between))  # rows of nothing: of their own, that the line ends
    starts = np.unique(np.concatenate((starts, gaps, gaps + 1)))
    return t[starts], np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)
