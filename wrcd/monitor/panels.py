"""The parts of the screen beside the plot, drawn on a canvas, and the page that tells why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Validity
from wrcd.core.vocabulary import CONFIDENCES, words_of
from wrcd.logs.statistics import added
from wrcd.logs.story_events import STALE_AFTER
from wrcd.logs.story_records import Event, newest
from wrcd.logs.why import CONTACTS, SURFACES, answer
from wrcd.monitor.bus_model import AxleModel, BusModel, InputNow
from wrcd.monitor.canvas import Canvas, Rect
from wrcd.monitor.history import NO_VALUE, duration, percent, state_name

# A state has its sign and its word; its style comes on top.
STATES = {
    Validity.VALID.value: ("●", "good"), Validity.DEGRADED.value: ("◐", "warn"),
    Validity.NOT_AVAILABLE.value: ("○", "bad"), "Silent": ("·", "bad"),
}  # fmt: skip
DETAIL_US, TRUTH_US = 400_000, 200_000  # a frame of them older than this says nothing of a moment
AROUND_US = 1_000_000  # before and after that residuals are shown beside a moment
FULL_PCT = 90.0  # from such a load on frames of low priority wait
SHORT = {"lateral_acceleration": "lat. accel.", "wheel_radius": "radius"}
STATUS, REJECTS, LINK = "status_message", "rejects_message", "link_message"
# counts that wrap round, by message: name, and what a person calls it
COUNTS = {
    STATUS: {"Overruns": "overruns", "ReceiveDrops": "drops", "Reopens": "reopens"},
    LINK: {"Unsent": "unsent", "ErrorFrames": "error frames", "BusOffs": "bus-offs", "TimeSteps": "time steps",
           "Restarts": "restarts"},
}  # fmt: skip
WIDER = f"over ±{CONFIDENCES[-2][0]:g}"  # of a Valid estimate without an interval
Cell = tuple[str, str]  # a text and its style


@dataclass(frozen=True, slots=True)
class SourceState:
    """The monitor's own link, or the log."""

    name: str
    kind: str  # "live", "log"
    state: str = "Up"
    lost: int = 0  # frames that the kernel or the reader had to drop


@dataclass(frozen=True, slots=True)
class AxleNow:
    """An axle at a time. None, NaN and "": nothing is known."""

    number: int
    event: Event | None
    available_pct: float
    low_pct: float
    high_pct: float
    used_pct: float
    contact: str
    surface: str
    truth_pct: float
    damaged: int  # frames of its within a second that are refused here

    @property
    def interval(self) -> str:
        """The interval that Confidence states."""
        known = math.isfinite(self.low_pct) and math.isfinite(self.high_pct)
        is_valid = self.event is not None and state_name(self.event) == Validity.VALID.value
        is_wider = is_valid and math.isfinite(self.available_pct)  # and not a frame that is too old
        return f"{self.low_pct:.1f}…{self.high_pct:.1f}" if known else WIDER if is_wider else NO_VALUE


@dataclass(frozen=True, slots=True)
class DaemonNow:
    """How the daemon and its link are, from what it sends and from what it does not."""

    level: str  # "good", "warn" or "bad"
    state: str  # "Running", "silent", …
    parts: Sequence[str]  # what else there is to say, the most important first


def axle_at(model: BusModel, axle: AxleModel, at_us: int, until_us: int | None = None) -> AxleNow:
    """Return what an axle's frames say at a time; a frame that is too old says nothing. until_us: of what is known
    then."""
    a, truth = axle.held.adhesion, axle.held.truth
    k = newest(a.time_us, at_us, STALE_AFTER * axle.cycle_us)
    t = None if truth is None else newest(truth.time_us, at_us, TRUTH_US)
    columns = (a.available_pct, a.low_pct, a.high_pct, a.used_pct)
    available, low, high, used = (math.nan if k is None else float(c[k]) for c in columns)
    contact, surface = (
        "" if k is None else names[place] if (place := int(c[k])) >= 0 else "?"
        for names, c in ((CONTACTS, a.contact), (SURFACES, a.surface))
    )
    return AxleNow(
        axle.number, axle.history.at(at_us, until_us), available, low, high, used, contact, surface,
        math.nan if truth is None or t is None else float(truth.available_pct[t]), model.damaged(axle, at_us),
    )  # fmt: skip


def state_of(event: Event | None) -> tuple[str, str, str]:
    """Return a state's sign, word and style."""
    if event is None:
        return "·", "no frame yet", "bad"
    sign, style = STATES[state_name(event)]
    return sign, state_name(event), style


def daemon_at(model: BusModel, at_us: int) -> DaemonNow:
    """Return how the daemon is at a time."""
    if model.is_estimated:
        daemon_seen = any(len(m) for m in model.daemon.values()) or _damaged_adhesion(model) > 0
        what = "no Adhesion frame that is right" if daemon_seen else "no daemon"
        return DaemonNow("warn", "absent", [f"{what} in the log: estimated here"])
    silent = silence(model, at_us)
    if silent is not None:
        return DaemonNow("bad", "silent", [silent])
    parts: list[str] = []
    level, state = "good", "sends"
    now = {kind: m.at(at_us) for kind, m in model.daemon.items()}
    status, link, rejected = now.get(STATUS), now.get(LINK), now.get(REJECTS)
    if status is not None:
        state = _word(STATUS, "State", status) if "State" in status else "unknown state"
        if state != "Running":
            level = "bad" if state == "LinkDown" else "warn"
        checksum, own = status.get("DesignChecksum", math.nan), int(model.config.design.checksum[:4], 16)
        if math.isfinite(checksum) and int(checksum) != own:
            parts.append(f"runs another design ({int(checksum):04x}, here {own:04x}): rules and models may differ")
            level = "warn"
        if "DesignFit" in status and (fit := _word(STATUS, "DesignFit", status)) in ("Unsure", "Unlike"):
            parts.append(f"DesignFit {fit}: wrcd check --log says more")
            level = "warn"
    elif STATUS in model.daemon and len(model.daemon[STATUS]):
        parts.append(f"no {model.daemon[STATUS].name}")
        level = "warn"
    if link is not None and "LinkState" in link:
        name = _word(LINK, "LinkState", link)
        parts.append(f"its link {name}")
        if name != "Up":
            level = "bad"
    if rejected is not None:
        found = [f"{int(n)} {r.value}" for r in Reason if (n := rejected.get(f"Rejected{r.label}", 0.0)) > 0]
        if found:
            parts.append(f"refused in a second: {', '.join(found)}")
        if rejected.get("ForeignFrames", 0.0) > 0:
            parts.append(f"{int(rejected['ForeignFrames'])} frames of another sender under its ids")
            level = "warn"
    for kind, names in COUNTS.items():
        grown = added(model.daemon[kind].until(at_us), kind) if kind in model.daemon else {}
        parts += [
            f"{name} +{n:.0f}" for key, name in names.items() if key in grown and (n := np.nansum(grown[key])) > 0
        ]
    return DaemonNow(level, state, parts)


def _word(message: str, signal: str, values: dict[str, float]) -> str:
    place, names = int(values[signal]), words_of(message, signal)
    return names[place] if 0 <= place < len(names) else "unknown"


def _damaged_adhesion(model: BusModel) -> int:
    return sum(messages[0].refusals for messages in model.of_axle.values())  # Adhesion is the first


def silence(model: BusModel, at_us: int) -> str | None:
    """Return what to say of a daemon that sends no Adhesion frame; None of one that does."""
    latest = [
        int(t[k - 1]) for a in model.axles if (k := np.searchsorted(t := a.held.adhesion.time_us, at_us, "right"))
    ]
    if not latest:
        since = "" if model.begin_us is None else f" in {max(at_us - model.begin_us, 0) / 1e6:.1f} s"
        refused = _damaged_adhesion(model)
        return f"no Adhesion frame{since}" + (f", {refused} damaged" if refused else "")
    age_us = at_us - max(latest)
    limit_us = max(STALE_AFTER * a.cycle_us for a in model.axles)
    return f"no Adhesion frame for {age_us / 1e6:.1f} s" if age_us > limit_us else None


def draw_table(canvas: Canvas, rect: Rect, heads: Sequence[tuple[str, int]], rows: Sequence[Sequence[Cell]]) -> None:
    """Draw heads with their widths (0: all that is left) and lines of cells below, as many as there is room for."""
    for line, cells in enumerate([[(head, "label") for head, _ in heads], *rows][: rect.height]):
        x = rect.x
        for (text, style), (_, width) in zip(cells, heads, strict=True):
            left = rect.x + rect.width - x
            canvas.put(x, rect.y + line, text, style, min(width - 1, left) if width else left)
            x += width


def draw_status(
    canvas: Canvas, rect: Rect, model: BusModel, source: SourceState, mode: Cell, clock: str, at_us: int
) -> None:
    """Draw two lines: the bus and the mode; the daemon."""
    x = canvas.put(rect.x, rect.y, f" {mode[0]} ", mode[1]) + 1
    x = canvas.put(x, rect.y, source.name, "title", max(rect.width - 60, 14)) + 2
    canvas.put_right(rect.width, rect.y, clock, "plain")
    now = model.load.at(at_us)
    parts = []
    if source.kind == "live":
        if source.state != "Up":
            parts.append((f"link {source.state}", "bad"))
        parts.append((f"lost {source.lost}", "bad" if source.lost else "dim"))
    parts.append((f"load {now.load_pct:.0f} %", "warn" if now.load_pct > FULL_PCT else "plain"))
    if now.errors:
        parts.append((f"{now.errors} error frames/s", "bad"))
    parts.append((f"{now.frames_per_s:.0f} frames/s", "plain"))
    if rect.width >= 100:
        parts.append((f"at {model.load.bit_rate / 1000:g} kbit/s", "dim"))
    for text, style in parts:
        if x + len(text) < rect.width - len(clock):
            x = canvas.put(x, rect.y, text, style) + 2
    daemon = daemon_at(model, at_us)
    sign = {"good": "●", "warn": "◐", "bad": "○"}[daemon.level]
    x = canvas.put(rect.x, rect.y + 1, "daemon ", "label")
    x = canvas.put(x, rect.y + 1, f"{sign} {daemon.state}", daemon.level) + 2
    canvas.put(x, rect.y + 1, " · ".join(daemon.parts), daemon.level if daemon.level != "good" else "dim")


def draw_axles(canvas: Canvas, rect: Rect, axles: Sequence[AxleNow], chosen: int, hidden: int = 0) -> None:
    """Draw a table of axles; where they are too many, those around the chosen one. hidden: how many never came."""
    wide = rect.width >= 100
    truth = wide and any(math.isfinite(a.truth_pct) for a in axles)
    heads = [("", 3), ("axle state", 16), ("available", 10), ("interval", 12), ("in use", 9), ("contact", 11),
             ("surface", 9), *([("truth", 9)] if truth else []), ("why", 0)]  # fmt: skip
    lines = rect.height - 1
    if hidden and lines > 1:
        lines -= 1
        text = f"{hidden} more {'is' if hidden == 1 else 'are'} configured, of which nothing came: hidden"
        canvas.put(rect.x + 3, rect.y + 1 + min(lines, len(axles)), text, "dim", rect.width - 3)
    first = max(0, min(chosen - lines // 2, len(axles) - lines))
    rows: list[list[Cell]] = []
    for place, a in enumerate(axles[first : first + lines], first):
        sign, name, style = state_of(a.event)
        mark = (f"▶{a.number}", "selected") if place == chosen else (f" {a.number}", "plain")
        rows.append([
            mark, (f"{sign} {name}", style), (percent(a.available_pct), "available"), (a.interval, "plain"),
            (percent(a.used_pct), "used"), (a.contact or NO_VALUE, "plain"), (a.surface or NO_VALUE, "plain"),
            *([(percent(a.truth_pct), "truth")] if truth else []),
            (_why_short(a, wide), style if style != "good" else "dim"),
        ])  # fmt: skip
    draw_table(canvas, rect, heads, rows)


def _why_short(now: AxleNow, wide: bool) -> str:
    """Return the cause of not being Valid, in words where there is room; and how many frames are damaged."""
    parts = [f"{now.damaged} damaged/s"] if now.damaged else []
    if now.event is not None and state_name(now.event) == "Silent":
        parts.append(f"no Adhesion frame for {now.event.duration_s:.1f} s")
    elif now.event is not None and now.event.cause:
        parts.append(now.event.cause.words if wide else now.event.cause.label)
    return ", ".join(parts)


def draw_residuals(canvas: Canvas, rect: Rect, axle: AxleModel, names: Sequence[str], at_us: int) -> None:
    """Draw a line a model: its residual, the winner, a bar."""
    detail = axle.held.detail
    k = None if detail is None else newest(detail.time_us, at_us, DETAIL_US)
    if detail is None or k is None:
        text = "no AdhesionDetail frame" if axle.has_detail else "this train has no message for them"
        draw_table(canvas, rect, [("residuals, dB", 0)], [[(text, "dim")]])
        return
    rule = int(detail.rule[k])
    canvas.put_right(rect.x + rect.width, rect.y, f"rule {rule}" if rule else "no rule", "dim")
    name_width = min(max(map(len, names)), rect.width - 14)
    bar = rect.width - name_width - 16
    rows = []
    for m, name in enumerate(names):
        value, wins = float(detail.residual_db[k, m]), int(detail.winner[k]) == m + 1
        style = "selected" if wins else "plain"
        text = f"{value:+.1f}" if math.isfinite(value) else NO_VALUE
        share = min(max((value + 20.0) / 40.0, 0.0), 1.0) if math.isfinite(value) else 0.0  # from -20 to +20 dB
        length = max(round(share * bar), 1) if bar > 4 and math.isfinite(value) else 0
        rows.append([(f"{m + 1} {name}", style), (f"{text:>6}", style), ("wins" if wins else "", "selected"),
                     ("▬" * length, "dim")])  # fmt: skip
    draw_table(canvas, rect, [("residuals, dB", name_width + 3), ("", 7), ("", 5), ("", 0)], rows)


def why(model: BusModel, axle: AxleModel, at_us: int, width: int) -> list[Cell]:
    """Return what `wrcd why` says of an axle, and the residuals around."""
    if not len(axle.held.adhesion):
        return [("no Adhesion frame has come of it", "bad")]
    story = model.story(axle, at_us)
    at_us = max(story.begin_us, min(at_us, story.end_us))
    head, *rest = answer(story, axle.number, at_us, width)
    return [(head, "title"), *((text, "plain") for text in rest), ("", "plain"), *_residuals(model, axle, at_us)]


def _residuals(model: BusModel, axle: AxleModel, at_us: int) -> list[Cell]:
    a, detail, names = axle.held.adhesion, axle.held.detail, model.config.design.model_names
    times = [at_us - AROUND_US, at_us, min(at_us + AROUND_US, model.now_us)]
    rows = [None if detail is None else newest(detail.time_us, t, DETAIL_US) for t in times]
    if detail is None or rows[1] is None:
        text = "no AdhesionDetail frame near that time" if axle.has_detail else "this train sends no AdhesionDetail"
        return [(f"{text}: model, rule and residuals are not known", "dim")]
    width = max(map(len, names)) + 4
    heads = ("a second before", "then", "a second after")
    out: list[Cell] = [("residuals in dB".ljust(width) + "".join(f"{h:>17}" for h in heads), "label")]
    for m, name in enumerate(names):
        text = f"{m + 1} {name}".ljust(width)
        for k in rows:
            value = math.nan if k is None else float(detail.residual_db[k, m])
            wins = k is not None and int(detail.winner[k]) == m + 1
            text += f"{(f'{value:+.1f}' if math.isfinite(value) else NO_VALUE) + (' wins' if wins else ''):>17}"
        out.append((text, "selected" if int(detail.winner[rows[1]]) == m + 1 else "plain"))
    at = [newest(a.time_us, t, DETAIL_US) for t in times]
    values = [percent(math.nan if k is None else float(a.available_pct[k])) for k in at]
    return [*out, ("available".ljust(width) + "".join(f"{v:>17}" for v in values), "available")]


def draw_inputs(canvas: Canvas, rect: Rect, inputs: Sequence[InputNow]) -> None:
    """Draw a line an input: rate, age, reach, its value, what was refused."""
    wide = rect.width >= 64
    heads = [("input", 12), ("rate", 7), ("age", 9), ("reach", 9), *([("value", 15)] if wide else []), ("refused", 0)]
    rows: list[list[Cell]] = []
    for i in inputs:
        age = "never" if i.age_ms is None else f"{i.age_ms:.0f} ms" if i.age_ms < 10_000 else f"{i.age_ms / 1000:.0f} s"
        mark = " !" if i.is_stale and i.age_ms is not None else ""
        value = NO_VALUE if i.value is None else f"{i.value:.4g} {i.unit}"
        rows.append([
            (SHORT.get(i.quantity.key, i.quantity.key.replace("_", " ")), "plain"), (f"{i.rate_hz:.0f}/s", "plain"),
            (age + mark, "bad" if i.is_stale else "plain"), (_reach(i.reach), "good" if i.reach == 255 else "warn"),
            *([(value, "plain")] if wide else []), (i.refused or NO_VALUE, "bad" if i.refused else "dim"),
        ])  # fmt: skip
    draw_table(canvas, rect, heads, rows)
    if (hidden := len(inputs) - (rect.height - 1)) > 0:
        canvas.put_right(rect.x + rect.width, rect.y, f"{hidden} more", "dim")


def _reach(reach: int | None) -> str:
    """Return the daemon's register of an input, oldest first: a time-out with a good frame is filled."""
    return NO_VALUE if reach is None else "".join("▮" if reach >> bit & 1 else "▯" for bit in range(7, -1, -1))


def draw_strip(canvas: Canvas, rect: Rect, events: Sequence[Event], begin_us: int, cell_us: int) -> None:
    """Draw what state an axle was in, a cell a time; the state's name and how long where there is room."""
    for e in events:
        if e.end_us < begin_us or e.begin_us >= begin_us + cell_us * rect.width:
            continue
        first = max((e.begin_us - begin_us) // cell_us, 0)
        last = min(max(-(-(e.end_us - begin_us) // cell_us), first + 1), rect.width)
        _, name, style = state_of(e)
        fill = "·" if name == "Silent" else {"good": "─", "warn": "▚", "bad": "░"}[style]
        cells = last - first
        text = f" {name} {duration(e.duration_s)}{', ' + e.cause.label if e.cause else ''} "
        text = text if len(text) <= cells - 2 else f" {name} " if len(name) <= cells - 4 else ""
        # a worse state of a moment is not lost beneath the next
        canvas.put(rect.x + first, rect.y, text.center(cells, "\0").replace("\0", fill), style)
