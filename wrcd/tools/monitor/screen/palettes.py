"""How a style looks: in the terminal's own colours, on dark, on light, and without colour."""

from collections.abc import Mapping

from rich.style import Style

from wrcd.tools.monitor.canvas import STYLES

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
    """Styles by their place in STYLES. Of "none": without a colour."""
    of = {"terminal": _TERMINAL, "dark": _DARK, "light": _LIGHT, "none": _NONE}[name]
    ground = f" on {GROUNDS[name]}" if name in GROUNDS else ""
    return {
        place: Style.parse((text := of.get(style, "")) + ("" if " on " in text else ground))
        for place, style in enumerate(STYLES)
    }
