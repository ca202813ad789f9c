"""What a design is tuned for: several goals, which of two designs is ahead in all, and one number out of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.campaign.tune.played import DROPS, DRY, GRID, Seen
from sim_ecu.score.metrics.bootstrap import Draws, FloatArray
from wrcd.estimator.design import CHANNELS, COLUMNS, INPUTS, MODELS, Design
from wrcd.estimator.window import BLOCK_TICKS

STATES, SECTION = 5, 9  # of a model; operations of a second-order section
WINDOWS = 3  # that every answer is made of: the longest, the usual, the newest part


@dataclass(frozen=True, slots=True)
class Goal:
    """What is to be small: a sum over runs by another. weight: in the one number. floor: what no difference is made
    below: a design that does half of next to nothing is not twice as good."""

    words: str
    unit: str
    suite: str
    above: str
    below: str
    factor: float
    weight: float
    floor: float

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
    Goal("mean error", "pp", GRID, "error_pp", "valid", 1.0, 1.0, 0.05),
    Goal("lie after a drop", "s", DROPS, "lie_s", "drops", 1.0, 1.0, 0.2),
    Goal("dry rail called low", "s/h", DRY, "low_s", "dry_s", 3600.0, 0.25, 10.0),
    Goal("not Valid", "share", GRID, "silent", "frames", 1.0, 0.25, 0.02),
)
ERROR, SILENT = 0, 3
SILENT_PP = 5.0  # what a frame that is not Valid counts as in the one number: silence is no way to a small error
COST_WEIGHT = 0.1


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
        """Whether the other is nowhere worse, and better somewhere."""
        pairs = [*zip(self.values, other.values, strict=True), (float(self.cost), float(other.cost))]
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


@dataclass(frozen=True, slots=True)
class Difference:
    """One design's goal less another's on the same runs, and the ends of its interval."""

    goal: Goal
    ours: float
    theirs: float
    low: float
    high: float

    @property
    def verdict(self) -> str:
        """In words."""
        if self.high < 0.0:
            return "better"
        return "worse" if self.low > 0.0 else "within chance"


TAILS = 0.05  # on each side, of all goals together


def differences(ours: Sequence[Seen], theirs: Sequence[Seen]) -> list[Difference]:
    """Runs are paired and drawn together. The intervals hold all differences at once with 90 % (Bonferroni)."""
    tail = TAILS / len(GOALS)
    out = []
    for g in GOALS:
        (above, below), (above_2, below_2) = g.sums(ours), g.sums(theirs)
        times = Draws(np.arange(len(below))).times
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = (times @ above) / (times @ below) - (times @ above_2) / (times @ below_2)
        apart = apart[np.isfinite(apart)]
        low, high = np.quantile(apart, (tail, 1.0 - tail)) if len(apart) else (math.nan, math.nan)
        out.append(Difference(g, g.value(ours), g.value(theirs), float(low), float(high)))
    return out


def verdict(every: Sequence[Difference]) -> str:
    """What the differences come to."""
    found = {d.verdict for d in every}
    if "worse" in found:
        return "does not reach"
    return "beats" if "better" in found else "equals"
