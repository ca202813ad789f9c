"""The whole screen: model and view to a canvas."""

import math
import time

import numpy as np
from numpy.typing import NDArray

from wrcd.tools.monitor.axle import AxleModel
from wrcd.tools.monitor.canvas import Canvas, Rect
from wrcd.tools.monitor.falls import Falls
from wrcd.tools.monitor.happenings import Happening, duration, happenings, newest, spell_text
from wrcd.tools.monitor.layout import MIN_HEIGHT, MIN_WIDTH, Layout, layout
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.panels import (
    AxleNow,
    Link,
    axle_at,
    draw_axles,
    draw_inputs,
    draw_residuals,
    draw_status,
    draw_strip,
    draw_text,
    finite_max,
    interval,
    percent,
)
from wrcd.tools.monitor.plot import (
    SHADE,
    STEPS,
    TRUTH,
    Window,
    carried,
    draw_area,
    draw_band,
    draw_line,
    draw_marks,
    extremes,
    line_of,
    top_of,
)
from wrcd.tools.monitor.view import View
from wrcd.tools.story.records import Fall, Numbers, Times

KEYS = "space pause  ←→ cursor  +- zoom  n/p event  w why  1-8 axle  ? help  q quit  s save  e events  t colours"
CARRY_US = 100_000  # a value stands for so long in the plot, where frames are further apart than its columns
FALLS_EVERY_US = 1_000_000  # they are looked for so often


class Board:
    """Draws. Keeps what is dear to find: the falls of the chosen axle, and the scale."""

    def __init__(self, model: Model, view: View) -> None:
        self.model, self.view = model, view
        self._falls: dict[int, tuple[int, Falls, tuple[Fall, ...]]] = {}  # by axle: until when, and those found
        self.plot_width = 60
        self.places: Layout | None = None

    def falls(self, axle: AxleModel) -> tuple[Fall, ...]:
        """Of an axle, as far as is held. Found anew where there are new frames, once a second at most."""
        times = axle.adhesion.time_us
        newest_us = int(times[-1]) // FALLS_EVERY_US if len(times) else 0
        known = self._falls.get(axle.number)
        if known is None or known[0] != newest_us:
            finder = Falls(axle.number) if known is None else known[1]
            known = self._falls[axle.number] = newest_us, finder, finder.update(axle.adhesion)
        return known[2]

    def happenings(self) -> list[Happening]:
        """Of the chosen axle."""
        until_us = self.view.now_us(self.model.now_us)
        return happenings(self._falls_until(until_us), self.axle.spells.all(until_us))

    def _falls_until(self, until_us: int) -> list[Fall]:
        return [f for f in self.falls(self.axle) if f.end_us <= until_us]

    @property
    def axle(self) -> AxleModel:
        """The chosen one; before it has come the first of those that have."""
        chosen, shown = self.model.axles[self.view.axle], self.model.axles_that_came
        return chosen if chosen in shown else shown[0]

    def draw(self, width: int, height: int, link: Link, note: str = "") -> Canvas:
        """The screen of a size. note: what a key has just done."""
        canvas = Canvas(width, height)
        model, view, axle = self.model, self.view, self.axle
        at_us = view.at_us(model.now_us)
        inputs = model.inputs_at(axle, at_us)
        shown = model.axles_that_came
        hidden = len(model.axles) - len(shown)
        places = self.places = layout(width, height, len(shown) + (hidden > 0), len(inputs))
        if places is None:
            text = f"needs {MIN_WIDTH} columns and {MIN_HEIGHT} lines; this is {width} by {height}"
            canvas.put(0, 0, text, "warn")
            return canvas
        self.plot_width = places.plot.width
        draw_status(canvas, places.status, model, link, self._mode(link), self.clock(at_us), at_us)
        rows = [axle_at(model, a, at_us, view.now_us(model.now_us)) for a in shown]
        chosen = shown.index(axle)
        draw_axles(canvas, places.axles, rows, chosen, hidden)
        self._draw_plot(canvas, places, rows[chosen])
        self._draw_events(canvas, places.events, note)
        draw_residuals(canvas, places.residuals, axle, model.config.design.model_names, at_us)
        draw_inputs(canvas, places.inputs, inputs)
        self._draw_keys(canvas, places.keys)
        return canvas

    def _mode(self, link: Link) -> tuple[str, str]:
        view = self.view
        if link.kind == "log":
            return "LOG", "log"
        if view.is_live:
            return "LIVE", "live"
        behind = (self.model.now_us - view.at_us(self.model.now_us)) / 1e6
        return f"PAUSED {duration(max(behind, 0.0))} ago", "paused"

    def clock(self, at_us: int) -> str:
        """A time: seconds from the first frame, and of day."""
        if self.model.begin_us is None:
            return ""
        day = time.strftime("%H:%M:%S", time.localtime(at_us // 1_000_000))
        return f"{(at_us - self.model.begin_us) / 1e6:.1f} s  {day}"

    def _draw_plot(self, canvas: Canvas, places: Layout, now: AxleNow) -> None:
        rect, axle, view = places.plot, self.axle, self.view
        w = view.window(self.model.now_us, rect.width)
        newest_us = view.now_us(self.model.now_us)
        a, truth = axle.adhesion, axle.truth
        half_us = w.cell_us / 2
        carry = math.ceil(CARRY_US / half_us)

        def cells(times: Times, values: Numbers) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            end = int(np.searchsorted(times, newest_us, side="right"))
            low, high = extremes(times[:end], values[:end], w.begin_us, w.cell_us, rect.width)
            return carried(low, carry // 2 + 1), carried(high, carry // 2 + 1)

        end = int(np.searchsorted(a.time_us, newest_us, side="right"))
        low, high = extremes(a.time_us[:end], a.available_pct[:end], w.begin_us, w.cell_us // 2, 2 * rect.width)
        low, high = carried(low, carry), carried(high, carry)
        below, above = cells(a.time_us, a.low_pct)[0], cells(a.time_us, a.high_pct)[1]
        used = cells(a.time_us, a.used_pct)[1]
        true = cells(truth.time_us, truth.available_pct)[0]
        top = top_of(finite_max(high, used, true))
        draw_band(canvas, rect, below, above, top, "interval")
        draw_area(canvas, rect, used, top, "used")
        draw_marks(canvas, rect, true, top, "truth")
        draw_line(canvas, rect, low, high, top, "available")
        self._draw_scales(canvas, places, w, top)
        self._draw_legend(canvas, places.legend, now, top)
        if view.cursor_us is not None and 0 <= (x := w.column(view.cursor_us)) < rect.width:
            canvas.invert(rect.x + x, Rect(rect.x, rect.y, rect.width, rect.height + 1))
            label = self.clock(view.cursor_us).split("  ")[0]
            canvas.put(min(max(rect.x + x - len(label) // 2, rect.x), rect.x + rect.width - len(label)),
                       places.scale_y, label, "cursor")  # fmt: skip
        strip = Rect(rect.x, places.strip_y, rect.width, 1)
        spells = axle.spells.between(w.begin_us, w.end_us, newest_us)
        draw_strip(canvas, strip, spells, w.begin_us, w.cell_us)
        for f in self._falls_until(newest_us):
            if 0 <= (x := w.column((f.begin_us + f.end_us) // 2)) < rect.width:
                canvas.put(rect.x + x, places.strip_y, "▼" if f.after_pct < f.before_pct else "▲", "title")
        canvas.put(0, places.strip_y, "state", "label", rect.x)

    def _draw_scales(self, canvas: Canvas, places: Layout, w: Window, top: float) -> None:
        rect = places.plot
        head = places.plot.y - 1
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
        begin_us = self.model.begin_us or 0
        canvas.put(rect.x, places.scale_y, "─" * rect.width, "dim")
        step_s = next(s for s in (0.2, 0.5, 1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1800, 3600, 7200, 1e9)
                      if s * 1e6 / w.cell_us >= 11)  # fmt: skip
        first = math.ceil((w.begin_us - begin_us) / 1e6 / step_s)
        for k in range(first, first + rect.width):
            x = w.column(begin_us + round(k * step_s * 1e6))
            if x >= rect.width - 6:
                break
            if k >= 0:
                canvas.put(rect.x + x, places.scale_y, f"┴{k * step_s:g} s", "dim")

    def _draw_legend(self, canvas: Canvas, rect: Rect, now: AxleNow, top: float) -> None:
        """The value now, or at the cursor, beside each curve."""
        wanted = [
            (now.available_pct, f"◀ {percent(now.available_pct)} available", "available"),
            (now.used_pct, f"◀ {percent(now.used_pct)} in use", "used"),
        ]
        if math.isfinite(now.truth_pct):
            wanted.append((now.truth_pct, f"◀ {percent(now.truth_pct)} truth", "truth"))
        if math.isfinite(now.low_pct) and math.isfinite(now.high_pct):
            wanted.append((now.available_pct - 1e-6, f"  {interval(now)}", "dim"))
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
        lines: list[tuple[str, str]] = []
        view, at_us = self.view, self.view.at_us(self.model.now_us)
        if note:
            lines.append((f"» {note}", "title"))
        spell = self.axle.spells.at(at_us, view.now_us(self.model.now_us))
        if spell is not None:
            since = self.clock(spell.begin_us).split("  ")[0]
            style = "good" if spell.state == "Valid" else "warn" if spell.state == "Degraded" else "bad"
            lines.append((f"since {since}: {spell_text(spell)}", style))
        begin_us = self.model.begin_us or 0
        now_us = view.now_us(self.model.now_us)
        for h in reversed(newest(self._falls_until(now_us), self.axle.spells, rect.height, now_us)):
            mark = "▶" if view.cursor_us == h.time_us else " "
            lines.append((f"{mark}{(h.time_us - begin_us) / 1e6:9.2f} s  {h.text}", "plain" if h.is_fall else "dim"))
        draw_text(canvas, rect, lines)

    @staticmethod
    def _draw_keys(canvas: Canvas, rect: Rect) -> None:
        x = rect.x
        for part in KEYS.split("  "):
            key, _, what = part.partition(" ")
            if x + len(part) > rect.width:
                break
            x = canvas.put(x, rect.y, key, "key")
            x = canvas.put(x, rect.y, f" {what}", "dim") + 2
