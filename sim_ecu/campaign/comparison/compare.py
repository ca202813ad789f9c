"""Two campaigns compared: every figure of every suite, and what of it is more than chance."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim_ecu.campaign.campaign_folder import Results
from sim_ecu.campaign.comparison.chance import MAX_DRAWS, ChanceOf, draws, holm, judged, of_pairs, of_samples
from sim_ecu.campaign.kind import Metric, Type
from sim_ecu.jobs.job import Ending
from wrcd.errors import InputError

Rows: TypeAlias = Sequence[Mapping[str, Any]]
WHOLE = "all"  # the suite of a kind that has none


@dataclass(frozen=True, slots=True)
class Pair:
    """Rows of the same inputs, nearly always one of each side; of several the means are compared."""

    first: Rows
    second: Rows


@dataclass(frozen=True, slots=True)
class Suite:
    """What is compared together. pairs: empty where the sides share no world; then first and second are the worlds of
    each, with their rows. clusters: of each pair, which pairs share a world. by: what a world is, in words."""

    name: str
    pairs: Sequence[Pair]
    clusters: Sequence[int]
    first: Sequence[Rows]
    second: Sequence[Rows]
    by: str


@dataclass(frozen=True, slots=True)
class Match:
    """differ: inputs of which no value is on both sides, with the values of each. only: inputs that one side has.
    suites: those that both have. alone: rows of each side without any of the other beside them."""

    differ: Mapping[str, tuple[tuple[Any, ...], tuple[Any, ...]]]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    suites: tuple[Suite, ...]
    alone: tuple[Rows, Rows]


def match(first: Results, second: Results) -> Match:
    """Raises InputError for campaigns that cannot be compared."""
    if first.kind != second.kind:
        raise InputError(f"is of the kind {second.kind}, and {first.folder} of {first.kind}", file=second.folder,
                         hint="compare two of one kind")  # fmt: skip
    both = [name for name in first.inputs if name in second.inputs]
    values = {n: (_values(first, n), _values(second, n)) for n in both if n != first.suite}
    differ = {n: v for n, v in values.items() if not set(v[0]) & set(v[1])}
    shared = [n for n in both if n not in differ]
    sides = [_by_suite(c.rows, first.suite) for c in (first, second)]
    names = [name for name in sides[0] if name in sides[1]]
    if not names:
        raise InputError(f"shares no {first.suite} with {first.folder}", file=second.folder,
                         hint=f"compare campaigns that have some {first.suite} in common")  # fmt: skip
    worlds = [n for n in first.cluster if n in both]
    # whether no world of one side is beside one of the other
    separate = not any(n in shared for n in worlds) if worlds else not any(n != first.suite for n in shared)
    made = [_suite(name, [side[name] for side in sides], shared, worlds, separate) for name in names]
    alone = [[r for n, rows in side.items() if n not in names for r in rows] for side in sides]
    for _, left in made:
        for k in range(2):
            alone[k] += left[k]
    only = tuple(tuple(n for n in c.inputs if n not in both) for c in (first, second))
    return Match(differ, (only[0], only[1]), tuple(s for s, _ in made), (alone[0], alone[1]))


def _suite(
    name: str, of: Sequence[Rows], shared: Sequence[str], worlds: Sequence[str], separate: bool
) -> tuple[Suite, list[list[Mapping[str, Any]]]]:
    """The points that both sides have, and the rows of each that stand alone. Of a kind without worlds every row or
    pair is one."""
    sides = [_by(rows, shared) for rows in of]
    both = sides[0].keys() & sides[1].keys()
    left = [[r for k, rows in side.items() if k not in both for r in rows] for side in sides]
    if separate:
        kept = [[r for k, rows in side.items() if k in both for r in rows] for side in sides]
        first, second = (list(_by(rows, worlds).values()) if worlds else [[r] for r in rows] for rows in kept)
        return Suite(name, (), (), first, second, ", ".join(worlds) or "row"), left
    pairs = [Pair(rows, sides[1][k]) for k, rows in sides[0].items() if k in both]
    common = [n for n in worlds if n in shared]
    place: dict[Any, int] = {}
    clusters = [place.setdefault(tuple(p.first[0][n] for n in common) if worlds else k, len(place))
                for k, p in enumerate(pairs)]  # fmt: skip
    return Suite(name, pairs, clusters, (), (), ", ".join(common) if worlds else "pair"), left


def _values(c: Results, name: str) -> tuple[Any, ...]:
    return tuple(dict.fromkeys(r[name] for r in c.rows))


def _by_suite(rows: Rows, suite: str) -> dict[str, Rows]:
    return {WHOLE: rows} if not suite else {str(k[0]): v for k, v in _by(rows, [suite]).items()}


def _by(rows: Rows, names: Iterable[str]) -> dict[tuple[Any, ...], Rows]:
    out: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    names = list(names)
    for row in rows:
        out.setdefault(tuple(row[n] for n in names), []).append(row)
    return dict(out)


FloatArray = NDArray[np.float64]
BETTER, WORSE, DIFFERS = "better", "worse", "differs"
CHANCE, SAME, TOO_FEW = "within chance", "the same", "too few worlds"
CLAIMS = (WORSE, BETTER, DIFFERS)
ENDING = Metric("not done", Type.FLAG, "share of the jobs that failed, died or took too long", "", "less")
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
    figure: Metric
    paired: bool
    count: tuple[int, int]
    clusters: int
    medians: tuple[float, float]
    found: ChanceOf
    corrected: float
    verdict: str
    values: tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True)
class Result:
    """All of it. left_out: figures that are texts or only one side has."""

    first: Results
    second: Results
    matched: Match
    comparisons: tuple[Comparison, ...]
    alpha: float
    judged: int  # comparisons that the correction counts
    left_out: tuple[str, ...]

    @property
    def claims(self) -> list[Comparison]:
        """The comparisons that are more than chance."""
        return [c for c in self.comparisons if c.verdict in CLAIMS]

    @property
    def unjudged(self) -> list[Comparison]:
        """The comparisons that differ in too few worlds for any claim."""
        return [c for c in self.comparisons if c.verdict == TOO_FEW and all(c.count)]


def compare(
    first: Results, second: Results, names: Sequence[str] | None, alpha: float, progress: Callable[[str, float], None]
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


def _figures(first: Results, second: Results, names: Sequence[str] | None) -> tuple[list[Metric], tuple[str, ...]]:
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
class _FigureColumn:
    """A figure of all pairs, or of the worlds of each side."""

    figure: Metric
    first: FloatArray
    second: FloatArray

    @property
    def known(self) -> FloatArray:
        """The numbers of both sides."""
        every = np.concatenate((self.first, self.second))
        return every[np.isfinite(every)]


def _of_suite(suite: Suite, figures: Sequence[Metric], alpha: float, drawn: int) -> list[Comparison]:
    """Figures, where a side has any number; after each who has none, where not all have or lack it; how jobs ended."""
    sides = (
        ([p.first for p in suite.pairs], [p.second for p in suite.pairs])
        if suite.pairs
        else (list(suite.first), list(suite.second))
    )

    def column(figure: Metric, of: Callable[[Rows], float]) -> _FigureColumn:
        first, second = (np.array([of(rows) for rows in side], np.float64) for side in sides)
        return _FigureColumn(figure, first, second)

    columns: list[_FigureColumn] = []
    for f in figures:
        values = column(f, partial(_mean, name=f.name))
        lacks = column(Metric(LACKS + f.name, Type.FLAG, f"share without {f.words}"), partial(_lacking, name=f.name))
        columns += [values] * bool(len(values.known)) + [lacks] * (len(np.unique(lacks.known)) > 1)
    columns.append(column(ENDING, _not_done))
    first, second = np.stack([c.first for c in columns], axis=1), np.stack([c.second for c in columns], axis=1)
    found: list[ChanceOf] = []
    for k in range(0, len(columns), TOGETHER):
        a, b = first[:, k : k + TOGETHER], second[:, k : k + TOGETHER]
        found += of_pairs(a, b, suite.clusters, alpha, drawn) if suite.pairs else of_samples(a, b, alpha, drawn)
    return [_comparison(suite, c.figure, c.first, c.second, of) for c, of in zip(columns, found, strict=True)]


def _comparison(suite: Suite, f: Metric, a: FloatArray, b: FloatArray, found: ChanceOf) -> Comparison:
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
    """Return the mean of the rows that have a number."""
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
    """Return it for JSON."""
    m = result.matched

    def side(c: Results) -> dict[str, Any]:
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


def _inputs(row: Mapping[str, Any], c: Results) -> dict[str, Any]:
    return {name: row[name] for name in c.inputs}


def _plain(c: Comparison) -> dict[str, Any]:
    f = c.found
    return {
        "suite": c.suite, "figure": c.figure.name, "unit": c.figure.unit, "better": c.figure.better,
        "paired": c.paired, "count": list(c.count), "clusters": c.clusters, "means": [f.first, f.second],
        "medians": list(c.medians), "difference": f.difference, "low": f.low, "high": f.high, "p": f.p,
        "corrected": c.corrected, "verdict": c.verdict,
    }  # fmt: skip
