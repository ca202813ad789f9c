"""A comparison as sections of sentences and tables: for a terminal, and as a page with its pictures."""

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from markupsafe import Markup, escape

from sim_ecu.campaign.campaign_folder import Results
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
    Suite,
)
from sim_ecu.campaign.comparison.worst import Worst, inline
from sim_ecu.reporting.page import Folded, Page, PageSection, Part, Verbatim, html, markdown
from sim_ecu.reporting.table import Cell, Row, Table
from sim_ecu.reporting.values import UNKNOWN, Value

FIRST, SECOND = "first", "second"
HEAD = (
    "figure", "unit", FIRST, SECOND, "median", "median of second", "difference", "n", "p", "p corrected", "verdict",
)  # fmt: skip
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


Ways = tuple[Sequence[Worst], Sequence[Worst]]  # worst jobs of the second, and of the first


def page(result: Result, ways: Ways) -> str:
    """Return HTML, in English, with pictures inside: the verdict and the worst jobs as campaigns first."""
    from sim_ecu.campaign.comparison.comparison_pictures import pictures

    head: list[Part] = [Markup("<strong>") + escape(verdict(result)) + Markup("</strong>")]
    for way, who in zip(ways, (SECOND, FIRST), strict=True):
        if way:
            parts = [part for w in way for part in (f"{w.suite}, {w.figure}", Verbatim(w.toml))]
            head.append(Folded(f"The {len(way)} worst jobs of the {who}, each as a CAMPAIGN.toml", parts))
    names = " and ".join(c.title or str(c.folder) for c in (result.first, result.second))
    return html(
        Page(f"sim-ecu compare: {names}", "What differs, and is it more than chance?",
             list(sections(result, ways, is_page=True)), head, pictures=pictures(result))
    )  # fmt: skip


def tables(result: Result, ways: Ways) -> list[str]:
    """Return Markdown, line by line."""
    return markdown(sections(result, ways))


def sections(result: Result, ways: Ways, is_page: bool = False) -> Iterator[PageSection]:
    """Yield what is compared and how, each suite's figures, jobs of one side, the worst jobs."""
    alpha = result.alpha
    yield PageSection("", parts=[
        *_sides(result),
        *_differ(result),
        VERDICTS.format(alpha=alpha, judged=result.judged),
        METHODS.format(share=100 * (1 - alpha), intervals=INTERVALS),
        *[verdict(result)] * (not is_page),
    ])  # fmt: skip
    for suite in result.matched.suites:
        own = [c for c in result.comparisons if c.suite == suite.name]
        yield PageSection(suite.name, _counted(suite), [Table(HEAD, [_row(c) for c in own])])
    yield from _alone(result)
    for way, who, other in zip(ways, (SECOND, FIRST), (FIRST, SECOND), strict=True):
        if way:
            about = f"beside the {other}; each by what it is worst in, {SPREADS}"
            yield PageSection(f"worst jobs of the {who}", about, [_worst(way)])


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
    head = f"{len(claims)} of {result.judged} comparisons differ by more than chance."
    return " ".join((head, *parts, _unjudged(result))).strip()


def _unjudged(result: Result) -> str:
    """Return what differs and could be no claim, by suite; "" without any."""
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
    """Return how many worlds can make a claim among so many comparisons, if 2 of so many ways go as far."""
    return next(n for n in itertools.count(1) if 2 * comparisons <= alpha * ways(n))


def pair_ways(count: int) -> int:
    """Return how many ways there are to flip the signs of worlds."""
    return 1 << count


def sample_ways(count: int) -> int:
    """Return how many ways there are to exchange as many worlds of each side."""
    return math.comb(2 * count, count)


def _row(c: Comparison) -> Row:
    f = c.found
    ends = "" if math.isnan(f.low) else f" ({number(f.low)} … {number(f.high)})"
    n = str(c.count[0]) if c.paired else f"{c.count[0]} and {c.count[1]}"
    judged = c.verdict not in (SAME, TOO_FEW)
    numbers = [
        number(f.first), number(f.second), *map(number, c.medians), f"{number(f.difference)}{ends}", n,
        f"{f.p:.2g}" if judged else UNKNOWN, f"{c.corrected:.2g}" if judged else UNKNOWN,
    ]  # fmt: skip
    verdict = Cell(escape(c.verdict), f"**{c.verdict}**" if c.verdict in CLAIMS else c.verdict)
    return Row([c.figure.name, c.figure.unit, *map(_to_the_right, numbers), verdict])


def _to_the_right(words: str) -> Cell:
    return Cell(escape(words), words, "")


def number(value: float) -> str:
    """Four digits, or a dash for none."""
    return UNKNOWN if math.isnan(value) else f"{value:.4g}"


def _worst(jobs: Sequence[Worst]) -> Table:
    """A row for each job, with its inputs as TOML."""
    rows: list[list[Value | Cell]] = [
        [w.suite, w.figure, *(_to_the_right(v if isinstance(v, str) else number(v)) for v in (w.first, w.second)),
         _to_the_right(UNKNOWN if math.isinf(w.size) else f"{abs(w.size):.1f}"), _toml(w.inputs)]
        for w in jobs
    ]  # fmt: skip
    return Table(["suite", "figure", FIRST, SECOND, "spreads", "inputs"], rows)


def _toml(inputs: Mapping[str, Any]) -> Cell:
    return Cell(escape(inline(inputs)), f"`{inline(inputs)}`")


def _sides(result: Result) -> list[str]:
    a, b = result.first, result.second
    out = [f"Kind {a.kind}. The {who}: {_side(c)}." for who, c in ((FIRST, a), (SECOND, b))]
    if a.code != b.code:
        out.append(f"Their code differs: {a.code[:12]} and {b.code[:12]}.")
    return out


def _side(c: Results) -> str:
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
    named = [UNKNOWN if v is None or v == "" else str(v) for v in values[:MAX_VALUES]]
    more = len(values) - len(named)
    return "/".join(named) + (f" and {more} more" if more else "")


def _alone(result: Result) -> Iterator[PageSection]:
    rows: list[list[str | Cell]] = []
    for who, side, c in zip((FIRST, SECOND), result.matched.alone, (result.first, result.second), strict=True):
        rows += [[who, _toml(_inputs(row, c))] for row in side[:MAX_ALONE]]
        if len(side) > MAX_ALONE:
            rows.append([who, f"and {len(side) - MAX_ALONE} more"])
    if rows:
        about = "jobs that nothing is beside; they are in no comparison"
        yield PageSection("only on one side", about, [Table(["side", "inputs"], rows)])


def _inputs(row: Mapping[str, Any], c: Results) -> dict[str, Any]:
    return {name: row[name] for name in c.inputs if row[name] is not None}
