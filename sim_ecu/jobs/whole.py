"""All of many runs, for a report that must not look whole where it is not: what is missing is named."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Generic, TypeVar

from sim_ecu.jobs.job import Ending
from sim_ecu.jobs.pool import RESUMES, Stopped, Workers, local, run
from wrcd.errors import InputError, Status
from wrcd.progress import Progress

T = TypeVar("T")
R = TypeVar("R")
MOST_NAMED = 20  # missing runs by name


@dataclass(frozen=True, slots=True)
class Piece:
    """What a person calls a run, and what it costs, about, in any unit."""

    suite: str
    name: str
    cost: float


@dataclass(frozen=True, slots=True)
class Missing:
    """A run that gave nothing, and why."""

    piece: Piece
    why: str


@dataclass(frozen=True, slots=True)
class WholeRun(Generic[R]):
    """What the runs gave, in their order; None where one gave nothing, which is then missing."""

    results: Sequence[R | None]
    missing: Sequence[Missing]


class NotWhole(InputError):
    """Runs failed, and what is printed lacks them."""

    status = Status.STOPPED


def every(function: Callable[[T], R], jobs: Sequence[T], pieces: Sequence[Piece], workers: int) -> WholeRun[R]:
    """function(job) of all, one at least, in processes of their own, with progress by the pieces' cost.

    function is of a module's top level, and remembers what jobs share. A run that fails or dies is tried once more.
    """
    progress = Progress(steps=True)
    whole, done = sum(p.cost for p in pieces), 0.0
    results: list[R | None] = [None] * len(jobs)
    missing: dict[int, Missing] = {}
    try:
        with local(min(workers, len(jobs))) as crew:
            for number, o in enumerate(run(function, jobs, crew), 1):
                piece = pieces[o.place]
                results[o.place] = o.value
                if o.ending is not Ending.DONE:
                    missing[o.place] = Missing(piece, o.error)
                done += piece.cost
                progress.at(f"{piece.suite}: run {number} of {len(jobs)}", done / whole)
    finally:
        progress.end()
    return WholeRun(results, [missing[place] for place in sorted(missing)])


def each(
    function: Callable[[T], R], jobs: Sequence[T], workers: Workers, names: Sequence[str]
) -> Iterator[tuple[int, R]]:
    """Yield place and value of every job as it ends. Raises Stopped, after the last, where some failed twice: by their
    names."""
    failed: list[str] = []
    with closing(run(function, jobs, workers)) as ends:
        for o in ends:
            if o.ending is Ending.DONE:
                yield o.place, o.value  # type: ignore[misc]  # it is done: a value
            else:
                failed.append(f"  {names[o.place]}: {o.error}")
    if failed:
        raise Stopped("\n".join([f"{len(failed)} of {len(jobs)} jobs failed twice:", *failed]), hint=RESUMES)


def left_out(missing: Sequence[Missing], suites: Iterable[str]) -> dict[str, list[str]]:
    """Return the runs that each suite left out of a report lacks, and why; of one that is left out for another's
    runs, none."""
    return {s: [f"{m.piece.name}: {m.why}" for m in missing if m.piece.suite == s] for s in suites}


def not_whole(missing: Sequence[Missing]) -> NotWhole:
    """The error that ends a report with holes: its runs by name."""
    lines = [f"  {m.piece.suite}, {m.piece.name}: {m.why}" for m in missing[:MOST_NAMED]]
    more = [f"  and {len(missing) - MOST_NAMED} more"] if len(missing) > MOST_NAMED else []
    count = "1 run" if len(missing) == 1 else f"{len(missing)} runs"
    return NotWhole("\n".join([f"{count} failed twice; their suites are in no table:", *lines, *more]))
