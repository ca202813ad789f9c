"""What of the model is looked at: which axle, until when, how far back, and where the cursor is."""

from collections.abc import Sequence
from dataclasses import dataclass

from wrcd.tools.monitor.happenings import Happening
from wrcd.tools.monitor.plot import SPANS_S, Window, window

DEFAULT_SPAN_S = 30


@dataclass(slots=True)
class View:
    """now_us and begin_us of the model go in with every question: a view has no time of its own."""

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
        """The newest time that is shown."""
        return now_us if self.paused_us is None else self.paused_us

    def at_us(self, now_us: int) -> int:
        """The time whose values are shown: the cursor's, else the newest."""
        return self.now_us(now_us) if self.cursor_us is None else self.cursor_us

    def window(self, now_us: int, cells: int) -> Window:
        """The plot's times."""
        end_us = self.now_us(now_us) if self.end_us is None else self.end_us
        return window(end_us, self.span_s * 1_000_000, cells)

    def pause(self, now_us: int) -> None:
        """Hold the screen. What comes is kept."""
        if self.paused_us is None:
            self.paused_us = now_us

    def resume(self) -> None:
        """Live again, without a cursor."""
        self.paused_us = self.cursor_us = self.end_us = None

    def leave_cursor(self) -> None:
        """Take the cursor away; the screen stays where it is."""
        self.cursor_us = None

    def move(self, cells: int, now_us: int, begin_us: int, width: int) -> None:
        """Move the cursor by cells of a plot of so many; one at its edge takes the plot with it."""
        self.pause(now_us)
        step_us = self.window(now_us, width).cell_us
        self.go(self.at_us(now_us) + cells * step_us, now_us, begin_us, width)

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
            before = [h for h in found if h.time_us <= self.now_us(now_us)]
            there = before[-1:]
        elif forward:
            there = [h for h in found if self.cursor_us < h.time_us <= self.now_us(now_us)][:1]
        else:
            there = [h for h in found if h.time_us < self.cursor_us][-1:]
        if not there:
            return None
        self.go(there[0].time_us, now_us, begin_us, width)
        return there[0]
