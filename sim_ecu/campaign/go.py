"""A campaign as it runs: the jobs that are left, their rows into the folder, all of them merged at the end."""

import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sim_ecu.campaign.campaign_folder import merge
from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.factors import SEED
from sim_ecu.campaign.kind import Metric, Type
from sim_ecu.jobs.job import Ending, Job, JobRow, Refusal, Scalar, Task, answer, plain_error
from sim_ecu.jobs.pool import RESUMES, Lost, Stopped, Workers
from sim_ecu.jobs.store import Store
from wrcd.colour import moves
from wrcd.progress import Progress

LINES = 20  # where there is no terminal: a line for each twentieth of the work


@dataclass(frozen=True, slots=True)
class Finished:
    """All rows of a campaign in its order. before: how many of them were there when it began."""

    pairs: Sequence[tuple[Job, JobRow]]
    before: int
    results: Path

    def count(self, ending: Ending) -> int:
        """Return how many rows ended so."""
        return sum(row.ending is ending for _, row in self.pairs)


def go(campaign: Campaign, folder: Path, store: Store, workers: Workers, *, again: bool = False) -> Finished:
    """Run what the folder's store has no row of, and merge. again: what failed, took too long or died, too.

    Raises Stopped where it cannot go on.
    """
    keys = campaign.keys
    if again:
        store.forget([k for k in keys if k in store.rows and store.rows[k].ending is not Ending.DONE])
    left = [k for k, key in enumerate(keys) if key not in store.rows]
    before = len(keys) - len(left)
    shown = _Shown(_costs(campaign), left)

    def row(row: JobRow, value: dict[str, Scalar] | Refusal | None) -> JobRow:
        if isinstance(value, Refusal):
            raise Stopped(value.text, hint=f"{value.hint}; {RESUMES}")
        if value is not None:
            try:
                row = replace(row, figures=typed(value, campaign.request.kind.figures))
            except (TypeError, ValueError) as e:
                row = replace(row, ending=Ending.FAILED, error=f"{type(e).__name__}: {e}")
        return replace(row, error=plain_error(row.error, str(campaign.folder)))

    try:
        tasks = Tasks(campaign, left)
        named = [keys[k] for k in left]
        for place, ended in store.finish(answer, named, tasks, workers, campaign.limit_s, row=row):
            shown.row(left[place], ended)
    except Lost as e:
        kept = f"{len(store.rows)} rows are in {folder}"
        raise Stopped(f"the workers are lost: {e.reason}", hint=f"{kept}, {RESUMES}") from None
    finally:
        shown.end()
    pairs = [(job, store.rows[key]) for job, key in zip(campaign.jobs, keys, strict=True)]
    return Finished(pairs, before, merge(folder, campaign.request, pairs))


def _costs(campaign: Campaign) -> list[float]:
    """Of every job; seeds of a point cost the same."""
    known: dict[tuple[tuple[str, Scalar], ...], float] = {}
    out = []
    for job in campaign.jobs:
        point = tuple((name, value) for name, value in job.inputs.items() if name != SEED)
        if point not in known:
            known[point] = campaign.cost(job)
        out.append(known[point])
    return out


class Tasks(Sequence[Task]):
    """The jobs at some places of a campaign as they go to workers, each made when it goes."""

    def __init__(self, campaign: Campaign, places: Sequence[int]) -> None:
        self._campaign, self._places = campaign, places

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, k: int) -> Task:  # type: ignore[override]  # no slices
        return self._campaign.task(self._campaign.jobs[self._places[k]])


class _Shown:
    """Progress on standard error: jobs done of all, how many failed, jobs a second, time left by the jobs' costs."""

    def __init__(self, costs: Sequence[float], left: Sequence[int]) -> None:
        self._costs, self._jobs = costs, len(costs)
        self._done = self._before = len(costs) - len(left)
        self._whole = sum(costs) or 1.0
        self._cost = self._whole - sum(costs[k] for k in left)
        self._share_before = self._cost / self._whole
        self._failed = 0
        self._began = time.monotonic()
        self._progress = Progress(steps=True)
        self._every_share = moves(sys.stderr)
        self._next = 0.0

    def row(self, place: int, row: JobRow) -> None:
        """Count one more."""
        self._done += 1
        self._failed += row.ending is not Ending.DONE
        self._cost += self._costs[place]
        share = self._cost / self._whole
        if self._every_share or share >= self._next or self._done == self._jobs:
            self._next = share + 1 / LINES
            rate = (self._done - self._before) / max(time.monotonic() - self._began, 1e-3)
            failed = f", {self._failed} failed" if self._failed else ""
            form = ".0f" if rate >= 100 else ".3g"
            text = f"{self._done} of {self._jobs} jobs{failed}, {rate:{form}} jobs/s"
            self._progress.at(text, share, self._share_before)

    def end(self) -> None:
        """Leave the line."""
        self._progress.end()


def typed(found: Mapping[str, Scalar], figures: Iterable[Metric]) -> dict[str, Scalar]:
    """Return what a function gave, in the types that its kind says. Raises ValueError for a figure that is not there or
    that nobody declared, and TypeError for one of another type."""
    declared = {f.name: f.type for f in figures}
    if set(found) != set(declared):
        raise ValueError(f"the kind's figures are others: {', '.join(sorted(set(found) ^ set(declared)))}")
    plain = {Type.NUMBER: float, Type.WHOLE: int, Type.FLAG: bool, Type.TEXT: str}
    out: dict[str, Scalar] = {}
    for name, of in declared.items():
        value = found[name]
        out[name] = None if value is None else plain[of](value)
    return out
