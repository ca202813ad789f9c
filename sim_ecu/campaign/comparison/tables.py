"""A comparison as tables for a person (Markdown)."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from sim_ecu.campaign.comparison.compare import (
    BETTER,
    CLAIMS,
    DIFFERS,
    INTERVALS,
    SAME,
    TOO_FEW,
    WORSE,
    Comparison,
    Result,
)
from sim_ecu.campaign.comparison.match import Suite
from sim_ecu.campaign.comparison.read import Campaign
from sim_ecu.campaign.comparison.worst import Worst, inline
from sim_ecu.loop.tables import table

NONE = "–"
FIRST, SECOND = "first", "second"
MAX_VALUES = 4  # of an input, named
MAX_ALONE = 10  # rows that only one side has, named
VERDICTS = (
    "Verdicts are of the second against the first. better, worse, differs (no way is better): more than chance, of all "
    "comparisons together at {alpha:g} (Holm's correction of {judged}). within chance: no claim, which is no proof of "
    "equality. the same: no job differs. too few worlds: nothing that so few could say would be a claim: not "
    "counted."
)
SPREADS = "in standard deviations of the figure over its suite"
METHODS = (
    "p: pairs by flipping the signs of whole worlds, samples by exchanging worlds between the sides. n: pairs, or the "
    "worlds of each side. In brackets: the {share:g} % interval of that one difference of means, by the same test, not "
    "corrected. {intervals}."
)


def tables(result: Result, ways: tuple[Sequence[Worst], Sequence[Worst]]) -> list[str]:
    """Markdown, line by line."""
    alpha = result.alpha
    out = [
        *_sides(result),
        *_differ(result),
        VERDICTS.format(alpha=alpha, judged=result.judged),
        METHODS.format(share=100 * (1 - alpha), intervals=INTERVALS),
        verdict(result),
    ]
    for suite in result.matched.suites:
        own = [c for c in result.comparisons if c.suite == suite.name]
        out += ["", f"**{suite.name}**: {_counted(suite)}", "", *of_suite(own)]
    out += _alone(result)
    for way, who, other in zip(ways, (SECOND, FIRST), (FIRST, SECOND), strict=True):
        if way:
            out += ["", f"**worst jobs of the {who}**: beside the {other}; each by what it is worst in, {SPREADS}", ""]
            out += of_worst(way)
    return out


def _counted(suite: Suite) -> str:
    if suite.pairs:
        return f"pairs: {len(suite.pairs)}; a world: {suite.by}"
    return f"no pairs; worlds: {len(suite.first)} and {len(suite.second)}, each a {suite.by}"


def verdict(result: Result) -> str:
    """In a sentence or two, by suite."""
    claims = result.claims
    if not claims and not result.judged:
        return _unjudged(result) or "Nothing differs: every figure is the same."
    if not claims:
        return f"Nothing differs by more than chance, of {result.judged} comparisons. {_unjudged(result)}".strip()
    parts = []
    for word in (WORSE, BETTER, DIFFERS):
        suites: dict[str, list[str]] = {}
        for c in claims:
            if c.verdict == word:
                suites.setdefault(c.suite, []).append(c.figure.name)
        if suites:
            parts.append(f"{word.capitalize()}: " + "; ".join(f"{s} ({', '.join(f)})" for s, f in suites.items()) + ".")
    told = f"{len(claims)} of {result.judged} comparisons differ by more than chance."
    return " ".join((told, *parts, _unjudged(result))).strip()


def _unjudged(result: Result) -> str:
    """What differs and could be no claim, by suite; nothing without any."""
    found = result.unjudged
    if not found:
        return ""
    suites = Counter(c.suite for c in found)
    named = ", ".join(f"{suite} ({n})" for suite, n in suites.items())
    every = result.judged + len(found)
    takes = []
    for paired, ways, of in (
        (True, pair_ways, "worlds in which a pair differs"),
        (False, sample_ways, "worlds a side"),
    ):
        most = max((c.found.worlds for c in found if c.paired is paired), default=None)
        if most is not None:
            takes.append(f"takes {worlds(every, result.alpha, ways)} {of}, of which these have {most} at most")
    return (
        f"Not judged, for too few worlds: {len(found)} that differ, in {named}. A claim among {every} "
        f"{', and '.join(takes)}: run more seeds or lots, or choose fewer figures."
    )


def worlds(comparisons: int, alpha: float, ways: Callable[[int], int]) -> int:
    """How many can make a claim among so many comparisons, if 2 of so many ways go as far."""
    return next(n for n in itertools.count(1) if 2 * comparisons <= alpha * ways(n))


def pair_ways(count: int) -> int:
    """To flip the signs of worlds."""
    return 1 << count


def sample_ways(count: int) -> int:
    """To exchange as many worlds of each side."""
    return math.comb(2 * count, count)


def of_suite(comparisons: Sequence[Comparison]) -> list[str]:
    """A row for each figure; the verdict last."""
    head = [
        "figure",
        "unit",
        FIRST,
        SECOND,
        "median",
        "median of second",
        "difference",
        "n",
        "p",
        "p corrected",
        "verdict",
    ]
    return table(head, [_row(c) for c in comparisons])


def _row(c: Comparison) -> list[str]:
    f = c.found
    ends = "" if math.isnan(f.low) else f" ({number(f.low)} … {number(f.high)})"
    n = str(c.count[0]) if c.paired else f"{c.count[0]} and {c.count[1]}"
    told = c.verdict not in (SAME, TOO_FEW)
    return [
        c.figure.name, c.figure.unit, number(f.first), number(f.second), *map(number, c.medians),
        f"{number(f.difference)}{ends}", n, f"{f.p:.2g}" if told else NONE, f"{c.corrected:.2g}" if told else NONE,
        f"**{c.verdict}**" if c.verdict in CLAIMS else c.verdict,
    ]  # fmt: skip


def number(value: float) -> str:
    """Four digits, or a dash for none."""
    return NONE if math.isnan(value) else f"{value:.4g}"


def of_worst(jobs: Sequence[Worst]) -> list[str]:
    """A row for each job, with its inputs as TOML."""
    rows = [
        [w.suite, w.figure, _told(w.first), _told(w.second), NONE if math.isinf(w.size) else f"{abs(w.size):.1f}",
         f"`{inline(w.inputs)}`"]
        for w in jobs
    ]  # fmt: skip
    return table(["suite", "figure", FIRST, SECOND, "spreads", "inputs"], rows)


def _told(value: float | str) -> str:
    return value if isinstance(value, str) else number(value)


def _sides(result: Result) -> list[str]:
    a, b = result.first, result.second
    out = [f"Kind {a.kind}. The {who}: {_side(c)}." for who, c in ((FIRST, a), (SECOND, b))]
    if a.code != b.code:
        out.append(f"Their code differs: {a.code[:12]} and {b.code[:12]}.")
    return out


def _side(c: Campaign) -> str:
    return f"{c.folder} ({c.title}), {len(c.rows)} jobs"


def _differ(result: Result) -> list[str]:
    m = result.matched
    parts = [f"{n} ({_some(a)} and {_some(b)})" for n, (a, b) in m.differ.items()]
    out = [f"Inputs that differ as a whole: {', '.join(parts)}." if parts else "No input differs as a whole."]
    for who, names in zip((FIRST, SECOND), m.only, strict=True):
        if names:
            out.append(f"Inputs that only the {who} has: {', '.join(names)}.")
    if result.left_out:
        out.append(f"Not compared, for they are no numbers or only one side has them: {', '.join(result.left_out)}.")
    return out


def _some(values: Sequence[Any]) -> str:
    named = [NONE if v is None or v == "" else str(v) for v in values[:MAX_VALUES]]
    more = len(values) - len(named)
    return "/".join(named) + (f" and {more} more" if more else "")


def _alone(result: Result) -> list[str]:
    if not any(result.matched.alone):
        return []
    out = ["", "**only on one side**: jobs that nothing is beside; they are in no comparison", ""]
    rows = []
    for who, side, c in zip((FIRST, SECOND), result.matched.alone, (result.first, result.second), strict=True):
        rows += [[who, f"`{inline(_inputs(row, c))}`"] for row in side[:MAX_ALONE]]
        if len(side) > MAX_ALONE:
            rows.append([who, f"and {len(side) - MAX_ALONE} more"])
    return out + table(["side", "inputs"], rows)


def _inputs(row: Mapping[str, Any], c: Campaign) -> dict[str, Any]:
    return {name: row[name] for name in c.inputs if row[name] is not None}
