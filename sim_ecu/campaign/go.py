"""A campaign as it runs: the jobs that are left, their rows into the folder, all of them merged at the end."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.job import Ending, Job, Row, Scalar
from sim_ecu.campaign.kind import Figure, Type
from sim_ecu.campaign.progress import Shown
from sim_ecu.campaign.runner import AHEAD, Lost, Outcome, run
from sim_ecu.campaign.spreads import SEED
from sim_ecu.campaign.store import Store
from sim_ecu.campaign.task import Refusal, Task, answer, plain_error
from wrcd.errors import InputError, Status
from wrcd.tools.guard import NOT_WRITTEN

RESUMES = "the same command goes on from there"


class Stopped(InputError):
    """The campaign ended before its end; what is finished is kept."""

    status = Status.STOPPED


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does it: an executor, how many jobs it works on at once, how many are handed out for each of those.

    gather: waits until somebody is there. idle: is called every second or so.
    """

    executor: Executor
    count: int | Callable[[], int]
    ahead: int = AHEAD
    gather: Callable[[], None] = lambda: None
    idle: Callable[[], None] = lambda: None


@dataclass(frozen=True, slots=True)
class Finished:
    """All rows of a campaign in its order. before: how many of them were there when it began."""

    pairs: Sequence[tuple[Job, Row]]
    before: int
    results: Path

    def count(self, ending: Ending) -> int:
        """Rows that ended so."""
        return sum(row.ending is ending for _, row in self.pairs)


@dataclass(frozen=True, slots=True)
class Opened:
    """A campaign with its folder, which nobody else has meanwhile. keys: of the jobs, in their order."""

    campaign: Campaign
    folder: Path
    store: Store
    keys: Sequence[str]


@contextmanager
def opened(campaign: Campaign, folder: Path) -> Iterator[Opened]:
    """Its folder, before anybody is waited for. Raises InputError for one that cannot be used."""
    keys = [job.key(campaign.asked.code) for job in campaign.jobs]
    with Store(folder, campaign.asked) as store:
        store.claim(keys)
        yield Opened(campaign, folder, store, keys)


def go(opened: Opened, workers: Workers, *, again: bool = False) -> Finished:
    """Run what the folder has no row of, and merge. again: what failed, took too long or died, too.

    Raises Stopped where it cannot go on.
    """
    campaign, store, keys = opened.campaign, opened.store, opened.keys
    if again:
        store.forget([k for k in keys if k in store.rows and store.rows[k].ending is not Ending.DONE])
    left = [k for k, key in enumerate(keys) if key not in store.rows]
    before = len(keys) - len(left)
    there = [k for k, key in enumerate(keys) if key in store.rows]
    shown = Shown(len(keys), before, _costs(campaign, left), sum(_costs(campaign, there)))
    tasks, limit_s = Tasks(campaign, left), campaign.limit_s
    try:
        workers.gather()
        ends = run(answer, tasks, workers.executor, workers.count, limit_s, ahead=workers.ahead, idle=workers.idle)
        with closing(ends):
            for outcome in ends:
                row = _row(keys[left[outcome.place]], outcome, campaign)
                _keep(opened, row)
                shown.row(outcome.place, row)
    except Lost as e:
        kept = f"{len(store.rows)} rows are in {opened.folder}"
        raise Stopped(f"the workers are lost: {e.reason}", hint=f"{kept}, {RESUMES}") from None
    finally:
        shown.end()
    results = store.merge(campaign.jobs)
    return Finished([(job, store.rows[key]) for job, key in zip(campaign.jobs, keys, strict=True)], before, results)


def _keep(opened: Opened, row: Row) -> None:
    """Raises Stopped for a full disk."""
    try:
        opened.store.add(row)
    except OSError as e:
        if e.errno not in NOT_WRITTEN:
            raise
        hint = f"make room; {RESUMES}"
        raise Stopped(f"a row cannot be written: {e.strerror}", file=opened.folder, hint=hint) from None


def _costs(campaign: Campaign, places: Sequence[int]) -> list[float]:
    """Of the jobs at some places; seeds of a point cost the same."""
    known: dict[tuple[tuple[str, Scalar], ...], float] = {}
    out = []
    for job in (campaign.jobs[k] for k in places):
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


def _row(key: str, outcome: Outcome[dict[str, Scalar] | Refusal], campaign: Campaign) -> Row:
    ending, error, figures = outcome.ending, outcome.error, outcome.value
    if isinstance(figures, Refusal):
        raise Stopped(figures.text, hint=f"{figures.hint}; {RESUMES}")
    out: Mapping[str, Scalar] = {}
    if figures is not None:
        try:
            out = typed(figures, campaign.asked.kind.figures)
        except (TypeError, ValueError) as e:
            ending, error = Ending.FAILED, f"{type(e).__name__}: {e}"
    return Row(key, ending, out, plain_error(error, str(campaign.folder)), outcome.attempts, outcome.seconds)


def typed(found: Mapping[str, Scalar], figures: Iterable[Figure]) -> dict[str, Scalar]:
    """What a function gave, in the types that its kind says. Raises ValueError for a figure that is not there or that
    nobody declared, and TypeError for one of another type."""
    declared = {f.name: f.type for f in figures}
    if set(found) != set(declared):
        raise ValueError(f"the kind's figures are others: {', '.join(sorted(set(found) ^ set(declared)))}")
    plain = {Type.NUMBER: float, Type.WHOLE: int, Type.FLAG: bool, Type.TEXT: str}
    out: dict[str, Scalar] = {}
    for name, of in declared.items():
        value = found[name]
        out[name] = None if value is None else plain[of](value)
    return out
