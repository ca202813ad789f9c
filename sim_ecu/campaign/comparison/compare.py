"""Two campaigns compared: every figure of every suite, and what of it is more than chance."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.campaign.comparison.chance import MAX_DRAWS, Found, draws, holm, judged, of_pairs, of_samples
from sim_ecu.campaign.comparison.match import Match, Rows, Suite, match
from sim_ecu.campaign.comparison.read import Campaign
from sim_ecu.campaign.job import Ending
from sim_ecu.campaign.kind import Figure, Type
from wrcd.errors import InputError

FloatArray = NDArray[np.float64]
BETTER, WORSE, DIFFERS = "better", "worse", "differs"
CHANCE, SAME, TOO_FEW = "within chance", "the same", "too few worlds"
CLAIMS = (WORSE, BETTER, DIFFERS)
ENDING = Figure("not done", Type.FLAG, "share of the jobs that failed, died or took too long", "", "less")
INTERVALS = (
    "Intervals hold the differences of means that the permutation test does not refuse, not a percentile bootstrap's, "
    "which is too narrow for few worlds"
)
TOGETHER = 50  # figures whose draws are held at once
LACKS = "without "  # a number: the name of the comparison of how many have none


@dataclass(frozen=True, slots=True)
class Comparison:
    """A figure in a suite: the second less the first. values: of each pair (first, second), or of each side's worlds.

    count: pairs, or worlds of both sides. clusters: what is flipped or exchanged at random. p: as it is, and corrected.
    """

    suite: str
    figure: Figure
    paired: bool
    count: tuple[int, int]
    clusters: int
    medians: tuple[float, float]
    found: Found
    corrected: float
    verdict: str
    values: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True)
class Result:
    """All of it. left_out: figures that are texts or only one side has."""

    first: Campaign
    second: Campaign
    matched: Match
    comparisons: tuple[Comparison, ...]
    alpha: float
    judged: int  # comparisons that the correction counts
    left_out: tuple[str, ...]

    @property
    def claims(self) -> list[Comparison]:
        """What is more than chance."""
        return [c for c in self.comparisons if c.verdict in CLAIMS]

    @property
    def unjudged(self) -> list[Comparison]:
        """What differs in too few worlds for any claim."""
        return [c for c in self.comparisons if c.verdict == TOO_FEW and all(c.count)]


def compare(
    first: Campaign, second: Campaign, names: Sequence[str] | None, alpha: float, progress: Callable[[str, float], None]
) -> Result:
    """names: of the figures, None for all. Raises InputError for campaigns or names that do not fit, and for an alpha
    that is too small for so many comparisons."""
    matched = match(first, second)
    figures, left_out = _figures(first, second, names)
    most = len(matched.suites) * (2 * len(figures) + 1)
    if most / alpha > MAX_DRAWS:
        raise InputError(f"{alpha:g} among up to {most} comparisons is stricter than {MAX_DRAWS} draws can tell",
                         key="--alpha", hint="take a larger one, or fewer --figures")  # fmt: skip
    drawn = draws(most, alpha)
    made: list[Comparison] = []
    for k, suite in enumerate(matched.suites):
        progress(f"suite {suite.name}", k / len(matched.suites))
        made += _of_suite(suite, figures, alpha, drawn)
    counted = judged([c.found.least for c in made], alpha)
    for k, corrected in zip(counted, holm([made[k].found.p for k in counted]), strict=True):
        made[k] = replace(made[k], corrected=corrected, verdict=_verdict(made[k], corrected, alpha))
    made = _without_survivors(made)
    return Result(first, second, matched, tuple(made), alpha, len(counted), left_out)


def _figures(first: Campaign, second: Campaign, names: Sequence[str] | None) -> tuple[list[Figure], tuple[str, ...]]:
    theirs = {f.name: f for f in second.figures}
    both = [f for f in first.figures if f.name in theirs and Type.TEXT not in (f.type, theirs[f.name].type)]
    known = [f.name for f in both]
    if names is None:
        left_out = dict.fromkeys(f.name for f in (*first.figures, *second.figures) if f.name not in known)
        return both, tuple(left_out)
    if unknown := [n for n in names if n not in known]:
        raise InputError(f"{unknown[0]!r} is no figure with numbers on both sides", key="--figures",
                         hint=f"figures: {', '.join(known)}")  # fmt: skip
    return [f for f in both if f.name in names], ()


@dataclass(frozen=True, slots=True)
class _Column:
    """A figure of all pairs, or of the worlds of each side."""

    figure: Figure
    first: FloatArray
    second: FloatArray

    @property
    def known(self) -> FloatArray:
        """The numbers of both sides."""
        every = np.concatenate((self.first, self.second))
        return every[np.isfinite(every)]


def _of_suite(suite: Suite, figures: Sequence[Figure], alpha: float, drawn: int) -> list[Comparison]:
    """Figures, where a side has any number; after each who has none, where not all have or lack it; how jobs ended."""
    sides = (
        ([p.first for p in suite.pairs], [p.second for p in suite.pairs])
        if suite.pairs
        else (list(suite.first), list(suite.second))
    )

    def column(figure: Figure, of: Callable[[Rows], float]) -> _Column:
        first, second = (np.array([of(rows) for rows in side], np.float64) for side in sides)
        return _Column(figure, first, second)

    columns: list[_Column] = []
    for f in figures:
        values = column(f, partial(_mean, name=f.name))
        lacks = column(Figure(LACKS + f.name, Type.FLAG, f"share without {f.words}"), partial(_lacking, name=f.name))
        columns += [values] * bool(len(values.known)) + [lacks] * (len(np.unique(lacks.known)) > 1)
    columns.append(column(ENDING, _not_done))
    first, second = np.stack([c.first for c in columns], axis=1), np.stack([c.second for c in columns], axis=1)
    found: list[Found] = []
    for k in range(0, len(columns), TOGETHER):
        a, b = first[:, k : k + TOGETHER], second[:, k : k + TOGETHER]
        found += of_pairs(a, b, suite.clusters, alpha, drawn) if suite.pairs else of_samples(a, b, alpha, drawn)
    return [_comparison(suite, c.figure, c.first, c.second, of) for c, of in zip(columns, found, strict=True)]


def _comparison(suite: Suite, f: Figure, a: FloatArray, b: FloatArray, found: Found) -> Comparison:
    """Without a verdict by chance."""
    known = np.isfinite(a), np.isfinite(b)
    if suite.pairs:
        known = (known[0] & known[1],) * 2
    values = a[known[0]], b[known[1]]
    clusters = len(np.unique(np.asarray(suite.clusters)[known[0]])) if suite.pairs else sum(map(len, values))
    equal = np.array_equal(*values) if suite.pairs else len(np.unique(np.concatenate(values))) == 1
    first, second = (float(np.median(v)) if len(v) else math.nan for v in values)
    return Comparison(
        suite.name, f, bool(suite.pairs), (len(values[0]), len(values[1])), clusters, (first, second), found,
        math.nan, SAME if equal and all(map(len, values)) else TOO_FEW, values,
    )  # fmt: skip


def _verdict(c: Comparison, corrected: float, alpha: float) -> str:
    if corrected > alpha:
        return CHANCE
    if not c.figure.better:
        return DIFFERS
    return WORSE if (c.found.difference > 0) == (c.figure.better == "less") else BETTER


def _without_survivors(made: Sequence[Comparison]) -> list[Comparison]:
    """Nothing is better in the jobs that still have a number of it while more of the second have none."""
    fewer = {(c.suite, c.figure.name) for c in made if c.figure.name.startswith(LACKS) and c.found.difference > 0}
    return [
        replace(c, verdict=DIFFERS) if c.verdict == BETTER and (c.suite, LACKS + c.figure.name) in fewer else c
        for c in made
    ]


def _mean(rows: Rows, name: str) -> float:
    """Of the rows that have a number."""
    known = [float(v) for row in rows if (v := row[name]) is not None and math.isfinite(v)]
    return sum(known) / len(known) if known else math.nan


def _lacking(rows: Rows, name: str) -> float:
    """Share of the rows that are done and have no number."""
    done = [row for row in rows if row["ending"] == Ending.DONE]
    without = [row[name] is None or not math.isfinite(row[name]) for row in done]
    return float(np.mean(without)) if done else math.nan


def _not_done(rows: Rows) -> float:
    return float(np.mean([row["ending"] != Ending.DONE for row in rows]))


def document(result: Result) -> dict[str, Any]:
    """For JSON."""
    m = result.matched

    def side(c: Campaign) -> dict[str, Any]:
        return {"folder": str(c.folder), "title": c.title, "code": c.code, "rows": len(c.rows)}

    return {
        "kind": result.first.kind,
        "alpha": result.alpha,
        "first": side(result.first),
        "second": side(result.second),
        "differ": {name: {"first": list(a), "second": list(b)} for name, (a, b) in m.differ.items()},
        "only_first": list(m.only[0]),
        "only_second": list(m.only[1]),
        "left_out": list(result.left_out),
        "alone": {"first": [_inputs(r, result.first) for r in m.alone[0]],
                  "second": [_inputs(r, result.second) for r in m.alone[1]]},
        "judged": result.judged,
        "intervals": INTERVALS,
        "comparisons": [_plain(c) for c in result.comparisons],
    }  # fmt: skip


def _inputs(row: Mapping[str, Any], c: Campaign) -> dict[str, Any]:
    return {name: row[name] for name in c.inputs}


def _plain(c: Comparison) -> dict[str, Any]:
    f = c.found
    return {
        "suite": c.suite, "figure": c.figure.name, "unit": c.figure.unit, "better": c.figure.better,
        "paired": c.paired, "count": list(c.count), "clusters": c.clusters, "means": [f.first, f.second],
        "medians": list(c.medians), "difference": f.difference, "low": f.low, "high": f.high, "p": f.p,
        "corrected": c.corrected, "verdict": c.verdict,
    }  # fmt: skip
