"""What a design is tuned for: several goals, which of two designs is ahead in all, and one number out of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from sim_ecu.campaign.comparison.chance import of_pairs
from sim_ecu.campaign.tune.played import DROPS, DRY, GRID, Seen
from wrcd.estimator.design import CHANNELS, COLUMNS, INPUTS, MODELS, Design
from wrcd.estimator.window import BLOCK_TICKS

FloatArray = NDArray[np.float64]
STATES, SECTION = 5, 9  # of a model; operations of a second-order section
WINDOWS = 3  # that every answer is made of: the longest, the usual, the newest part


@dataclass(frozen=True, slots=True)
class Goal:
    """What is to be small: a sum over runs by another. weight: in the one number. floor: what no difference is made
    below: a design that does half of next to nothing is not twice as good. margin: two designs that are surely no
    further apart are equal; docs/how-to/tune-a-design.md gives the reason of each."""

    words: str
    unit: str
    suite: str
    above: str
    below: str
    factor: float
    weight: float
    floor: float
    margin: float

    def sums(self, seen: Sequence[Seen]) -> tuple[FloatArray, FloatArray]:
        """(n,) of every run of the suite."""
        rows = [(getattr(s, self.above), getattr(s, self.below)) for s in seen if s.suite == self.suite]
        table = np.array(rows, dtype=np.float64).reshape(-1, 2)
        return self.factor * table[:, 0], table[:, 1]

    def value(self, seen: Sequence[Seen]) -> float:
        """Over all runs; NaN without any."""
        above, below = self.sums(seen)
        return float(above.sum() / below.sum()) if below.any() else math.nan


GOALS = (
    Goal("mean error", "pp", GRID, "error_pp", "valid", 1.0, 1.0, 0.05, 0.1),
    Goal("lie after a drop", "s", DROPS, "lie_s", "drops", 1.0, 1.0, 0.2, 0.04),
    Goal("dry rail called low", "s/h", DRY, "low_s", "dry_s", 3600.0, 0.25, 10.0, 2.0),
    Goal("not Valid", "share", GRID, "silent", "frames", 1.0, 0.25, 0.02, 0.01),
)
ERROR, SILENT = 0, 3
SILENT_PP = 5.0  # what a frame that is not Valid counts as in the one number: silence is no way to a small error
COST_WEIGHT, COST_MARGIN = 0.1, 0.1  # the margin as a share


@dataclass(frozen=True, slots=True)
class Figures:
    """A design's goals, and its cost: operations an axle and tick, counted and not measured."""

    values: tuple[float, ...]
    cost: int

    @property
    def _heard(self) -> tuple[float, ...]:
        """The goals with the frames that are not Valid in the error."""
        out, silent = [*self.values], self.values[SILENT]
        out[ERROR] = (1.0 - silent) * out[ERROR] + silent * SILENT_PP if silent < 1.0 else SILENT_PP
        return tuple(out)

    def behind(self, other: "Figures") -> bool:
        """Whether the other is nowhere worse, and better somewhere. No figure is worse than any."""
        mine, theirs = ([math.inf if math.isnan(v) else v for v in (*f.values, float(f.cost))] for f in (self, other))
        pairs = list(zip(mine, theirs, strict=True))
        return all(b <= a for a, b in pairs) and any(b < a for a, b in pairs)

    def against(self, other: "Figures") -> float:
        """One number: the goals' logarithms over another design's, by weight. Below 0: better. inf without a figure."""
        if not all(map(math.isfinite, (*self._heard, *other._heard))):
            return math.inf
        parts = [
            g.weight * math.log((mine + g.floor) / (theirs + g.floor))
            for g, mine, theirs in zip(GOALS, self._heard, other._heard, strict=True)
        ]
        return sum(parts) + COST_WEIGHT * math.log(self.cost / other.cost)


def figures(design: Design, seen: Sequence[Seen]) -> Figures:
    """Of a design on runs."""
    return Figures(tuple(g.value(seen) for g in GOALS), operations(design))


def front(every: Sequence[Figures]) -> list[int]:
    """Places of those that no other is ahead of in all goals."""
    return [k for k, f in enumerate(every) if not any(f.behind(other) for other in every)]


def operations(design: Design) -> int:
    """Multiplications and additions of an axle's tick: four filters, the band, and an answer every fourth tick, over
    all rules and their slopes."""
    step = 2 * (STATES * STATES + 2 * STATES * CHANNELS + CHANNELS * CHANNELS)
    band = SECTION * CHANNELS * len(design.lowpass)
    rule = INPUTS + 2 * 2 * COLUMNS
    return MODELS * (step + band) + round(WINDOWS * len(design.rules) * rule / BLOCK_TICKS)


class Verdict(StrEnum):
    """Of a goal: one design against another."""

    BETTER = "better"
    EQUAL = "equal"
    WORSE = "worse"
    OPEN = "cannot tell"


class Outcome(StrEnum):
    """Of all goals together."""

    BEATS = "beats"
    EQUALS = "equals"
    FAILS = "does not reach"
    OPEN = "cannot tell"


@dataclass(frozen=True, slots=True)
class Difference:
    """One design's goal less another's on the same runs, and the ends of its interval (NaN: too few runs to tell)."""

    words: str
    unit: str
    margin: float
    ours: float
    theirs: float
    low: float
    high: float

    @property
    def verdict(self) -> Verdict:
        """Equal: the whole interval lies within the margin. Better or worse: nought is outside of it. Otherwise, and
        without an interval, the runs cannot tell."""
        if max(-self.low, self.high) <= self.margin:
            return Verdict.EQUAL
        if self.high < 0.0:
            return Verdict.BETTER
        return Verdict.WORSE if self.low > 0.0 else Verdict.OPEN


ALPHA = 0.1  # chance that any interval of a design does not hold its difference (Bonferroni)


def differences(ours: Sequence[Seen], theirs: Sequence[Seen], costs: tuple[int, int]) -> list[Difference]:
    """Of every goal, and of the operations (ours, theirs), which chance does not touch. The runs are paired."""
    out = [_difference(g, ours, theirs) for g in GOALS]
    mine, other = map(float, costs)
    return [*out, Difference("operations", "", COST_MARGIN * other, mine, other, mine - other, mine - other)]


def _difference(goal: Goal, ours: Sequence[Seen], theirs: Sequence[Seen]) -> Difference:
    terms = [_terms(*goal.sums(seen)) for seen in (theirs, ours)]
    low = high = math.nan
    if np.isfinite(terms).all() and len(terms[0]):
        first, second = (t[:, None] for t in terms)
        (found,) = of_pairs(first, second, range(len(first)), ALPHA / len(GOALS))
        low, high = found.low, found.high
    return Difference(goal.words, goal.unit, goal.margin, goal.value(ours), goal.value(theirs), low, high)


def _terms(above: FloatArray, below: FloatArray) -> FloatArray:
    """What each run adds to a sum over a sum, to first order; their mean is the goal's value. NaN without any."""
    if not below.any():
        return np.full(len(below), math.nan)
    value = above.sum() / below.sum()
    return np.asarray(value + (above - value * below) / below.mean(), np.float64)


def outcome(every: Sequence[Difference]) -> Outcome:
    """What the differences come to."""
    found = {d.verdict for d in every}
    if Verdict.WORSE in found:
        return Outcome.FAILS
    if Verdict.OPEN in found:
        return Outcome.OPEN
    return Outcome.BEATS if Verdict.BETTER in found else Outcome.EQUALS
