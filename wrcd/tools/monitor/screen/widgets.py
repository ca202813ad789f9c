"""A canvas as a widget, and the pages that lie over it."""

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

from wrcd.tools.monitor.canvas import STYLES, Canvas
from wrcd.tools.monitor.why import Line


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


class Page(ModalScreen[None]):
    """Text over the screen, which moves on below. Any of its keys, or Escape, closes it."""

    DEFAULT_CSS = """
    Page { align: center middle; background: transparent; }
    Page > VerticalScroll {
        width: 96%; max-width: 110; height: auto; max-height: 96%; border: round $foreground; padding: 0 1;
        scrollbar-size-vertical: 1;
    }
    """
    BINDINGS = [Binding(key, "dismiss", show=False) for key in ("escape", "q", "w", "enter", "question_mark", "h", "e")]

    def __init__(self, title: str, lines: Sequence[Line], styles: Mapping[int, Style], ground: str) -> None:
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
