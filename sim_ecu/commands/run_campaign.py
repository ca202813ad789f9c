"""`sim-ecu campaign`: checks what is asked, runs what is left of it, says what came of it."""

import signal
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from types import FrameType

from sim_ecu.campaign.definition import Campaign, load_campaign
from sim_ecu.campaign.go import RESUMES, Workers, go, opened
from sim_ecu.campaign.job import Ending, code
from sim_ecu.campaign.points import Range
from sim_ecu.campaign.runner import local
from sim_ecu.campaign.spreads import SEED, Given
from sim_ecu.campaign.summary import summary
from wrcd.errors import Status
from wrcd.tools.progress import Progress


def run(file: Path, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Run, merge, tell. 1 where a job did not end well."""
    campaign = _checked(file)
    try:
        with terminated_like_ctrl_c(), workers_for(jobs, scheduler) as workers, opened(campaign, folder) as ready:
            finished = go(ready, workers, again=again)
    except KeyboardInterrupt:
        print(f"stopped; what is finished is in {folder}, {RESUMES}", file=sys.stderr)
        return Status.INTERRUPTED
    print("\n".join(summary(campaign, finished)))
    return Status.DONE if finished.count(Ending.DONE) == len(finished.pairs) else Status.STOPPED


def plan(file: Path) -> int:
    """Check, and say what would run."""
    campaign = _checked(file)
    kind = campaign.asked.kind
    print(f"{campaign.asked.title}: {len(campaign.jobs)} jobs of kind {kind.name}: {kind.words}")
    rows = [(name, _values(given)) for name, given in campaign.factors.items()]
    if campaign.seeds:
        rows.append((SEED, f"{campaign.seeds[0]} … {campaign.seeds[-1]}"))
    width = max((len(name) for name, _ in rows), default=0)
    print("\n".join(f"  {name:{width}}  {values}" for name, values in rows))
    print(
        f"columns: key, {', '.join(campaign.asked.columns)}, ending, error, {', '.join(f.name for f in kind.figures)}"
    )
    return Status.DONE


def _checked(file: Path) -> Campaign:
    progress = Progress()
    try:
        return load_campaign(file, code(), lambda done, of: progress.at(f"checking point {done} of {of}", done / of))
    finally:
        progress.end()


def workers_for(jobs: int, scheduler: str | None) -> AbstractContextManager[Workers]:
    """Processes here, or the workers of a scheduler."""
    if scheduler is None:
        return _local(jobs)
    from sim_ecu.campaign.cluster import cluster

    return cluster(scheduler)


@contextmanager
def _local(jobs: int) -> Iterator[Workers]:
    with local(jobs) as executor:
        yield Workers(executor, jobs)


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


def _values(given: Given) -> str:
    spread = given.spread
    if isinstance(spread, Range):
        steps = f", {len(spread.every())} steps" if spread.steps else ""
        return f"{spread.low:g} … {spread.high:g}{steps}{', by its logarithm' if spread.log else ''}"
    return ", ".join(str(v) for v in spread.every())
