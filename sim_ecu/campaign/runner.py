"""Many jobs on an executor: a process for each of its threads, a limit of time for each job, a second try.

Any `concurrent.futures.Executor` whose workers are threads will do: `local(workers)`, or a Dask client's. The executor
hands out the work; each thread of it has a process of its own, which can be ended without the worker.
"""

import atexit
import itertools
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from sim_ecu.campaign.child import Child, Died, Failed, TookTooLong
from sim_ecu.campaign.job import Ending

T = TypeVar("T")
R = TypeVar("R")
ATTEMPTS = 2
AHEAD = 4  # jobs handed out for each worker: none waits for the next
_ENDINGS = {TookTooLong: Ending.TOO_LONG, Died: Ending.DIED, Failed: Ending.FAILED}
_children = threading.local()


@dataclass(frozen=True, slots=True)
class Outcome(Generic[R]):
    """How the job at a place in the sequence ended. value: None unless it is done. seconds: of the last attempt."""

    place: int
    ending: Ending
    value: R | None
    error: str
    attempts: int
    seconds: float


@contextmanager
def local(workers: int) -> Iterator[Executor]:
    """An executor on this computer. Whatever happens, no process is left when it ends."""
    every: list[Child] = []

    def begin() -> None:
        _children.own = Child()
        every.append(_children.own)

    pool = ThreadPoolExecutor(workers, "worker", begin)
    try:
        yield pool
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in every:
            child.end()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for child in every:
            child.close()


def run(
    function: Callable[[T], R], jobs: Sequence[T], executor: Executor, workers: int, limit_s: float | None = None
) -> Iterator[Outcome[R]]:
    """function(job) of all, each outcome as soon as it is there: in no order, and at most one for each job.

    function is found by its module and name, and a job is pickled. What fails is tried once more; what then fails, dies
    or takes longer than limit_s is an outcome, no error. What is lost with a worker counts as died.
    """
    left = iter(range(len(jobs)))
    running: dict[Future[Any], tuple[int, int]] = {}

    def hand_out(place: int, attempt: int) -> None:
        running[executor.submit(attempt_at, function, jobs[place], limit_s)] = place, attempt

    for place in itertools.islice(left, workers * AHEAD):
        hand_out(place, 1)
    while running:
        ended, _ = wait(running, return_when=FIRST_COMPLETED)
        for future in ended:
            place, attempt = running.pop(future)
            ending, value, error, seconds = _result(future)
            if ending is not Ending.DONE and attempt < ATTEMPTS:
                hand_out(place, attempt + 1)
                continue
            following = next(left, None)
            if following is not None:
                hand_out(following, 1)
            yield Outcome(place, ending, value, error, attempt, seconds)


def _result(future: Future[Any]) -> tuple[Ending, Any, str, float]:
    try:
        ending, value, error, seconds = future.result()
    except Exception as e:  # the worker was lost with the job, or what it returned cannot be sent
        return Ending.DIED, None, f"{type(e).__name__}: {e}", 0.0
    return Ending(ending), value, error, seconds


def attempt_at(function: Callable[[T], R], job: T, limit_s: float | None) -> tuple[str, R | None, str, float]:
    """On a worker's thread: one attempt in the process of this thread. Ending, value, error, seconds."""
    child: Child | None = getattr(_children, "own", None)
    if child is None:  # a worker that is not ours: Dask's
        child = _children.own = Child()
        atexit.register(child.end)
    began = time.monotonic()
    try:
        value = child.run(function, job, limit_s)
    except (TookTooLong, Died, Failed) as e:
        return _ENDINGS[type(e)].value, None, str(e), time.monotonic() - began
    return Ending.DONE.value, value, "", time.monotonic() - began
