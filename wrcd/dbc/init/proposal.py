"""A configuration in the making: its lines, and what is open or unsure about them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from textwrap import wrap

from wrcd.errors import InputError

WIDTH = 118


@dataclass(slots=True)
class Proposal:
    """Lines of TOML. Open points are numbered; each stands beside its key, and in a list at the head."""

    dbc: str
    axle: str = "axle[0]"  # the one in the making, as `wrcd check` names it
    lines: list[str] = field(default_factory=list)
    open: list[str] = field(default_factory=list)
    unsure: dict[str, list[str]] = field(default_factory=dict)  # what: where
    settled: set[str] = field(default_factory=set)  # keys, as `wrcd check` names them, that an open point is about
    timeouts_ms: dict[str, float] = field(default_factory=dict)  # of inputs without which there is no estimate

    def add(self, *lines: str) -> None:
        """Append lines."""
        self.lines += lines

    def add_todo(self, about: str, text: str, key: str, line: str) -> None:
        """Append an open point, and the line as a comment for whoever settles it."""
        self.todo(about, text, key)
        self.add(f"# {line}")

    def remark(self, text: str) -> None:
        """Append a comment."""
        self.lines += _wrap(text, "# ", "#   ")

    def todo(self, about: str, text: str, key: str) -> None:
        """Append an open point: the configuration is refused, or wrong, until a person has settled it. key: that
        `wrcd check` refuses for it."""
        self.open.append(f"{about}: {text}")
        self.settled.add(key)
        self.remark(f"TODO {len(self.open)}: {text}")

    def refused(self, errors: Sequence[InputError]) -> None:
        """Add open points for what `wrcd check` refuses of these lines and no open point is about yet."""
        left = [e for e in errors if e.key not in self.settled]
        first = len(self.open) + 1
        self.open += [f"{e.key}: {e.reason}{' — ' * bool(e.hint)}{e.hint}" for e in left]
        for number, e in sorted(enumerate(left, first), key=lambda one: one[1].line or 0, reverse=True):
            at = max(0, (e.line or 1) - 1)
            self.lines[at:at] = _wrap(f"TODO {number}: {e.reason}", "# ", "#   ")

    def doubt(self, about: str, text: str) -> None:
        """Append what was taken for the likeliest."""
        self.unsure.setdefault(text, []).append(about)
        self.remark(f"unsure: {text}")

    def text(self) -> str:
        """The whole file."""
        head = [
            f"# Proposed by wrcd init for {self.dbc}: by names, units and words, which is no knowledge.",
            "# Read every line of it. A DBC does not tell how a sensor is mounted: docs/reference/dbc.md has signs,",
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
