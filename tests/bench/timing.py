"""Times of things that are run in turn, and what is made of them: rows with ratios and goals."""

import gc
import statistics
import sys
import time
import timeit
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

MIN_BLOCKS, MAX_BLOCKS = 5, 60


@dataclass(frozen=True, slots=True)
class Times:
    """Time per unit of each block, in the row's unit. Blocks with one index ran one after another."""

    blocks: tuple[float, ...]

    @property
    def minimum(self) -> float:
        return min(self.blocks)

    @property
    def median(self) -> float:
        return statistics.median(self.blocks)

    def over(self, other: "Times") -> float:
        """The median of the blocks' ratios: what disturbs both alike drops out."""
        return statistics.median(a / b for a, b in zip(self.blocks, other.blocks, strict=True))


@dataclass(frozen=True, slots=True)
class Case:
    """Something to time: run(count) does count units of it. Where a part of that does not count, it returns the
    nanoseconds that do."""

    run: Callable[[int], object]
    count: int


@dataclass(frozen=True, slots=True)
class Goal:
    """What a number is to be."""

    sense: Literal["≤", "≥"]
    limit: float

    def met(self, value: float) -> bool:
        return value <= self.limit if self.sense == "≤" else value >= self.limit

    def verdict(self, value: float) -> str:
        return f"goal {self.sense} {self.limit:g}: {'met' if self.met(value) else 'missed'}"


@dataclass(frozen=True, slots=True)
class Figure:
    """A number made of a row's times, perhaps with a goal. minima: the same ratio made of the shortest blocks."""

    name: str
    value: float
    goal: Goal | None = None
    minima: float | None = None
    unit: str = ""


@dataclass(slots=True)
class Row:
    """One line of the result: times by name (ours first), figures made of them, and what to know about it."""

    group: str
    name: str
    unit: str = "µs"
    times: dict[str, Times] = field(default_factory=dict)
    figures: list[Figure] = field(default_factory=list)
    note: str = ""

    def compare(self, above: str, below: str, goal: Goal | None = None) -> None:
        """Add the ratio of two of the times; nothing where one was skipped."""
        if above in self.times and below in self.times:
            a, b = self.times[above], self.times[below]
            self.figures.append(Figure(f"{above} / {below}", a.over(b), goal, a.minimum / b.minimum))

    def document(self) -> dict[str, Any]:
        return {
            "group": self.group,
            "name": self.name,
            "unit": self.unit,
            "times": {
                name: {"minimum": t.minimum, "median": t.median, "blocks": len(t.blocks)}
                for name, t in self.times.items()
            },
            "figures": [
                {
                    "name": f.name, "value": f.value, "unit": f.unit, "of_minima": f.minima,
                    "goal": f"{f.goal.sense} {f.goal.limit:g}" if f.goal else None,
                    "met": f.goal.met(f.value) if f.goal else None,
                }
                for f in self.figures
            ],
            "note": self.note,
        }  # fmt: skip


def in_turn(cases: Mapping[str, Case], budget_s: float) -> dict[str, Times]:
    """Run the cases one after another, block by block, until the budget is used up. Microseconds per unit, of processor
    time: what else the computer does meanwhile does not count, but for what it takes of caches and clock rate."""
    blocks: dict[str, list[float]] = {name: [] for name in cases}
    for case in cases.values():
        case.run(max(1, case.count // 10))  # caches, lazy imports
    end = time.monotonic() + budget_s
    done = 0
    while done < MIN_BLOCKS or (done < MAX_BLOCKS and time.monotonic() < end):
        for name, case in cases.items():
            gc.collect(0)
            gc.disable()
            try:
                begin = time.process_time_ns()
                spent = case.run(case.count)
                elapsed = time.process_time_ns() - begin
            finally:
                gc.enable()
            blocks[name].append((spent if isinstance(spent, int) else elapsed) * 1e-3 / case.count)
        done += 1
    return {name: Times(tuple(b)) for name, b in blocks.items()}


def yardstick() -> str:
    """How fast this computer is just now, for a figure to be judged by: shortest of some runs."""
    a, b = np.ones((2, 4)), np.ones((2, 4))
    small = min(timeit.repeat(lambda: np.add(a, b), number=10_000, repeat=7)) * 100
    loop = min(timeit.repeat(lambda: sum(range(1000)), number=1000, repeat=7)) * 1000
    return f"np.add of 2 x 4 {small:.2f} µs, sum(range(1000)) {loop:.1f} µs"


def show(what: str) -> None:
    """Say on standard error what is being measured."""
    print(f"bench: {what}", file=sys.stderr, flush=True)


def text(rows: Iterable[Row]) -> str:
    """The result for a terminal: shortest and median block of each, then what is made of them."""
    out: list[str] = []
    group = ""
    for row in rows:
        if row.group != group:
            group = row.group
            out += ["", f"{group}"]
        times = ", ".join(f"{name} {_number(t.minimum)}/{_number(t.median)}" for name, t in row.times.items())
        out.append(f"  {row.name}: {times}{' ' + row.unit if times else ''}".rstrip(" :"))
        out += [f"      {_said(f)}" for f in row.figures]
        if row.note:
            out.append(f"      ({row.note})")
    return "\n".join(out).lstrip("\n")


def markdown(rows: Iterable[Row]) -> str:
    """The ratios and goals as a table for docs/."""
    out = ["| | ratios and goals |", "|---|---|"]
    group = ""
    for row in rows:
        if row.group != group:
            group = row.group
            out.append(f"| **{group}** | |")
        said = "; ".join(_said(replace(f, minima=None)) for f in row.figures)
        out.append(f"| {row.name} | {said}{f' ({row.note})' if row.note else ''} |")
    return "\n".join(out)


def _said(f: Figure) -> str:
    minima = f" (of the minima {_number(f.minima)})" if f.minima is not None else ""
    goal = f", {f.goal.verdict(f.value)}" if f.goal else ""
    return f"{f.name}: {_number(f.value)}{' ' + f.unit if f.unit else ''}{minima}{goal}"


def _number(x: float) -> str:
    return f"{x:.3g}" if abs(x) < 1000 else f"{x:,.0f}".replace(",", " ")
