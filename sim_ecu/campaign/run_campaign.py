"""`sim-ecu campaign`: checks what is asked, runs what is left of it, prints what came of it."""

import re
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from pathlib import Path

import pandas as pd

from sim_ecu.campaign.definition import Campaign, as_words, load_campaign
from sim_ecu.campaign.kind import Job, answer
from sim_ecu.campaign.row_folder import ROWS, RowFolder, opened
from sim_ecu.jobs import pool
from sim_ecu.jobs.pool import Ending, Workers
from wrcd.colour import moves
from wrcd.errors import Status
from wrcd.progress import Progress

ERRORS = 5  # that are shown
LINES = 20  # where there is no terminal: a line for each twentieth of the work
MEMORY_ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}\b")


def run(file: Path, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Run what is left, print. Returns 1 where a job did not end well."""
    campaign = load_campaign(file)
    rows = go(campaign, folder, jobs, scheduler, again)
    if rows is None:
        return Status.INTERRUPTED
    print("\n".join([*_summary(campaign, rows), "", f"rows: {folder / ROWS}"]))
    return Status.DONE if (rows["ending"] == Ending.DONE).all() else Status.STOPPED


def plan(file: Path) -> int:
    """Check, and say what would run."""
    campaign = load_campaign(file)
    print(f"{campaign.title}: {len(campaign.jobs)} jobs of kind {campaign.kind.name}")
    for name in campaign.columns:
        print(f"  {name}: {', '.join(map(str, dict.fromkeys(job.inputs[name] for job in campaign.jobs)))}")
    print(f"columns: key, {', '.join(campaign.columns)}, ending, error, {', '.join(campaign.kind.figures)}")
    return Status.DONE


def go(campaign: Campaign, folder: Path, jobs: int, scheduler: str | None, again: bool) -> pd.DataFrame | None:
    """Run the jobs that have no row in the folder. again: those that did not end well, too. Returns all rows in the
    campaign's order; None after Ctrl-C. Raises Stopped where it cannot go on."""
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    try:
        with ExitStack() as stack:
            stack.enter_context(pool.kept())
            crew = None if scheduler is None else stack.enter_context(pool.cluster(scheduler))
            rows = stack.enter_context(opened(folder, campaign))
            if again:
                rows.drop({key for key, ending in rows.endings.items() if ending != Ending.DONE})
            if left := [job for job in campaign.jobs if job.key not in rows.endings]:
                _work(campaign, left, rows, crew or stack.enter_context(pool.local(min(jobs, len(left)))))
            rows.write()
            return rows.table()
    except KeyboardInterrupt:
        print(f"stopped; what is finished is in {folder}, {pool.RESUMES}", file=sys.stderr)
        return None
    finally:
        signal.signal(signal.SIGTERM, before)


def _work(campaign: Campaign, left: Sequence[Job], rows: RowFolder, crew: Workers) -> None:
    every, whole, began = len(campaign.jobs), sum(job.cost for job in campaign.jobs) or 1.0, time.monotonic()
    cost = before = whole - sum(job.cost for job in left)
    failed, line, progress = 0, 0.0, Progress(steps=True)
    with ExitStack() as stack:
        stack.callback(progress.end)
        ends = stack.enter_context(closing(pool.run(answer, left, crew, campaign.limit_s)))
        for number, o in enumerate(ends, 1):
            job, error = left[o.place], MEMORY_ADDRESS.sub("0x…", o.error.replace(f"{campaign.folder}/", ""))
            rows.add({"key": job.key, **job.inputs, "ending": o.ending.value, "error": error, **(o.value or {})})
            failed, cost = failed + (o.ending is not Ending.DONE), cost + job.cost
            if moves(sys.stderr) or cost / whole >= line or number == len(left):
                line = cost / whole + 1 / LINES
                rate = number / max(time.monotonic() - began, 1e-3)
                done = f"{every - len(left) + number} of {every} jobs{f', {failed} failed' * bool(failed)}"
                progress.at(f"{done}, {rate:.3g} jobs/s", cost / whole, before / whole)


def _summary(campaign: Campaign, rows: pd.DataFrame) -> Iterator[str]:
    """Yield lines for a person: how the jobs ended, the first job of each error, medians by the kind's suite."""
    counts, done = rows["ending"].value_counts(), rows[rows["ending"] == Ending.DONE]
    others = "".join(f", {counts[e]} {e}" for e in Ending if e is not Ending.DONE and e in counts)
    yield f"{campaign.title}: {len(done)} of {len(rows)} jobs done{others}"
    errors = list(rows.drop(done.index).groupby(["ending", "error"], sort=False))
    for (ending, error), group in errors[:ERRORS]:
        also = f" (and {len(group) - 1} more)" if len(group) > 1 else ""
        yield f"  {ending}: {as_words(group.iloc[0][list(campaign.columns)].to_dict())}{also}: {error}"
    if len(errors) > ERRORS:
        yield f"  and {len(errors) - ERRORS} other errors: see the column error"
    figures = [name for name, of in campaign.kind.figures.items() if of is not str]
    if len(done):
        suite = campaign.kind.suite if campaign.kind.suite in done else "ending"
        medians = done.groupby(suite, sort=False)[figures].median()
        yield f"\nmedians:\n{medians.T.to_string(float_format='{:.3g}'.format, na_rep='–')}"
