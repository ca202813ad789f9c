"""`sim-ecu campaign`: checks the request, runs what is left of it, prints what came of it."""

import math
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import FrameType

import numpy as np

from sim_ecu.campaign.campaign_folder import opened_store
from sim_ecu.campaign.definition import Campaign, as_words, load_campaign
from sim_ecu.campaign.factors import SEED, Range, Spread
from sim_ecu.campaign.go import Finished, go
from sim_ecu.campaign.kind import Metric, Type
from sim_ecu.jobs.job import Ending, Job, JobRow
from sim_ecu.jobs.pool import RESUMES, Workers, local
from sim_ecu.reporting.table import Table
from sim_ecu.reporting.values import UNKNOWN
from wrcd.errors import Status
from wrcd.progress import Progress

ERRORS = 5  # that are shown
GROUPS = 6  # columns of the table
ENDINGS = {Ending.FAILED: "failed", Ending.TOO_LONG: "took too long", Ending.DIED: "died"}


def summary(campaign: Campaign, finished: Finished) -> list[str]:
    """Lines for a person."""
    pairs = finished.pairs
    counts = [f"{finished.count(ending)} {word}" for ending, word in ENDINGS.items() if finished.count(ending)]
    before = f" ({finished.before} were there)" if finished.before else ""
    done = ", ".join([f"{finished.count(Ending.DONE)} of {len(pairs)} jobs done", *counts])
    out = [f"{campaign.request.title}: {done}{before}"]
    if campaign.twice:
        out.append(f"{campaign.twice} points were drawn twice; each runs once")
    out += _errors(pairs)
    table = list(_table(campaign, pairs))
    out += ["", *table] if table else []
    return [*out, "", f"results: {finished.results}"]


def _errors(pairs: Sequence[tuple[Job, JobRow]]) -> Iterator[str]:
    """The first job of each error."""
    seen: dict[tuple[Ending, str], list[Job]] = {}
    for job, row in pairs:
        if row.ending is not Ending.DONE:
            seen.setdefault((row.ending, row.error), []).append(job)
    for (ending, error), jobs in list(seen.items())[:ERRORS]:
        also = f" (and {len(jobs) - 1} more)" if len(jobs) > 1 else ""
        yield f"  {ENDINGS[ending]}: {as_words(jobs[0].inputs)}{also}: {error}"
    if len(seen) > ERRORS:
        yield f"  and {len(seen) - ERRORS} other errors: see the column error"


def _table(campaign: Campaign, pairs: Sequence[tuple[Job, JobRow]]) -> Iterator[str]:
    """Median and quartiles of each figure, a column for each value of the suite's factor."""
    kind = campaign.request.kind
    groups: dict[str, list[JobRow]] = {}
    for job, row in pairs:
        if row.ending is Ending.DONE:
            groups.setdefault(str(job.inputs.get(kind.suite, "all")), []).append(row)
    figures = [f for f in kind.figures if f.type is not Type.TEXT]
    if not groups or not figures:
        return
    shown = list(groups)[:GROUPS]
    rows = [[f.name, f.unit, *(_cell(f, groups[name]) for name in shown)] for f in figures]
    yield from Table(["median (quartiles)", "unit", *shown], rows).markdown()
    if len(groups) > GROUPS:
        yield f"and {len(groups) - GROUPS} more of {kind.suite}: in the results"


def _cell(figure: Metric, rows: Sequence[JobRow]) -> str:
    found = [float(v) for r in rows if isinstance(v := r.figures.get(figure.name), int | float) and math.isfinite(v)]
    if not found:
        return UNKNOWN
    if figure.type is Type.FLAG:
        return f"{100 * sum(found) / len(found):.3g} %"
    low, middle, high = np.quantile(found, (0.25, 0.5, 0.75))
    return f"{middle:.3g} ({low:.3g} … {high:.3g})"


def run(file: Path, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Run, merge, print. Returns 1 where a job did not end well."""
    campaign = _checked(file)
    try:
        with (
            terminated_like_ctrl_c(),
            workers_for(jobs, scheduler, campaign) as workers,
            opened_store(folder, campaign.request, campaign.keys) as store,
        ):
            finished = go(campaign, folder, store, workers, again=again)
    except KeyboardInterrupt:
        print(f"stopped; what is finished is in {folder}, {RESUMES}", file=sys.stderr)
        return Status.INTERRUPTED
    print("\n".join(summary(campaign, finished)))
    return Status.DONE if finished.count(Ending.DONE) == len(finished.pairs) else Status.STOPPED


def plan(file: Path) -> int:
    """Check, and say what would run."""
    campaign = _checked(file)
    kind = campaign.request.kind
    print(f"{campaign.request.title}: {len(campaign.jobs)} jobs of kind {kind.name}: {kind.words}")
    rows = [(name, _values(given)) for name, given in campaign.factors.items()]
    if campaign.seeds:
        rows.append((SEED, f"{campaign.seeds[0]} … {campaign.seeds[-1]}"))
    width = max((len(name) for name, _ in rows), default=0)
    print("\n".join(f"  {name:{width}}  {values}" for name, values in rows))
    print(
        f"columns: key, {', '.join(campaign.request.columns)}, ending, error, {', '.join(f.name for f in kind.figures)}"
    )
    return Status.DONE


def _checked(file: Path) -> Campaign:
    progress = Progress()
    try:
        return load_campaign(file, lambda done, of: progress.at(f"checking point {done} of {of}", done / of))
    finally:
        progress.end()


def workers_for(jobs: int, scheduler: str | None, campaign: Campaign) -> AbstractContextManager[Workers]:
    """Processes here, or the workers of a scheduler."""
    if scheduler is None:
        return local(jobs)
    from sim_ecu.jobs.cluster import cluster

    return cluster(scheduler, campaign.request.kind.function.__module__)


@contextmanager
def terminated_like_ctrl_c() -> Iterator[None]:
    """SIGTERM ends it as Ctrl-C does: nothing is left behind."""

    def end(_signal: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _values(spread: Spread) -> str:
    if isinstance(spread, Range):
        steps = f", {len(spread.every())} steps" if spread.steps else ""
        return f"{spread.low:g} … {spread.high:g}{steps}{', by its logarithm' if spread.log else ''}"
    return ", ".join(str(v) for v in spread.every())
