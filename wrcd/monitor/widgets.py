"""A canvas as a widget, the pages that lie over it, and how a style looks: in the terminal's own colours, on dark, on
light, and without colour."""

from collections.abc import Callable, Mapping, Sequence

from rich.segment import Segment
from rich.style import Style
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import VerticalScroll
from textual.geometry import Region
from textual.screen import ModalScreen
from textual.strip import Strip
from textual.widget import Widget
from textual.widgets import Static

from wrcd.monitor.canvas import STYLES, Canvas
from wrcd.monitor.panels import Cell

# The terminal's own colours are readable on its own ground, be it dark or light; yellow is not on white.
_TERMINAL = {
    "dim": "dim", "title": "bold", "label": "dim italic", "good": "green", "warn": "black on yellow",
    "bad": "bold red", "available": "bold green", "used": "blue", "fill": "blue", "interval": "dim green",
    "truth": "magenta",
    "cursor": "reverse", "selected": "bold", "key": "bold", "live": "black on green", "paused": "black on yellow",
    "log": "black on cyan",
}  # fmt: skip
_DARK = {
    "plain": "#d0d4d8", "dim": "#7d8590", "title": "bold #ffffff", "label": "#8b949e", "good": "#56d364",
    "warn": "bold #e3b341", "bad": "bold #ff7b72", "available": "bold #7ee787", "used": "#58a6ff", "fill": "#2b5480",
    "interval": "#3f6b4c", "truth": "bold #d2a8ff", "cursor": "#0d1117 on #d0d4d8", "selected": "bold #ffffff",
    "key": "bold #79c0ff", "live": "bold #0d1117 on #56d364", "paused": "bold #0d1117 on #e3b341",
    "log": "bold #0d1117 on #79c0ff",
}  # fmt: skip
_LIGHT = {
    "plain": "#24292f", "dim": "#6e7781", "title": "bold #000000", "label": "#57606a", "good": "#116329",
    "warn": "bold #7d4e00", "bad": "bold #a40e26", "available": "bold #116329", "used": "#0969da", "fill": "#9ec5f5",
    "interval": "#b8d8be", "truth": "bold #8250df", "cursor": "#ffffff on #24292f", "selected": "bold #000000",
    "key": "bold #0550ae", "live": "bold #ffffff on #116329", "paused": "bold #ffffff on #7d4e00",
    "log": "bold #ffffff on #0550ae",
}  # fmt: skip
_NONE = {
    "dim": "dim", "title": "bold", "label": "dim", "warn": "bold", "bad": "bold", "available": "bold", "fill": "dim",
    "cursor": "reverse", "selected": "bold", "key": "bold", "live": "reverse", "paused": "bold reverse",
    "log": "reverse",
}  # fmt: skip
GROUNDS = {"dark": "#0d1117", "light": "#ffffff"}
NAMES = ("terminal", "dark", "light")  # that a key goes through


def palette(name: str) -> Mapping[int, Style]:
    """Return styles by their place in STYLES; of "none" without a colour."""
    of = {"terminal": _TERMINAL, "dark": _DARK, "light": _LIGHT, "none": _NONE}[name]
    ground = f" on {GROUNDS[name]}" if name in GROUNDS else ""
    return {
        place: Style.parse((text := of.get(style, "")) + ("" if " on " in text else ground))
        for place, style in enumerate(STYLES)
    }


class CanvasWidget(Widget, can_focus=True):
    """Shows a canvas. What has changed since the last one is all that is sent to the terminal."""

    DEFAULT_CSS = "CanvasWidget { width: 100%; height: 100%; }"

    def __init__(self, styles: Mapping[int, Style], resized: Callable[[], None]) -> None:
        super().__init__()
        self.styles_of, self._resized = styles, resized
        self.canvas: Canvas | None = None

    def on_resize(self) -> None:
        """Another size is another canvas."""
        self._resized()

    def show(self, canvas: Canvas) -> bool:
        """The next canvas. Returns whether anything differs."""
        before, self.canvas = self.canvas, canvas
        changes = canvas.changes(before)
        if changes:
            self.refresh(*(Region(*rect) for rect in changes))
        return bool(changes)

    def repaint(self, styles: Mapping[int, Style]) -> None:
        """All of it, in other colours."""
        self.styles_of = styles
        self.refresh()

    def render_line(self, y: int) -> Strip:
        """A line of the canvas."""
        canvas = self.canvas
        if canvas is None or y >= canvas.height:
            return Strip.blank(self.size.width, self.styles_of[0])
        styles = self.styles_of
        return Strip([Segment(text, styles[style]) for text, style in canvas.runs(y)], canvas.width)


class TextPage(ModalScreen[None]):
    """Text over the screen, which moves on below. Any of its keys, or Escape, closes it."""

    DEFAULT_CSS = """
    TextPage { align: center middle; background: transparent; }
    TextPage > VerticalScroll {
        width: 96%; max-width: 110; height: auto; max-height: 96%; border: round $foreground; padding: 0 1;
        scrollbar-size-vertical: 1;
    }
    """
    BINDINGS = [Binding(key, "dismiss", show=False) for key in ("escape", "q", "w", "enter", "question_mark", "h", "e")]

    def __init__(self, title: str, lines: Sequence[Cell], styles: Mapping[int, Style], ground: str) -> None:
        super().__init__()
        self._ground = ground
        self._title, self._lines, self._styles = title, lines, styles

    def compose(self) -> ComposeResult:
        """A title in the frame, the lines in it."""
        places = {name: place for place, name in enumerate(STYLES)}
        text = Text("\n").join(Text(line, self._styles[places[style]]) for line, style in self._lines)
        box = VerticalScroll(Static(text))
        box.styles.background = self._ground
        box.border_title, box.border_subtitle = self._title, "Esc closes"
        yield box

    def action_dismiss(self) -> None:  # type: ignore[override]
        """Close."""
        self.dismiss()
