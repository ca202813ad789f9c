"""A configuration in the making: its lines, and what is open or unsure about them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import wrap

WIDTH = 118


@dataclass(slots=True)
class Draft:
    """Lines of TOML. Open points are numbered; each stands beside its key, and in a list at the head."""

    dbc: str
    lines: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)
    unsure: dict[str, list[str]] = field(default_factory=dict)  # what: where
    timeouts_ms: dict[str, float] = field(default_factory=dict)  # of inputs without which there is no estimate

    def add(self, *lines: str) -> None:
        """Append lines."""
        self.lines += lines

    def remark(self, text: str) -> None:
        """Append a comment."""
        self.lines += _wrap(text, "# ", "#   ")

    def todo(self, about: str, text: str) -> None:
        """Append an open point: the configuration is refused, or wrong, until a person has settled it."""
        self.open.append(f"{about}: {text}")
        self.remark(f"TODO {len(self.open)}: {text}")

    def doubt(self, about: str, text: str) -> None:
        """Append what was taken for the likeliest."""
        self.unsure.setdefault(text, []).append(about)
        self.remark(f"unsure: {text}")

    def text(self) -> str:
        """The whole file."""
        head = [
            f"# Proposed by wrcd init for {self.dbc}: by names, units and words, which is no knowledge.",
            "# Read every line of it. A DBC does not tell how a sensor is mounted: docs/reference/signs.md has signs,",
            "# and `wrcd check --log LOG` compares them with a run.",
            "#",
            "# Open, a person settles it:",
            *_numbered(self.open, "TODO "),
            "#",
            *(["# Unsure, taken for the likeliest:", *_numbered(self._doubts()), "#"] if self.unsure else []),
            "# Then: wrcd check --config THIS-FILE",
        ]
        return "\n".join([*head, "", *self.lines]) + "\n"

    def summary(self, output: Path | None) -> list[str]:
        """The same for a person who looks at stderr."""
        where = "" if output is None else f"{output}: "
        return [
            *(f"{where}TODO {n}: {what}" for n, what in enumerate(self.open, 1)),
            *(f"{where}unsure: {what}" for what in self._doubts()),
        ]

    def _doubts(self) -> list[str]:
        """One doubt of several keys once."""
        return [f"{'; '.join(where)}: {what}" for what, where in self.unsure.items()]


def _numbered(points: Sequence[str], word: str = "") -> list[str]:
    out: list[str] = []
    for n, point in enumerate(points, 1):
        out += _wrap(point, f"#   {word}{n}: ", "#      ")
    return out


def _wrap(text: str, first: str, then: str) -> list[str]:
    return wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=then, break_on_hyphens=False, break_long_words=False
    )


def quoted(value: object) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {quoted(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(quoted, value)) + "]"
    return f"{value:g}" if isinstance(value, float) else str(value)
