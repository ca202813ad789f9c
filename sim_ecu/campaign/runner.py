"""Many jobs on an executor: a process for each of its threads, a limit of time for each job, a second try.

Any `concurrent.futures.Executor` whose workers are threads will do: `local(workers)`, or a Dask client's. The executor
hands out the work; each thread of it has a process of its own, which can be ended without the worker.
"""

import atexit
import itertools
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Generic, TypeVar

from sim_ecu.campaign.child import Child, Died, Failed, TookTooLong
from sim_ecu.campaign.job import Ending
from wrcd.errors import InputError, Status

T = TypeVar("T")
R = TypeVar("R")
ATTEMPTS = 2
AGAIN = (Ending.FAILED, Ending.DIED)  # too long is too long
AHEAD = 4  # jobs handed out for each worker: none waits for the next
IDLE_S = 1.0
KILLED_WORKER = "KilledWorker"  # Dask's, after it gave a job to so many: no more of them are to die
GIVEN_UP = "every worker that it was given to died"
_ENDINGS = {TookTooLong: Ending.TOO_LONG, Died: Ending.DIED, Failed: Ending.FAILED}
_children = threading.local()


class Lost(InputError):
    """The executor does not take or finish jobs any more."""

    status = Status.STOPPED


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
            child.stop()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for child in every:
            child.close()


def run(
    function: Callable[[T], R], jobs: Sequence[T], executor: Executor, workers: int | Callable[[], int],
    limit_s: float | None = None, *, ahead: int = AHEAD, idle: Callable[[], None] = lambda: None,
) -> Generator[Outcome[R], None, None]:  # fmt: skip
    """function(job) of all, each outcome as soon as it is there: in no order, and at most one for each job.

    function is found by its module and name, and a job is pickled. What fails or dies is tried once more; what then
    fails or dies, or takes longer than limit_s, is an outcome, no error. What is lost with a worker counts as died.
    workers: how many jobs run at once; a function where they come and go: while there are none, one job waits for them.
    ahead: jobs handed out for each of them. idle: called about every second; what it raises ends the run. Raises Lost
    where the executor is. Whatever ends it, and when it is closed, what no worker has begun is taken back.
    """
    left = iter(range(len(jobs)))
    running: dict[Future[Any], tuple[int, int]] = {}
    ended: SimpleQueue[Future[Any]] = SimpleQueue()

    def hand_out(place: int, attempt: int) -> None:
        try:
            future = executor.submit(attempt_at, function, jobs[place], limit_s)
        except Exception as e:
            raise Lost(f"they take nothing any more: {type(e).__name__}: {e}") from None
        running[future] = place, attempt
        future.add_done_callback(ended.put)

    def fill() -> None:
        width = max(ahead * (workers if isinstance(workers, int) else workers()), 1)
        for place in itertools.islice(left, max(width - len(running), 0)):
            hand_out(place, 1)

    looked = time.monotonic()
    try:
        fill()
        while running:
            now = time.monotonic()
            if now - looked >= IDLE_S:
                idle()
                looked = now
            try:
                future = ended.get(timeout=IDLE_S)
            except Empty:
                fill()
                continue
            place, attempt = running.pop(future)
            ending, value, error, seconds = _result(future)
            del future  # Dask works a result out again that is lost with its worker while anybody holds on to it
            if ending in AGAIN and error != GIVEN_UP and attempt < ATTEMPTS:
                hand_out(place, attempt + 1)
                continue
            fill()
            yield Outcome(place, ending, value, error, attempt, seconds)
    finally:
        for future in list(running):
            future.cancel()


def _result(future: Future[Any]) -> tuple[Ending, Any, str, float]:
    try:
        ending, value, error, seconds = future.result()
    except CancelledError:
        raise Lost("what they were handed is given up") from None
    except Exception as e:
        if type(e).__name__ == KILLED_WORKER:
            return Ending.DIED, None, GIVEN_UP, 0.0
        raise Lost(f"one cannot run a job: {type(e).__name__}: {e}") from None
    return Ending(ending), value, error, seconds


def attempt_at(function: Callable[[T], R], job: T, limit_s: float | None) -> tuple[str, R | None, str, float]:
    """On a worker's thread: one attempt in the process of this thread. Ending, value, error, seconds."""
    child: Child | None = getattr(_children, "own", None)
    if child is None:  # a worker that is not ours: Dask's
        child = _children.own = Child()
        atexit.register(child.stop)
    began = time.monotonic()
    try:
        value = child.run(function, job, limit_s)
    except (TookTooLong, Died, Failed) as e:
        return _ENDINGS[type(e)].value, None, str(e), time.monotonic() - began
    return Ending.DONE.value, value, "", time.monotonic() - began
