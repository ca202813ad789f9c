"""The parts of the screen, drawn on a canvas."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Cause, Validity
from wrcd.tools.monitor.axle import AxleModel, row_at, words
from wrcd.tools.monitor.canvas import Canvas, Rect
from wrcd.tools.monitor.daemon import daemon_at
from wrcd.tools.monitor.happenings import duration
from wrcd.tools.monitor.inputs import InputNow
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.spells import SILENT, SILENT_CYCLES, Spell

# A state is told by its sign and its word; its style comes on top.
STATES = {
    Validity.VALID.value: ("●", "good"), Validity.DEGRADED.value: ("◐", "warn"),
    Validity.NOT_AVAILABLE.value: ("○", "bad"), SILENT: ("·", "bad"),
}  # fmt: skip
OTHER_STATE = ("!", "bad")
SURFACES, CONTACTS = words("adhesion", "Surface"), words("adhesion", "ContactState")
NO_VALUE = "–"
FULL_PCT = 90.0  # from such a load on frames of low priority wait
SHORT = {"lateral_acceleration": "lat. accel.", "wheel_radius": "radius"}


@dataclass(frozen=True, slots=True)
class Link:
    """The monitor's own link, or the log."""

    name: str
    kind: str  # "live", "log"
    state: str = "Up"
    lost: int = 0  # frames that the kernel or the reader had to drop


@dataclass(frozen=True, slots=True)
class AxleNow:
    """An axle at a time. None, NaN and "": nothing is known."""

    number: int
    spell: Spell | None
    available_pct: float
    low_pct: float
    high_pct: float
    used_pct: float
    contact: str
    surface: str
    truth_pct: float
    truth_used_pct: float
    damaged: int  # frames of its within a second that are refused here


def axle_at(model: Model, axle: AxleModel, at_us: int, until_us: int | None = None) -> AxleNow:
    """What an axle's frames say at a time. A frame that is too old says nothing. until_us: of what is known then."""
    a = axle.adhesion
    k = row_at(a.time_us, at_us, SILENT_CYCLES * axle.cycle_us)
    truth = axle.truth
    t = row_at(truth.time_us, at_us, 200_000)
    nan = math.nan
    return AxleNow(
        axle.number, axle.spells.at(at_us, until_us),
        nan if k is None else float(a.available_pct[k]), nan if k is None else float(a.low_pct[k]),
        nan if k is None else float(a.high_pct[k]), nan if k is None else float(a.used_pct[k]),
        "" if k is None else word(CONTACTS, int(a.contact[k])), "" if k is None else word(SURFACES, int(a.surface[k])),
        nan if t is None else float(truth.available_pct[t]), nan if t is None else float(truth.used_pct[t]),
        model.damaged(axle, at_us),
    )  # fmt: skip


def word(names: Sequence[str], place: int) -> str:
    """A word by its place; of another a question mark."""
    return names[place] if 0 <= place < len(names) else "?"


def percent(value: float) -> str:
    """A value, or that there is none."""
    return f"{value:.1f} %" if math.isfinite(value) else NO_VALUE


def interval(now: AxleNow) -> str:
    """The interval that Confidence states."""
    known = math.isfinite(now.low_pct) and math.isfinite(now.high_pct)
    return f"{now.low_pct:.1f}…{now.high_pct:.1f}" if known else NO_VALUE


def state_of(spell: Spell | None) -> tuple[str, str, str]:
    """Sign, word and style."""
    if spell is None:
        return "·", "no frame yet", "bad"
    sign, style = STATES.get(spell.state, OTHER_STATE)
    return sign, spell.state, style


def draw_status(
    canvas: Canvas, rect: Rect, model: Model, link: Link, mode: tuple[str, str], clock: str, at_us: int
) -> None:
    """Two lines: the bus and the mode; the daemon."""
    mode_text, mode_style = mode
    x = canvas.put(rect.x, rect.y, f" {mode_text} ", mode_style) + 1
    x = canvas.put(x, rect.y, link.name, "title", max(rect.width - 60, 14)) + 2
    canvas.put_right(rect.width, rect.y, clock, "plain")
    now = model.bus.at(at_us)
    parts = []
    if link.kind == "live":
        if link.state != "Up":
            parts.append((f"link {link.state}", "bad"))
        parts.append((f"lost {link.lost}", "bad" if link.lost else "dim"))
    parts.append((f"load {now.load_pct:.0f} %", "warn" if now.load_pct > FULL_PCT else "plain"))
    if now.errors:
        parts.append((f"{now.errors} error frames/s", "bad"))
    parts.append((f"{now.frames_per_s:.0f} frames/s", "plain"))
    if rect.width >= 100:
        parts.append((f"at {model.bus.bit_rate / 1000:g} kbit/s", "dim"))
    for text, style in parts:
        if x + len(text) < rect.width - len(clock):
            x = canvas.put(x, rect.y, text, style) + 2
    daemon = daemon_at(model, at_us)
    sign = {"good": "●", "warn": "◐", "bad": "○"}[daemon.level]
    x = canvas.put(rect.x, rect.y + 1, "daemon ", "label")
    x = canvas.put(x, rect.y + 1, f"{sign} {daemon.state}", daemon.level) + 2
    canvas.put(x, rect.y + 1, " · ".join(daemon.parts), daemon.level if daemon.level != "good" else "dim")


def draw_axles(canvas: Canvas, rect: Rect, rows: Sequence[AxleNow], chosen: int, hidden: int = 0) -> None:
    """A table of axles; where they are too many, those around the chosen one. hidden: how many never came."""
    wide = rect.width >= 100
    widths = (3, 16, 10, 12, 9, 11, 9)
    heads = ("", "axle state", "available", "interval", "in use", "contact", "surface")
    x = rect.x
    for head, width in zip(heads, widths, strict=True):
        canvas.put(x, rect.y, head, "label", width)
        x += width
    truth = any(math.isfinite(r.truth_pct) for r in rows) and wide
    if truth:
        canvas.put(x, rect.y, "truth", "label")
        x += 9
    canvas.put(x, rect.y, "why", "label")
    lines = rect.height - 1
    if hidden and lines > 1:
        lines -= 1
        told = f"{hidden} more {'is' if hidden == 1 else 'are'} configured, of which nothing came: hidden"
        canvas.put(rect.x + 3, rect.y + 1 + min(lines, len(rows)), told, "dim", rect.width - 3)
    first = max(0, min(chosen - lines // 2, len(rows) - lines))
    for line, now in enumerate(rows[first : first + lines]):
        y, is_chosen = rect.y + 1 + line, first + line == chosen
        canvas.put(rect.x, y, f"{'▶' if is_chosen else ' '}{now.number}", "selected" if is_chosen else "plain")
        sign, name, style = state_of(now.spell)
        canvas.put(rect.x + 3, y, f"{sign} {name}", style, 15)
        cells = (percent(now.available_pct), interval(now), percent(now.used_pct), now.contact or NO_VALUE,
                 now.surface or NO_VALUE)  # fmt: skip
        x = rect.x + 19
        for cell, width, of in zip(cells, widths[2:], ("available", "plain", "used", "plain", "plain"), strict=True):
            canvas.put(x, y, cell, of, width - 1)
            x += width
        if truth:
            canvas.put(x, y, percent(now.truth_pct), "truth", 8)
            x += 9
        canvas.put(x, y, why_short(now, wide), style if style != "good" else "dim")


def why_short(now: AxleNow, wide: bool) -> str:
    """The cause of not being Valid: its words where there is room; and frames that are damaged."""
    damaged = f"{now.damaged} damaged/s" if now.damaged else ""
    s = now.spell
    if s is None:
        return damaged
    cause = (s.words if wide or s.state == SILENT else s.cause.label) if s.state == SILENT or s.cause else ""
    return ", ".join(part for part in (damaged, cause) if part)


def draw_residuals(canvas: Canvas, rect: Rect, axle: AxleModel, names: Sequence[str], at_us: int) -> None:
    """A line a model: its residual, a bar, the winner."""
    detail = axle.detail
    k = row_at(detail.time_us, at_us, 400_000) if axle.has_detail else None
    head = "residuals, dB"
    rule = 0 if k is None else int(detail.rule[k])
    canvas.put(rect.x, rect.y, head, "label")
    canvas.put_right(rect.x + rect.width, rect.y, f"rule {rule}" if rule else "no rule" if k is not None else "", "dim")
    if k is None:
        text = "no AdhesionDetail frame" if axle.has_detail else "this train has no message for them"
        canvas.put(rect.x, rect.y + 1, text, "dim", rect.width)
        return
    name_width = min(max(map(len, names)), rect.width - 14)
    bar = rect.width - name_width - 14
    for m, name in enumerate(names):
        y, value, wins = rect.y + 1 + m, float(detail.residual_db[k, m]), int(detail.winner[k]) == m + 1
        style = "selected" if wins else "plain"
        x = canvas.put(rect.x, y, f"{m + 1} {name}", style, name_width + 2)
        canvas.put_right(rect.x + name_width + 9, y, f"{value:+.1f}" if math.isfinite(value) else NO_VALUE, style)
        x = rect.x + name_width + 10
        if wins:
            x = canvas.put(x, y, "wins", "selected")
        if bar > 6 and math.isfinite(value):
            share = min(max((value + 20.0) / 40.0, 0.0), 1.0)  # from -20 to +20 dB
            canvas.put(rect.x + name_width + 15, y, "▬" * max(round(share * (bar - 2)), 1), "dim")


def draw_inputs(canvas: Canvas, rect: Rect, inputs: Sequence[InputNow]) -> None:
    """A line an input: rate, age, reach, what it says, what was refused."""
    wide = rect.width >= 64
    columns = [("input", 12), ("rate", 7), ("age", 9), ("reach", 9)]
    columns += [("value", 15)] if wide else []
    x = rect.x
    for head, width in columns:
        canvas.put(x, rect.y, head, "label", width)
        x += width
    canvas.put(x, rect.y, "refused", "label", rect.x + rect.width - x)
    for line, i in enumerate(inputs[: rect.height - 1]):
        y, x = rect.y + 1 + line, rect.x
        name = i.quantity.key
        style = "bad" if i.is_stale else "plain"
        canvas.put(x, y, SHORT.get(name, name.replace("_", " ")), "plain", 11)
        canvas.put(x + 12, y, f"{i.rate_hz:.0f}/s", "plain", 6)
        age = "never" if i.age_ms is None else f"{i.age_ms:.0f} ms" if i.age_ms < 10_000 else f"{i.age_ms / 1000:.0f} s"
        canvas.put(x + 19, y, age + (" !" if i.is_stale and i.age_ms is not None else ""), style, 9)
        canvas.put(x + 28, y, reach_text(i.reach), "good" if i.reach == 255 else "warn", 9)
        x += 37
        if wide:
            canvas.put(x, y, NO_VALUE if i.value is None else f"{i.value:.4g} {i.unit}", "plain", 14)
            x += 15
        canvas.put(x, y, i.refused or NO_VALUE, "bad" if i.refused else "dim", rect.x + rect.width - x)
    hidden = len(inputs) - (rect.height - 1)
    if hidden > 0:
        canvas.put_right(rect.x + rect.width, rect.y, f"{hidden} more", "dim")


def reach_text(reach: int | None) -> str:
    """The daemon's register of an input, oldest first: a time-out with a good frame is filled."""
    return NO_VALUE if reach is None else "".join("▮" if reach >> bit & 1 else "▯" for bit in range(7, -1, -1))


def draw_strip(canvas: Canvas, rect: Rect, spells: Sequence[Spell], begin_us: int, cell_us: int) -> None:
    """What state an axle was in, a cell a time; the state's name and how long where there is room."""
    fills = {"good": "─", "warn": "▚", "bad": "░"}
    end_us = begin_us + cell_us * rect.width
    for s in spells:
        if s.end_us < begin_us or s.begin_us >= end_us:
            continue
        first = max((s.begin_us - begin_us) // cell_us, 0)
        last = min(max(-(-(s.end_us - begin_us) // cell_us), first + 1), rect.width)
        _, name, style = state_of(s)
        fill = "·" if s.state == SILENT else fills[style]
        cells = last - first
        text = f" {name} {duration(s.duration_s)}{', ' + s.cause.label if s.cause is not Cause.NONE else ''} "
        text = text if len(text) <= cells - 2 else f" {name} " if len(name) <= cells - 4 else ""
        # a worse state of a moment is not lost beneath the next
        line = text.center(cells, "\0").replace("\0", fill)
        canvas.put(rect.x + first, rect.y, line, style)


def draw_text(canvas: Canvas, rect: Rect, lines: Sequence[tuple[str, str]]) -> None:
    """Lines and their styles, as many as there is room for."""
    for k, (text, style) in enumerate(lines[: rect.height]):
        canvas.put(rect.x, rect.y + k, text, style, rect.width)


def finite_max(*columns: NDArray[np.float64]) -> float:
    """The greatest value of all, 0 where there is none."""
    return max((float(np.nanmax(c)) for c in columns if np.isfinite(c).any()), default=0.0)
