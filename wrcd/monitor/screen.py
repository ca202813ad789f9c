"""`wrcd monitor` on a terminal: its keys, its pages, and what is saved."""

import asyncio
import gc
import math
import re
import signal
import time
from collections.abc import Iterable
from pathlib import Path

from textual.app import App, ComposeResult
from textual.binding import Binding
from textual.events import Resize

from wrcd.bus.candump import format_line
from wrcd.monitor.board import Board, ScreenView
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.canvas import SPANS_S
from wrcd.monitor.history import first_of_interest
from wrcd.monitor.panels import Cell, why
from wrcd.monitor.sources import FrameSource
from wrcd.monitor.widgets import GROUNDS, NAMES, CanvasWidget, TextPage, palette

EVERY_S = 0.1  # the screen is brought up to date so often
NOTE_S = 6.0  # what a key has done is shown for so long
MAX_EVENTS = 500  # that the page of events lists
ENDING = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)  # they end it as the key does: the terminal is as before
_ELSEWHERE = re.compile(r"@font-face \{.*?\}\s*|<!--.*?-->", re.DOTALL)
MAX_TRIES = 1000
# what help says of keys, and what they are bound to
KEYS: tuple[tuple[str, str, dict[str, str]], ...] = (
    ("space", "pause, or live again; while paused nothing is lost", {"space": "pause"}),
    (
        "← →",
        "cursor by a column; with Shift, or PgUp and PgDn, by ten",
        {"left": "move(-1)", "right": "move(1)", "shift+left,pageup": "move(-10)", "shift+right,pagedown": "move(10)"},
    ),
    ("Home End", "to the oldest that is held; to the newest", {"home": "ends(False)", "end": "ends(True)"}),
    (
        "+ -",
        "zoom in and out, around the cursor",
        {"plus,equals_sign,z": "zoom(True)", "minus,Z,underscore": "zoom(False)"},
    ),
    (
        "n p",
        "next and previous event: fall, rise, change of Validity",
        {"n": "jump(True)", "p,N": "jump(False)"},
    ),
    ("w Enter", "why it is so at the cursor: model, rule, residuals before and after", {"w,enter": "why"}),
    (
        "1 … 8 ↑ ↓",
        "choose the axle",
        {"up": "next_axle(-1)", "down,tab": "next_axle(1)", **{str(n): f"axle({n})" for n in range(1, 9)}},
    ),
    ("e", "all events with how long they took", {"e": "events"}),
    ("s", "save: what is held as a log, and a picture, to this folder", {"s": "save"}),
    ("Esc", "cursor away", {"escape": "leave_cursor"}),
    ("t", "colours: the terminal's own, on dark, on light", {"t": "colours"}),
    ("? q", "keys and signs; quit", {"question_mark,h": "help", "q,ctrl+c": "quit"}),
)
SIGNS = (
    ("● Valid", "may be used"),
    ("◐ Degraded", "something speaks against it; the cause tells what"),
    ("○ NotAvailable", "no estimate"),
    ("· Silent", "no Adhesion frame comes"),
    ("⠒⠒ ░░ ▄▄ ╌╌", "available, its 90 % interval, in use, the rig's truth (--dbc)"),
    ("▼ ▲", "the available adhesion fell, rose"),
    ("▮▮▮▮▯▯▮▮", "reach: the last eight time-outs of an input, filled where a good frame came"),
    ("29 ms !", "an input past its time-out"),
    ("damaged", "frames of the daemon's with a wrong CRC or length: they are counted, not shown"),
)


class Monitor(App[None]):
    """The screen. ticking: False where a test turns it by hand."""

    ENABLE_COMMAND_PALETTE = False
    TITLE = "wrcd monitor"
    CSS = "Screen { overflow: hidden; }"
    BINDINGS = [Binding(key, action, show=False) for *_, bound in KEYS for key, action in bound.items()]

    def __init__(
        self, model: BusModel, source: FrameSource, *, colours: str = "terminal", folder: Path | None = None,
        ticking: bool = True, note: str = "",
    ) -> None:  # fmt: skip
        super().__init__(ansi_color=colours not in GROUNDS)
        self.model, self.source = model, source
        self.view = ScreenView()
        self.board = Board(model, self.view)
        self.colours = "none" if self.no_color else colours
        self.updates = 0  # of the screen, that had something to show
        self._folder, self._ticking = folder or Path(), ticking
        self._note, self._note_until_s = note, time.monotonic() + NOTE_S if note else 0.0
        self._widget = CanvasWidget(palette(self.colours), self.redraw)

    def compose(self) -> ComposeResult:
        """One widget: its parts are distinguished by what differs, which costs the terminal least."""
        yield self._widget

    def on_load(self) -> None:
        """Before the terminal is touched: from here on a signal leaves it as it was."""
        loop = asyncio.get_running_loop()
        for number in ENDING:
            loop.add_signal_handler(number, self._end, number)

    def _end(self, number: signal.Signals) -> None:
        self.exit(return_code=128 + number)

    def on_resize(self, event: Resize) -> None:
        """Tell the screen at once. Textual waits for the last of many sizes by a timer of 8 ms, which skips its only
        turn where the computer is busy just then; no size was taken after that."""
        if self.screen_stack:
            self.screen.post_message(event)

    def on_mount(self) -> None:
        """Begin; of a log, where something happened."""
        if self.source.state().kind == "log":
            self._begin_log()
        gc.freeze()  # Textual's own objects need no looking through
        if self._ticking:
            self.set_interval(EVERY_S, self.tick)
        self.call_after_refresh(self.tick)

    def _begin_log(self) -> None:
        model, view = self.model, self.view
        begin_us, now_us = model.begin_us or 0, model.now_us
        whole_s = (now_us - begin_us) / 1e6
        view.span_s = max(min(math.ceil(whole_s), SPANS_S[-1]), SPANS_S[0])
        view.pause(now_us)
        shown = [(k, axle) for k, axle in enumerate(model.axles) if axle in model.axles_that_came]
        at = [(first, k) for k, axle in shown if (first := first_of_interest(axle.history)) is not None]
        if at:
            view.axle = min(at)[1]
        view.go(min(at)[0] if at else begin_us, now_us, begin_us, self.board.plot_width)

    def tick(self) -> None:
        """Take what has come and show it."""
        for batch, until_us in self.source.take():
            self.model.take(batch, until_us)
        self.model.update()
        self.redraw()

    def redraw(self) -> None:
        """Show how it is now."""
        width, height = self._widget.size
        if not width or not height:
            return
        note = self._note if time.monotonic() < self._note_until_s else ""
        if self._widget.show(self.board.draw(width, height, self.source.state(), note)):
            self.updates += 1

    def note(self, note: str) -> None:
        """Say for a moment what a key has done."""
        self._note, self._note_until_s = note, time.monotonic() + NOTE_S

    @property
    def _begin_us(self) -> int:
        return self.model.begin_us or 0

    def action_pause(self) -> None:
        """Hold the screen, or follow again."""
        if self.source.state().kind == "log":
            self.note("a log stands still: move the cursor with ← and →")
        elif self.view.is_live:
            self.view.pause(self.model.now_us)
        else:
            self.view.resume()
        self.redraw()

    def action_move(self, cells: int) -> None:
        """Move the cursor."""
        self.view.move(cells, self.model.now_us, self._begin_us, self.board.plot_width)
        self.redraw()

    def action_ends(self, newest: bool) -> None:
        """The oldest or the newest."""
        if newest and self.source.state().kind == "live":
            self.view.resume()
        else:
            at_us = self.model.now_us if newest else self._begin_us
            self.view.go(at_us, self.model.now_us, self._begin_us, self.board.plot_width)
        self.redraw()

    def action_zoom(self, closer: bool) -> None:
        """Less or more time."""
        self.view.zoom(closer, self.model.now_us, self.board.plot_width)
        self.redraw()

    def action_jump(self, forward: bool) -> None:
        """To an event."""
        found = self.board.happenings()
        h = self.view.jump(found, forward, self.model.now_us, self._begin_us, self.board.plot_width)
        which = "later" if forward else "earlier"
        self.note(f"{h.text}  (w: why)" if h else f"no {which} event of axle {self.board.axle.number}")
        self.redraw()

    def action_axle(self, number: int) -> None:
        """Choose by number."""
        places = [k for k, a in enumerate(self.model.axles) if a.number == number]
        if not places:
            self.note(f"there is no axle {number}")
        elif self.model.axles[places[0]] not in self.model.axles_that_came:
            self.note(f"nothing came of axle {number}")
        else:
            self.view.axle = places[0]
        self.redraw()

    def action_next_axle(self, by: int) -> None:
        """Choose the next one."""
        shown = self.model.axles_that_came
        following = shown[(shown.index(self.board.axle) + by) % len(shown)]
        self.view.axle = self.model.axles.index(following)
        self.redraw()

    def action_leave_cursor(self) -> None:
        """The newest values again."""
        self.view.cursor_us = None
        self.redraw()

    def action_colours(self) -> None:
        """The next palette."""
        if self.no_color:
            self.note("NO_COLOR is set")
            self.redraw()
            return
        self.colours = NAMES[(NAMES.index(self.colours) + 1) % len(NAMES)]
        self.ansi_color = self.colours not in GROUNDS
        self._widget.repaint(palette(self.colours))

    def action_why(self) -> None:
        """Why it is so, at the cursor or now."""
        at_us = self.view.at_us(self.model.now_us)
        axle, width = self.board.axle, min(round(0.96 * self.size.width), 110) - 6
        self._page(f"why, axle {axle.number}", why(self.model, axle, at_us, width))

    def action_events(self) -> None:
        """All events."""
        found = self.board.happenings()[-MAX_EVENTS:]
        lines: list[Cell] = [
            (f"{self.board.seconds(h.time_us):10.2f} s  {h.text}", "plain" if h.is_fall else "dim")
            for h in reversed(found)
        ]  # fmt: skip
        self._page(f"events of axle {self.board.axle.number}, newest first", lines or [("none", "dim")])

    def action_help(self) -> None:
        """Keys and signs."""
        self._page("wrcd monitor: it only listens", [
            *((f"{key:<15} {what}", "plain") for key, what, _ in KEYS), ("", "plain"),
            *((f"{sign:<15} {what}", "dim") for sign, what in SIGNS),
        ])  # fmt: skip

    def _page(self, title: str, lines: list[Cell]) -> None:
        ground = GROUNDS.get(self.colours, "ansi_default")
        self.push_screen(TextPage(title, lines, palette(self.colours), ground))

    def action_save(self) -> None:
        """A log of the frames that are held, and a picture, both new files."""
        link = self.source.state()
        stamp = time.strftime("%Y%m%d-%H%M%S", time.localtime(self.model.now_us // 1_000_000))
        name = plain_stem(Path(link.name).stem if link.kind == "log" else link.name.split(":")[-1])
        stem = free_name(self._folder, f"wrcd-monitor-{name}-{stamp}", (".log", ".svg"))
        svg = self.export_screenshot(title=f"wrcd monitor {link.name}")
        try:
            with (self._folder / f"{stem}.svg").open("x", encoding="utf-8") as f:
                f.write(without_fonts(svg))
        except OSError as e:
            self.note(f"not saved: {e.strerror or e}")
            return
        batches = tuple(self.model.held)
        if link.kind == "log":  # there is one already: the part that is seen
            w = self.view.window(self.model.now_us, self.board.plot_width)
            batches = tuple(b.within(w.begin_us, w.end_us) for b in batches)
        self.note(f"saving {stem}.log …")
        self.run_worker(lambda: self._save_log(stem, batches, name), thread=True)

    def _save_log(self, stem: str, batches: tuple[Batch, ...], channel: str) -> None:
        try:
            n = write_log(self._folder / f"{stem}.log", batches, channel)
        except OSError as e:
            self.call_from_thread(self.note, f"{stem}.svg saved, its log not: {e.strerror or e}")
            return
        self.call_from_thread(self.note, f"saved {stem}.log ({n} frames) and .svg")

    def on_unmount(self) -> None:
        """Let go of the bus."""
        self.source.close()


def free_name(folder: Path, stem: str, suffixes: tuple[str, ...]) -> str:
    """The stem, or with a number behind it, under which there is no file yet."""
    for number in range(1, MAX_TRIES):
        name = stem if number == 1 else f"{stem}-{number}"
        if not any((folder / f"{name}{suffix}").exists() for suffix in suffixes):
            return name
    raise FileExistsError(f"{stem} and {MAX_TRIES} more")


def plain_stem(text: str) -> str:
    """A name of letters, digits, dots and dashes."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-")


def without_fonts(svg: str) -> str:
    """A picture that fetches nothing: in whatever fixed-width font there is."""
    return _ELSEWHERE.sub("", svg).replace("Fira Code", "DejaVu Sans Mono, Menlo, Consolas")


def write_log(path: Path, batches: Iterable[Batch], channel: str) -> int:
    """A new candump log. Returns how many frames it holds."""
    n = 0
    with path.open("x", encoding="ascii") as f:
        for batch in batches:
            f.writelines(f"{format_line(frame, channel)}\n" for frame in batch.frames())
            n += len(batch)
    return n
