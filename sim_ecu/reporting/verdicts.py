"""Goals: a figure, its bound, and whether it is met or chance may be why."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sim_ecu.reporting.table import Table
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW, Figure, Rounded

MIN_RUNS = 10  # a figure of fewer runs judges nothing
# A quick score has up to ten runs of a suite, chosen to be spread, not to be many: a level of Confidence that held the
# truth in every frame of ten runs was called missed, one of 400 frames met.
MIN_QUICK_RUNS = 20


@dataclass(frozen=True, slots=True)
class Goal:
    """A figure and its bound. never: what is beyond the bound must not happen, not once: a worst case, a count that
    must be zero. Where it has happened no interval excuses it."""

    what: str
    figure: Figure
    bound: float
    at_least: bool = False
    min_runs: int = MIN_RUNS
    never: bool = False

    @property
    def verdict(self) -> str:
        """Whether it is met, and whether chance alone may be why: the interval holds what would be judged otherwise."""
        f = self.figure
        if f.runs < self.min_runs:
            return TOO_FEW
        low, high = (self.bound, math.inf) if self.at_least else (-math.inf, self.bound)
        if low <= f.value <= high:
            return MET_CHANCE if math.isfinite(f.low) and not low <= f.low <= f.high <= high else MET
        return CHANCE if f.low <= high and f.high >= low and not self.never else MISSED

    def record(self) -> dict[str, Any]:
        """Return it as a result holds it, with its verdict."""
        return {
            "what": self.what, "figure": self.figure, "bound": self.bound, "at_least": self.at_least,
            "verdict": self.verdict,
        }  # fmt: skip


def bound(goal: Mapping[str, Any]) -> str:
    """Return a goal's bound with its sign."""
    return f"{'≥' if goal['at_least'] else '≤'} {goal['bound']:g}"


def table(goals: Sequence[dict[str, Any]]) -> Table:
    """Return a row for each goal."""
    rows = [[g["what"], Rounded(g["figure"], 3), bound(g), g["verdict"]] for g in goals]
    return Table(["goal", "value", "bound", ""], rows)
