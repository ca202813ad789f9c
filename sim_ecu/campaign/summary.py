"""What a campaign came to, in words and one table."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.go import Finished
from sim_ecu.campaign.job import Ending, Job, Row
from sim_ecu.campaign.kind import Figure, Type
from sim_ecu.campaign.task import told

ERRORS = 5  # that are told
GROUPS = 6  # columns of the table
ENDINGS = {Ending.FAILED: "failed", Ending.TOO_LONG: "took too long", Ending.DIED: "died"}


def summary(campaign: Campaign, finished: Finished) -> list[str]:
    """Lines for a person."""
    pairs = finished.pairs
    counts = [f"{finished.count(ending)} {word}" for ending, word in ENDINGS.items() if finished.count(ending)]
    before = f" ({finished.before} were there)" if finished.before else ""
    done = ", ".join([f"{finished.count(Ending.DONE)} of {len(pairs)} jobs done", *counts])
    out = [f"{campaign.asked.title}: {done}{before}"]
    if campaign.twice:
        out.append(f"{campaign.twice} points were drawn twice; each runs once")
    out += _errors(pairs)
    table = list(_table(campaign, pairs))
    out += ["", *table] if table else []
    return [*out, "", f"results: {finished.results}"]


def _errors(pairs: Sequence[tuple[Job, Row]]) -> Iterator[str]:
    """The first job of each error."""
    seen: dict[tuple[Ending, str], list[Job]] = {}
    for job, row in pairs:
        if row.ending is not Ending.DONE:
            seen.setdefault((row.ending, row.error), []).append(job)
    for (ending, error), jobs in list(seen.items())[:ERRORS]:
        also = f" (and {len(jobs) - 1} more)" if len(jobs) > 1 else ""
        yield f"  {ENDINGS[ending]}: {told(jobs[0].inputs)}{also}: {error}"
    if len(seen) > ERRORS:
        yield f"  and {len(seen) - ERRORS} other errors: see the column error"


def _table(campaign: Campaign, pairs: Sequence[tuple[Job, Row]]) -> Iterator[str]:
    """Median and quartiles of each figure, a column for each value of the suite's factor."""
    kind = campaign.asked.kind
    groups: dict[str, list[Row]] = {}
    for job, row in pairs:
        if row.ending is Ending.DONE:
            groups.setdefault(str(job.inputs.get(kind.suite, "all")), []).append(row)
    figures = [f for f in kind.figures if f.type is not Type.TEXT]
    if not groups or not figures:
        return
    shown = list(groups)[:GROUPS]
    yield "| median (quartiles) | unit | " + " | ".join(shown) + " |"
    yield "| --- | --- |" + " --- |" * len(shown)
    for f in figures:
        yield f"| {f.name} | {f.unit} | " + " | ".join(_cell(f, groups[name]) for name in shown) + " |"
    if len(groups) > GROUPS:
        yield f"and {len(groups) - GROUPS} more of {kind.suite}: in the results"


def _cell(figure: Figure, rows: Sequence[Row]) -> str:
    found = [float(v) for r in rows if isinstance(v := r.figures.get(figure.name), int | float) and math.isfinite(v)]
    if not found:
        return "–"
    if figure.type is Type.FLAG:
        return f"{100 * sum(found) / len(found):.3g} %"
    low, middle, high = np.quantile(found, (0.25, 0.5, 0.75))
    return f"{middle:.3g} ({low:.3g} … {high:.3g})"
