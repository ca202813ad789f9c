"""Pictures of a page: each with words for those who do not see it, wide and narrow, light and dark."""

import base64
import io
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Drawing

from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Figure

DARK = {"figure.facecolor": "#16191c", "axes.facecolor": "#16191c", "savefig.facecolor": "#16191c"}
NARROW = 20  # characters of a row's name on a narrow page


@dataclass(frozen=True, slots=True)
class PictureLook:
    """How wide (inches), and on what."""

    wide: bool
    dark: bool

    @property
    def width(self) -> float:
        """The picture's width, in inches of 10-point text."""
        return 10.0 if self.wide else 4.4


# A browser takes the first whose medium it is; wide and light is for all others and for paper.
LOOKS = {
    PictureLook(False, True): "screen and (prefers-color-scheme: dark) and (max-width: 40rem)",
    PictureLook(True, True): "screen and (prefers-color-scheme: dark)",
    PictureLook(False, False): "screen and (max-width: 40rem)",
    PictureLook(True, False): "",
}


@dataclass(frozen=True, slots=True)
class Picture:
    """A title, a sentence below it, what it shows in words, and how it is drawn."""

    title: str
    caption: str
    alt: str
    make: Callable[[PictureLook], Drawing]
    kind: ClassVar[str] = "picture"

    def draw(self, look: PictureLook) -> bytes:
        """Return it as PNG."""
        with plt.style.context(["dark_background", DARK] if look.dark else ["default"]):
            figure = self.make(look)
            data = io.BytesIO()
            figure.savefig(data, format="png", dpi=100 if look.wide else 150)
            plt.close(figure)
        return data.getvalue()

    def images(self) -> list[tuple[str, str]]:
        """Return it in every look, as medium and data URL."""
        return [(m, f"data:image/png;base64,{base64.b64encode(self.draw(k)).decode()}") for k, m in LOOKS.items()]


def text_colour() -> str:
    """Return the colour of what is neither an estimate nor a verdict."""
    return str(plt.rcParams["text.color"])


def single(look: PictureLook, height: float) -> tuple[Drawing, Axes]:
    """Return a picture of one field."""
    figure, (ax,) = fields(look, 1, height, margin=0.0)
    return figure, ax


def fields(
    look: PictureLook, n: int, height: float, columns: int = 3, margin: float = 0.8, **more: Any
) -> tuple[Drawing, list[Axes]]:
    """Return a picture of n fields, each so high, in columns where it is wide. margin: for what is not in a field."""
    columns = min(columns if look.wide else 1, n)
    rows = math.ceil(n / columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(look.width, margin + height * rows), layout="constrained", squeeze=False, **more
    )
    for ax in axes.flat[n:]:
        ax.set_visible(False)
    for ax in axes.flat:
        ax.grid(alpha=0.3)
    return figure, list(axes.flat[:n])


def legend(figure: Drawing, look: PictureLook, handles: dict[str, Artist] | None = None, columns: int = 4) -> None:
    """Put a legend below the fields: of these handles by name, or of all labels, each once."""
    if handles is None:
        found = [ax.get_legend_handles_labels() for ax in figure.axes]
        handles = {name: h for artists, names in found for h, name in zip(artists, names, strict=True)}
    figure.legend(list(handles.values()), list(handles), loc="outside lower center",
                  ncols=columns if look.wide else 2, frameon=False)  # fmt: skip


def rows(ax: Axes, names: Sequence[str], look: PictureLook) -> None:
    """Name the rows of a field from the top, shortened where it is narrow."""
    shown = [name if look.wide or len(name) <= NARROW else name[: NARROW - 1] + "…" for name in names]
    ax.set_yticks(range(len(names)), shown)
    ax.set_ylim(len(names) - 0.5, -0.5)


def interval(
    ax: Axes, at: float, f: Figure, colour: str, marker: str = "o", label: str | None = None, bold: bool = True
) -> None:
    """Draw a figure in a row: its interval as a line, its value as a sign."""
    ax.plot([f.low, f.high], [at, at], color=colour, lw=2.5 if bold else 1.0)
    ax.plot(f.value, at, marker, color=colour, ms=8 if bold else 5, label=label)


def lines(
    look: PictureLook, x: Sequence[float], of: dict[str, Sequence[float]], labels: tuple[str, str],
    colours: dict[str, str], bold: str = "",
) -> Drawing:  # fmt: skip
    """Return a picture of lines over x, from 0 up, one of them bold; labels of both axes."""
    figure, ax = single(look, 4.2)
    for name, y in of.items():
        ax.plot(x, y, marker="o", lw=2.6 if name == bold else 1.2, label=name, color=colours[name])
    ax.set(xlabel=labels[0], ylabel=labels[1])
    ax.set_ylim(bottom=0)
    legend(figure, look)
    return figure


VERDICTS = {
    MET: ("o", "tab:green", "met"), MET_CHANCE: ("P", "tab:olive", "met, within chance"),
    CHANCE: ("D", "tab:orange", "missed, within chance"),
    MISSED: ("X", "tab:red", "missed"), TOO_FEW: ("$?$", "0.55", "too few runs to judge"),
}  # fmt: skip


def goals(judged: Sequence[dict[str, Any]]) -> Picture:
    """Return a sign for each goal, by suite: what stands before the goal's first colon."""
    by_suite: dict[str, list[str]] = {}
    for g in judged:
        by_suite.setdefault(g["what"].partition(":")[0], []).append(g["verdict"])

    def make(look: PictureLook) -> Drawing:
        figure, ax = single(look, 1.1 + 0.3 * len(by_suite))
        for verdict, (marker, colour, label) in VERDICTS.items():
            at = [(k, y) for y, row in enumerate(by_suite.values()) for k, v in enumerate(row) if v == verdict]
            if at:
                x, y = zip(*at, strict=True)
                ax.scatter(x, y, marker=marker, color=colour, s=70 if look.wide else 26, label=label)
        rows(ax, list(by_suite), look)
        ax.set_xticks([])
        ax.grid(False)
        ax.spines[["top", "right", "bottom"]].set_visible(False)
        legend(figure, look)
        return figure

    words = []
    for name, row in by_suite.items():
        n = Counter(row)
        words.append(f"{name}: " + ", ".join(f"{n[v]} {label}" for v, (_, _, label) in VERDICTS.items() if n[v]))
    return Picture(
        "Goals", "A sign for each goal, by suite. The last table says what each is and what was measured.",
        "Verdicts by suite. " + "; ".join(words) + ".", make,
    )  # fmt: skip
