"""The whole screen: what of a model is looked at, where everything is, and model and view to a canvas."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.logs.story_records import Numbers, Times
from wrcd.monitor.bus_model import AxleModel, BusModel
from wrcd.monitor.canvas import (
    SHADE,
    SPANS_S,
    STEPS,
    TRUTH,
    Canvas,
    PlotTimes,
    Rect,
    carried,
    draw_area,
    draw_band,
    draw_line,
    draw_marks,
    extremes,
    line_of,
    top_of,
    window,
)
from wrcd.monitor.history import Happening, duration, event_text, percent
from wrcd.monitor.panels import (
    AxleNow,
    Cell,
    SourceState,
    axle_at,
    draw_axles,
    draw_inputs,
    draw_residuals,
    draw_status,
    draw_strip,
    state_of,
)

KEYS_LINE = "space pause  ←→ cursor  +- zoom  n/p event  w why  1-8 axle  ? help  q quit  s save  e events  t colours"
DEFAULT_SPAN_S = 30
CARRY_US = 100_000  # a value stands for so long in the plot, where frames are further apart than its columns
RECENT_EVENTS = 200  # that the newest happenings are looked for among
TIME_STEPS_S = (0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600, 7200, 1e9)
MIN_WIDTH, MIN_HEIGHT = 60, 19
LEFT, RIGHT = 5, 20  # of the plot: scale, and values beside the curves
MIN_PLOT = 5
BOTTOM = 5  # residuals beside inputs, with their heads
WIDE = 120  # from here on there is more room beside the curves


@dataclass(slots=True)
class ScreenView:
    """What is looked at: which axle, until when, how far back, and where the cursor is. now_us and begin_us of the
    model go in with every question: a view has no time of its own."""

    axle: int = 0  # its place
    span_s: int = DEFAULT_SPAN_S
    paused_us: int | None = None  # the time that is held; None: live
    cursor_us: int | None = None
    end_us: int | None = None  # of the plot, where it was scrolled

    @property
    def is_live(self) -> bool:
        """Whether the screen moves on with time."""
        return self.paused_us is None

    def now_us(self, now_us: int) -> int:
        """Return the newest time that is shown."""
        return now_us if self.paused_us is None else self.paused_us

    def at_us(self, now_us: int) -> int:
        """Return the time whose values are shown: the cursor's, else the newest."""
        return self.now_us(now_us) if self.cursor_us is None else self.cursor_us

    def window(self, now_us: int, cells: int) -> PlotTimes:
        """Return the plot's times."""
        end_us = self.now_us(now_us) if self.end_us is None else self.end_us
        return window(end_us, self.span_s * 1_000_000, cells)

    def pause(self, now_us: int) -> None:
        """Hold the screen. What comes is kept."""
        if self.paused_us is None:
            self.paused_us = now_us

    def resume(self) -> None:
        """Be live again, without a cursor."""
        self.paused_us = self.cursor_us = self.end_us = None

    def move(self, cells: int, now_us: int, begin_us: int, width: int) -> None:
        """Move the cursor by cells of a plot of so many; one at its edge takes the plot with it."""
        self.pause(now_us)
        self.go(self.at_us(now_us) + cells * self.window(now_us, width).cell_us, now_us, begin_us, width)

    def go(self, at_us: int, now_us: int, begin_us: int, width: int) -> None:
        """Put the cursor to a time, and the plot to where it can be seen."""
        self.pause(now_us)
        self.cursor_us = max(begin_us, min(at_us, self.now_us(now_us)))
        w = self.window(now_us, width)
        if not w.begin_us <= self.cursor_us < w.end_us:
            ahead = w.cell_us * w.cells // 4
            self.end_us = min(self.cursor_us + ahead, self.now_us(now_us))
        if self.cursor_us < (w := self.window(now_us, width)).begin_us:  # the end of what there is lies too far off
            self.end_us = self.cursor_us + w.cell_us * w.cells

    def zoom(self, closer: bool, now_us: int, width: int) -> None:
        """Show less or more time, around the cursor where there is one."""
        place = next((k for k, s in enumerate(SPANS_S) if s >= self.span_s), len(SPANS_S) - 1)
        place = max(0, min(place + (-1 if closer else 1), len(SPANS_S) - 1))
        if self.cursor_us is not None:
            w = self.window(now_us, width)
            behind = max(w.end_us - self.cursor_us, 0) / max(w.end_us - w.begin_us, 1)
            self.end_us = min(self.cursor_us + round(behind * SPANS_S[place] * 1e6), self.now_us(now_us))
        self.span_s = SPANS_S[place]

    def jump(
        self, found: Sequence[Happening], forward: bool, now_us: int, begin_us: int, width: int
    ) -> Happening | None:
        """Go to the next or the last happening, without a cursor to the newest. Returns it, if there is one."""
        if self.cursor_us is None:
            there = [h for h in found if h.time_us <= self.now_us(now_us)][-1:]
        elif forward:
            there = [h for h in found if self.cursor_us < h.time_us <= self.now_us(now_us)][:1]
        else:
            there = [h for h in found if h.time_us < self.cursor_us][-1:]
        if not there:
            return None
        self.go(there[0].time_us, now_us, begin_us, width)
        return there[0]


@dataclass(frozen=True, slots=True)
class PanelPlaces:
    """Where everything is on a screen of a size."""

    status: Rect
    axles: Rect  # its head, and a line an axle
    plot: Rect  # the curves alone
    legend: Rect  # right of them
    scale: Rect  # the line of times
    strip: Rect  # the line of Validity
    events: Rect
    residuals: Rect
    inputs: Rect
    keys: Rect


def layout(width: int, height: int, axles: int, inputs: int) -> PanelPlaces | None:
    """Return the places, or None where the screen is too small."""
    if width < MIN_WIDTH or height < MIN_HEIGHT:
        return None
    bottom = max(BOTTOM, 1 + inputs) if height >= 30 else BOTTOM
    spare = height - 2 - 2 - MIN_PLOT - 3 - 1 - bottom - 1  # status, head, one axle, plot with its lines, event, keys
    shown = 1 + max(0, min(axles - 1, spare - 1 if axles > 4 else spare))
    spare -= shown - 1
    events = 1 + max(0, min(spare // 4, 9))
    spare -= events - 1
    right = RIGHT if width < WIDE else RIGHT + 6
    plot = Rect(LEFT, 4 + shown, width - LEFT - right, MIN_PLOT + max(spare, 0))  # below its own head
    y = plot.y + plot.height
    half, below = max(34, min(width * 2 // 5, 60)), y + 2 + events
    return PanelPlaces(
        Rect(0, 0, width, 2), Rect(0, 2, width, 1 + shown), plot, Rect(width - right, plot.y, right, plot.height),
        Rect(LEFT, y, plot.width, 1), Rect(LEFT, y + 1, plot.width, 1), Rect(0, y + 2, width, events),
        Rect(0, below, half, bottom), Rect(half + 1, below, width - half - 1, bottom), Rect(0, height - 1, width, 1),
    )  # fmt: skip


class Board:
    """Draws a model as a view has it."""

    def __init__(self, model: BusModel, view: ScreenView) -> None:
        self.model, self.view = model, view
        self.plot_width = 60

    def happenings(self) -> list[Happening]:
        """Return what happened to the chosen axle."""
        return self.axle.history.happenings(self.view.now_us(self.model.now_us))

    @property
    def axle(self) -> AxleModel:
        """The chosen one; before it has come the first of those that have."""
        chosen, shown = self.model.axles[self.view.axle], self.model.axles_that_came
        return chosen if chosen in shown else shown[0]

    def draw(self, width: int, height: int, source: SourceState, note: str = "") -> Canvas:
        """Return the screen of a size. note: what a key has just done."""
        canvas = Canvas(width, height)
        model, view, axle = self.model, self.view, self.axle
        at_us = view.at_us(model.now_us)
        inputs = model.inputs_at(axle, at_us)
        shown = model.axles_that_came
        hidden = len(model.axles) - len(shown)
        places = layout(width, height, len(shown) + (hidden > 0), len(inputs))
        if places is None:
            text = f"needs {MIN_WIDTH} columns and {MIN_HEIGHT} lines; this is {width} by {height}"
            canvas.put(0, 0, text, "warn")
            return canvas
        self.plot_width = places.plot.width
        draw_status(canvas, places.status, model, source, self._mode(source), self.clock(at_us), at_us)
        axles = [axle_at(model, a, at_us, view.now_us(model.now_us)) for a in shown]
        chosen = shown.index(axle)
        draw_axles(canvas, places.axles, axles, chosen, hidden)
        self._draw_plot(canvas, places, axles[chosen])
        self._draw_events(canvas, places.events, note)
        draw_residuals(canvas, places.residuals, axle, model.config.design.model_names, at_us)
        draw_inputs(canvas, places.inputs, inputs)
        x = 0
        for part in KEYS_LINE.split("  "):
            key, _, what = part.partition(" ")
            if x + len(part) > width:
                break
            x = canvas.put(x, places.keys.y, key, "key")
            x = canvas.put(x, places.keys.y, f" {what}", "dim") + 2
        return canvas

    def _mode(self, source: SourceState) -> Cell:
        if source.kind == "log":
            return "LOG", "log"
        if self.view.is_live:
            return "LIVE", "live"
        behind = (self.model.now_us - self.view.at_us(self.model.now_us)) / 1e6
        return f"PAUSED {duration(max(behind, 0.0))} ago", "paused"

    def seconds(self, at_us: int) -> float:
        """Return a time in seconds from the first frame."""
        return (at_us - (self.model.begin_us or 0)) / 1e6

    def clock(self, at_us: int) -> str:
        """Return a time: seconds from the first frame, and of day."""
        if self.model.begin_us is None:
            return ""
        day = time.strftime("%H:%M:%S", time.localtime(at_us // 1_000_000))
        return f"{self.seconds(at_us):.1f} s  {day}"

    def _draw_plot(self, canvas: Canvas, places: PanelPlaces, now: AxleNow) -> None:
        rect, axle, view = places.plot, self.axle, self.view
        w = view.window(self.model.now_us, rect.width)
        newest_us = view.now_us(self.model.now_us)
        a, truth = axle.held.adhesion, axle.held.truth

        def steps(times: Times, values: Numbers, of_cell: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            end, step_us = int(np.searchsorted(times, newest_us, side="right")), w.cell_us // of_cell
            low, high = extremes(times[:end], values[:end], w.begin_us, step_us, of_cell * rect.width)
            carry = math.ceil(2 * CARRY_US / w.cell_us)
            carry = carry if of_cell == 2 else carry // 2 + 1
            return carried(low, carry), carried(high, carry)

        low, high = steps(a.time_us, a.available_pct, 2)
        used = steps(a.time_us, a.used_pct)[1]
        true = np.full(rect.width, np.nan) if truth is None else steps(truth.time_us, truth.available_pct)[0]
        top = top_of(max((float(np.nanmax(c)) for c in (high, used, true) if np.isfinite(c).any()), default=0.0))
        draw_band(canvas, rect, steps(a.time_us, a.low_pct)[0], steps(a.time_us, a.high_pct)[1], top, "interval")
        draw_area(canvas, rect, used, top, "used")
        draw_marks(canvas, rect, true, top, "truth")
        draw_line(canvas, rect, low, high, top, "available")
        self._draw_scales(canvas, places, w, top)
        self._draw_legend(canvas, places.legend, now, top)
        if view.cursor_us is not None and 0 <= (x := w.column(view.cursor_us)) < rect.width:
            canvas.invert(rect.x + x, Rect(rect.x, rect.y, rect.width, rect.height + 1))
            label = self.clock(view.cursor_us).split("  ")[0]
            x = min(max(rect.x + x - len(label) // 2, rect.x), rect.x + rect.width - len(label))
            canvas.put(x, places.scale.y, label, "cursor")
        draw_strip(canvas, places.strip, axle.history.events(w.begin_us, w.end_us, newest_us), w.begin_us, w.cell_us)
        for f in axle.history.falls(newest_us):
            if 0 <= (x := w.column((f.begin_us + f.end_us) // 2)) < rect.width:
                canvas.put(rect.x + x, places.strip.y, "▼" if f.is_down else "▲", "title")
        canvas.put(0, places.strip.y, "state", "label", rect.x)

    def _draw_scales(self, canvas: Canvas, places: PanelPlaces, w: PlotTimes, top: float) -> None:
        rect, head = places.plot, places.plot.y - 1
        x = canvas.put(0, head, f"axle {self.axle.number}, %", "label") + 2
        for text, style in (("⠒⠒ available", "available"), (f"{SHADE}{SHADE} its interval", "interval"),
                            ("▄▄ in use", "used"), (f"{TRUTH}{TRUTH} truth", "truth")):  # fmt: skip
            if style != "truth" or self.model.has_truth:
                sample, _, name = text.partition(" ")
                x = canvas.put(x, head, sample, style) + 1
                x = canvas.put(x, head, name, "dim" if style == "interval" else style) + 2
        span = f"{duration(self.view.span_s).replace('.0', '')} wide"
        canvas.put_right(canvas.width, head, span, "dim")
        steps = STEPS[top] if rect.height >= 2 * STEPS[top] else 2 if top > 5 else 1
        for k in range(steps + 1):
            value = top * k / steps
            y = rect.y + rect.height - 1 if k == 0 else int(line_of(np.array([value]), top, rect.height)[0]) + rect.y
            canvas.put_right(rect.x - 1, y, f"{value:.4g}", "dim")
            canvas.put(rect.x - 1, y, "┤", "dim")
        canvas.put(rect.x, places.scale.y, "─" * rect.width, "dim")
        begin_us = self.model.begin_us or 0
        step_s = next(s for s in TIME_STEPS_S if s * 1e6 / w.cell_us >= 11)
        first = max(math.ceil((w.begin_us - begin_us) / 1e6 / step_s), 0)
        for k in range(first, first + rect.width):
            x = w.column(begin_us + round(k * step_s * 1e6))
            if x >= rect.width - 6:
                break
            canvas.put(rect.x + x, places.scale.y, f"┴{k * step_s:g} s", "dim")

    def _draw_legend(self, canvas: Canvas, rect: Rect, now: AxleNow, top: float) -> None:
        """Draw the value now, or at the cursor, beside each curve."""
        wanted = [
            (now.available_pct, f"◀ {percent(now.available_pct)} available", "available"),
            (now.used_pct, f"◀ {percent(now.used_pct)} in use", "used"),
        ]
        if math.isfinite(now.truth_pct):
            wanted.append((now.truth_pct, f"◀ {percent(now.truth_pct)} truth", "truth"))
        if math.isfinite(now.low_pct) and math.isfinite(now.high_pct):
            wanted.append((now.available_pct - 1e-6, f"  {now.interval}", "dim"))
        wanted.sort(key=lambda w: -w[0] if math.isfinite(w[0]) else math.inf)
        lines = [
            int(line_of(np.array([v]), top, rect.height)[0]) if math.isfinite(v) else rect.height - 1
            for v, _, _ in wanted
        ]
        for k in range(1, len(lines)):
            lines[k] = max(lines[k], lines[k - 1] + 1)
        most = rect.height - 1
        for k in range(len(lines) - 1, -1, -1):
            lines[k] = min(lines[k], most)
            most = lines[k] - 1
        for line, (_, text, style) in zip(lines, wanted, strict=True):
            canvas.put(rect.x, rect.y + line, text, style, rect.width)

    def _draw_events(self, canvas: Canvas, rect: Rect, note: str) -> None:
        history, now_us = self.axle.history, self.view.now_us(self.model.now_us)
        lines: list[Cell] = [(f"» {note}", "title")] if note else []
        event = history.at(self.view.at_us(self.model.now_us), now_us)
        if event is not None:
            lines.append((f"since {self.seconds(event.begin_us):.1f} s: {event_text(event)}", state_of(event)[2]))
        for h in reversed(history.happenings(now_us, RECENT_EVENTS)):
            mark = "▶" if self.view.cursor_us == h.time_us else " "
            lines.append((f"{mark}{self.seconds(h.time_us):9.2f} s  {h.text}", "plain" if h.is_fall else "dim"))
        for line, (text, style) in enumerate(lines[: rect.height]):
            canvas.put(rect.x, rect.y + line, text, style, rect.width)
