"""`wrcd monitor` on a terminal."""

import asyncio
import gc
import math
import signal
import time
from pathlib import Path

from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType

from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.board import Board
from wrcd.tools.monitor.happenings import first_of_interest
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.plot import SPANS_S
from wrcd.tools.monitor.screen.help import lines as help_lines
from wrcd.tools.monitor.screen.palettes import GROUNDS, NAMES, palette
from wrcd.tools.monitor.screen.widgets import CanvasWidget, Page
from wrcd.tools.monitor.snapshot import free_name, plain_stem, write_log, write_picture
from wrcd.tools.monitor.sources import Source
from wrcd.tools.monitor.view import View
from wrcd.tools.monitor.why import Line, why

EVERY_S = 0.1  # the screen is brought up to date so often
NOTE_S = 6.0  # what a key has done is told for so long
MAX_EVENTS = 500  # that the page of events lists
ENDING = (signal.SIGTERM, signal.SIGHUP, signal.SIGINT)  # they end it as the key does: the terminal is as before


def _keys(*keys: tuple[str, str]) -> list[BindingType]:
    return [Binding(key, action, show=False) for key, action in keys]


class Monitor(App[None]):
    """The screen. ticking: False where a test turns it by hand."""

    ENABLE_COMMAND_PALETTE = False
    TITLE = "wrcd monitor"
    CSS = "Screen { overflow: hidden; }"
    BINDINGS = [
        *_keys(
            ("space", "pause"), ("left", "move(-1)"), ("right", "move(1)"), ("shift+left,pageup", "move(-10)"),
            ("shift+right,pagedown", "move(10)"), ("home", "ends(False)"), ("end", "ends(True)"),
            ("plus,equals_sign,z", "zoom(True)"), ("minus,Z,underscore", "zoom(False)"), ("n", "jump(True)"),
            ("p,N", "jump(False)"), ("w,enter", "why"), ("up", "next_axle(-1)"), ("down,tab", "next_axle(1)"),
            ("e", "events"), ("s", "save"), ("escape", "leave_cursor"), ("t", "colours"), ("question_mark,h", "help"),
            ("q,ctrl+c", "quit"),
        ),
        *_keys(*((str(n), f"axle({n})") for n in range(1, 9))),
    ]  # fmt: skip

    def __init__(
        self, model: Model, source: Source, *, colours: str = "terminal", folder: Path | None = None,
        ticking: bool = True, note: str = "",
    ) -> None:  # fmt: skip
        super().__init__(ansi_color=colours not in GROUNDS)
        self.model, self.source = model, source
        self.view = View()
        self.board = Board(model, self.view)
        self.colours = "none" if self.no_color else colours
        self.updates = 0  # of the screen, that had something to show
        self._folder, self._ticking = folder or Path(), ticking
        self._note, self._note_until_s = note, time.monotonic() + NOTE_S if note else 0.0
        self._widget = CanvasWidget(palette(self.colours), self.redraw)

    def compose(self) -> ComposeResult:
        """One widget: its parts are told apart by what differs, which costs the terminal least."""
        yield self._widget

    def on_load(self) -> None:
        """Before the terminal is touched: from here on a signal leaves it as it was."""
        loop = asyncio.get_running_loop()
        for number in ENDING:
            loop.add_signal_handler(number, self._end, number)

    def _end(self, number: signal.Signals) -> None:
        self.exit(return_code=128 + number)

    def on_mount(self) -> None:
        """Begin; of a log, where something happened."""
        if self.source.link().kind == "log":
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
        at = [
            (first, k)
            for k, axle in enumerate(model.axles)
            if axle in model.axles_that_came
            and (first := first_of_interest(Board(model, View(k)).happenings(), axle.spells.all())) is not None
        ]
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
        if self._widget.show(self.board.draw(width, height, self.source.link(), note)):
            self.updates += 1

    def tell(self, note: str) -> None:
        """Say for a moment what a key has done."""
        self._note, self._note_until_s = note, time.monotonic() + NOTE_S

    @property
    def _begin_us(self) -> int:
        return self.model.begin_us or 0

    def action_pause(self) -> None:
        """Hold the screen, or follow again."""
        if self.source.link().kind == "log":
            self.tell("a log stands still: move the cursor with ← and →")
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
        if newest and self.source.link().kind == "live":
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
        self.tell(f"{h.text}  (w: why)" if h else f"no {which} event of axle {self.board.axle.number}")
        self.redraw()

    def action_axle(self, number: int) -> None:
        """Choose by number."""
        places = [k for k, a in enumerate(self.model.axles) if a.number == number]
        if not places:
            self.tell(f"there is no axle {number}")
        elif self.model.axles[places[0]] not in self.model.axles_that_came:
            self.tell(f"nothing came of axle {number}")
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
        self.view.leave_cursor()
        self.redraw()

    def action_colours(self) -> None:
        """The next palette."""
        if self.no_color:
            self.tell("NO_COLOR is set")
            self.redraw()
            return
        self.colours = NAMES[(NAMES.index(self.colours) + 1) % len(NAMES)]
        self.ansi_color = self.colours not in GROUNDS
        self._widget.repaint(palette(self.colours))

    def action_why(self) -> None:
        """Why it is so, at the cursor or now."""
        at_us = self.view.at_us(self.model.now_us)
        self._page(
            f"why, axle {self.board.axle.number}", why(self.board, at_us, min(round(0.96 * self.size.width), 110) - 6)
        )

    def action_events(self) -> None:
        """All events."""
        begin_us = self._begin_us
        found = self.board.happenings()[-MAX_EVENTS:]
        lines: list[Line] = [
            (f"{(h.time_us - begin_us) / 1e6:10.2f} s  {h.text}", "plain" if h.is_fall else "dim")
            for h in reversed(found)
        ]  # fmt: skip
        self._page(f"events of axle {self.board.axle.number}, newest first", lines or [("none", "dim")])

    def action_help(self) -> None:
        """Keys and signs."""
        self._page("wrcd monitor: it only listens", help_lines())

    def _page(self, title: str, lines: list[Line]) -> None:
        ground = GROUNDS.get(self.colours, "ansi_default")
        self.push_screen(Page(title, lines, palette(self.colours), ground))

    def action_save(self) -> None:
        """A log of the frames that are held, and a picture, both new files."""
        link = self.source.link()
        stamp = time.strftime("%Y%m%d-%H%M%S", time.localtime(self.model.now_us // 1_000_000))
        name = plain_stem(Path(link.name).stem if link.kind == "log" else link.name.split(":")[-1])
        stem = free_name(self._folder, f"wrcd-monitor-{name}-{stamp}", (".log", ".svg"))
        svg = self.export_screenshot(title=f"wrcd monitor {link.name}")
        try:
            write_picture(self._folder / f"{stem}.svg", svg)
        except OSError as e:
            self.tell(f"not saved: {e.strerror or e}")
            return
        batches = tuple(self.model.held)
        if link.kind == "log":  # there is one already: the part that is seen
            w = self.view.window(self.model.now_us, self.board.plot_width)
            batches = tuple(b.within(w.begin_us, w.end_us) for b in batches)
        self.tell(f"saving {stem}.log …")
        self.run_worker(lambda: self._save_log(stem, batches, name), thread=True)

    def _save_log(self, stem: str, batches: tuple[Batch, ...], channel: str) -> None:
        try:
            n = write_log(self._folder / f"{stem}.log", batches, channel)
        except OSError as e:
            self.call_from_thread(self.tell, f"{stem}.svg saved, its log not: {e.strerror or e}")
            return
        self.call_from_thread(self.tell, f"saved {stem}.log ({n} frames) and .svg")

    def on_unmount(self) -> None:
        """Let go of the bus."""
        self.source.close()
