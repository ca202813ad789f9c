"""A screen of characters, each with a style. What is drawn knows no terminal."""

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

# What something is, not how it looks: the palettes say that (screen/palettes.py).
STYLES = (
    "plain", "dim", "title", "label", "good", "warn", "bad", "available", "used", "fill", "interval", "truth", "cursor",
    "selected", "key", "live", "paused", "log",
)  # fmt: skip
_PLACES = {name: place for place, name in enumerate(STYLES)}
BELOW_CURSOR = (" ", "░", "·")  # what the cursor's line goes over; curves it only marks
PLAIN, CURSOR = _PLACES["plain"], _PLACES["cursor"]


class Rect(NamedTuple):
    """Cells x … x + width - 1 of lines y … y + height - 1."""

    x: int
    y: int
    width: int
    height: int


class Canvas:
    """Characters (height, width) and their styles, as places in STYLES. All characters are one cell wide."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.characters = np.full((height, width), " ", dtype="<U1")
        self.styles = np.zeros((height, width), dtype=np.uint8)

    def put(self, x: int, y: int, text: str, style: str = "plain", width: int | None = None) -> int:
        """Write a text, cut at width and at the edge. Returns the cell behind it."""
        most = self.width - x if width is None else min(width, self.width - x)
        if not 0 <= y < self.height or most <= 0 or not text:
            return x
        if len(text) > most:
            text = text[: most - 1] + "…" if most > 1 else text[:most]
        end = x + len(text)
        self.characters[y, x:end] = list(text)
        self.styles[y, x:end] = _PLACES[style]
        return end

    def put_right(self, end: int, y: int, text: str, style: str = "plain") -> None:
        """Write a text that ends before a cell."""
        self.put(max(end - len(text), 0), y, text, style)

    def invert(self, x: int, rect: Rect) -> None:
        """The cursor: a column of a rectangle."""
        column = self.characters[rect.y : rect.y + rect.height, x]
        styles = self.styles[rect.y : rect.y + rect.height, x]
        styles[:] = np.where(np.isin(column, BELOW_CURSOR), _PLACES["title"], CURSOR)
        column[np.isin(column, BELOW_CURSOR)] = "│"

    def runs(self, y: int) -> Iterator[tuple[str, int]]:
        """A line as texts of one style each."""
        styles = self.styles[y]
        edges = [0, *(np.flatnonzero(np.diff(styles)) + 1).tolist(), self.width]
        line = "".join(self.characters[y].tolist())
        for first, end in pairwise(edges):
            yield line[first:end], int(styles[first])

    def changes(self, before: "Canvas | None") -> list[Rect]:
        """Where it differs from another, a span a line; all of it from one of another size."""
        if before is None or (before.width, before.height) != (self.width, self.height):
            return [Rect(0, 0, self.width, self.height)]
        differs = (self.characters != before.characters) | (self.styles != before.styles)
        out = []
        for y in np.flatnonzero(differs.any(axis=1)).tolist():
            # a span a stretch: what is far apart in a line is sent apart
            columns = np.flatnonzero(differs[y])
            cuts = np.flatnonzero(np.diff(columns) > 12)
            for first, end in zip([0, *(cuts + 1).tolist()], [*cuts.tolist(), len(columns) - 1], strict=True):
                x = int(columns[first])
                out.append(Rect(x, y, int(columns[end]) - x + 1, 1))
        return out

    def text(self) -> str:
        """Its characters, a line each."""
        return "\n".join("".join(line).rstrip() for line in self.characters.tolist())

    def copy(self) -> Self:
        """The same once more."""
        out = type(self)(self.width, self.height)
        out.characters[:], out.styles[:] = self.characters, self.styles
        return out
