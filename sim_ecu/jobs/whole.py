"""All of many runs, for a report that must not look whole where it is not: what is missing is named."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from typing import NamedTuple, TypeVar, cast

from sim_ecu.jobs.pool import Ending, Stopped, Workers, local, run
from wrcd.progress import Progress

T = TypeVar("T")
R = TypeVar("R")
MOST_NAMED = 20  # missing runs by name


class Piece(NamedTuple):
    """What a person calls a run, and what it costs, about, in any unit."""

    suite: str
    name: str
    cost: float


class Missing(NamedTuple):
    """A run that gave nothing, and why."""

    piece: Piece
    why: str


def every(
    function: Callable[[T], R], jobs: Sequence[T], pieces: Sequence[Piece], workers: int
) -> tuple[list[R], list[Missing]]:
    """Return function(job) of all, one at least, in their order, and the runs that gave nothing; with progress by the
    pieces' cost. function keeps what jobs share."""
    progress, whole, done = Progress(steps=True), sum(p.cost for p in pieces), 0.0
    results: dict[int, R] = {}
    missing: dict[int, Missing] = {}
    try:
        with local(min(workers, len(jobs))) as crew, closing(run(function, jobs, crew)) as ends:
            for number, o in enumerate(ends, 1):
                piece = pieces[o.place]
                if o.ending is Ending.DONE:
                    results[o.place] = cast(R, o.value)  # it is done: a value
                else:
                    missing[o.place] = Missing(piece, o.error)
                done += piece.cost
                progress.at(f"{piece.suite}: run {number} of {len(jobs)}", done / whole)
    finally:
        progress.end()
    return [results[k] for k in sorted(results)], [missing[k] for k in sorted(missing)]


def each(
    function: Callable[[T], R], jobs: Sequence[T], workers: Workers, names: Sequence[str]
) -> Iterator[tuple[int, R]]:
    """Yield place and value of every job as it ends. Raises Stopped, after the last, that names those that failed."""
    failed: list[str] = []
    with closing(run(function, jobs, workers)) as ends:
        for o in ends:
            if o.ending is Ending.DONE:
                yield o.place, cast(R, o.value)  # it is done: a value
            else:
                failed.append(f"  {names[o.place]}: {o.error}")
    if failed:
        raise Stopped("\n".join([f"{len(failed)} of {len(jobs)} jobs failed twice:", *failed]))


def left_out(missing: Sequence[Missing], suites: Iterable[str]) -> dict[str, list[str]]:
    """Return the runs that each suite lacks that is left out of a report, and why."""
    return {s: [f"{m.piece.name}: {m.why}" for m in missing if m.piece.suite == s] for s in suites}


def not_whole(missing: Sequence[Missing]) -> Stopped:
    """The error that ends a report with holes: its runs by name."""
    lines = [f"  {m.piece.suite}, {m.piece.name}: {m.why}" for m in missing[:MOST_NAMED]]
    lines += [f"  and {len(missing) - MOST_NAMED} more"] * (len(missing) > MOST_NAMED)
    count = f"{len(missing)} run{'s' * (len(missing) > 1)}"
    return Stopped("\n".join([f"{count} failed twice; their suites are in no table:", *lines]))
