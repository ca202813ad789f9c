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

from sim_ecu.jobs.job import Ending
from sim_ecu.jobs.process import NotDone, Process
from wrcd.errors import InputError, Status

T = TypeVar("T")
R = TypeVar("R")
ATTEMPTS = 2
AGAIN = (Ending.FAILED, Ending.DIED)  # too long is too long
RESUMES = "the same command goes on from there"
AHEAD = 4  # jobs handed out for each worker: none waits for the next
IDLE_S = 1.0
KILLED_WORKER = "KilledWorker"  # Dask's, after it gave a job to so many: no more of them are to die
GIVEN_UP = "every worker that it was given to died"
_processes = threading.local()


class Stopped(InputError):
    """The run ended before its end; what is finished is kept."""

    status = Status.STOPPED


class Lost(Stopped):
    """The executor does not take or finish jobs any more."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does it: an executor, how many jobs it works on at once (a function where they come and go: while there are
    none, one job waits for them), how many are handed out for each of those.

    gather: waits until somebody is there. idle: is called every second or so; what it raises ends the run.
    """

    executor: Executor
    count: int | Callable[[], int]
    ahead: int = AHEAD
    gather: Callable[[], None] = lambda: None
    idle: Callable[[], None] = lambda: None


@dataclass(frozen=True, slots=True)
class JobOutcome(Generic[R]):
    """How the job at a place in the sequence ended. value: None unless it is done. seconds: of the last attempt."""

    place: int
    ending: Ending
    value: R | None
    error: str
    attempts: int
    seconds: float


@contextmanager
def local(workers: int) -> Iterator[Workers]:
    """Yield workers on this computer. Whatever happens, no process is left when it ends."""
    every: list[Process] = []

    def begin() -> None:
        _processes.own = Process()
        every.append(_processes.own)

    pool = ThreadPoolExecutor(workers, "worker", begin)
    try:
        yield Workers(pool, workers)
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        for process in every:
            process.stop()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        for process in every:
            process.close()


def run(
    function: Callable[[T], R], jobs: Sequence[T], workers: Workers, limit_s: float | None = None
) -> Generator[JobOutcome[R], None, None]:
    """Run function(job) of all, each outcome as soon as it is there: in no order, and at most one for each job.

    function is found by its module and name, and a job is pickled. What fails or dies is tried once more; what then
    fails or dies, or takes longer than limit_s, is an outcome, no error. What is lost with a worker counts as died.
    Raises Lost where the executor is. Whatever ends it, and when it is closed, what no worker has begun is taken back.
    """
    left = iter(range(len(jobs)))
    running: dict[Future[Any], tuple[int, int]] = {}
    ended: SimpleQueue[Future[Any]] = SimpleQueue()

    def hand_out(place: int, attempt: int) -> None:
        try:
            future = workers.executor.submit(attempt_at, function, jobs[place], limit_s)
        except Exception as e:
            raise Lost(f"they take nothing any more: {type(e).__name__}: {e}") from None
        running[future] = place, attempt
        future.add_done_callback(ended.put)

    def fill() -> None:
        count = workers.count if isinstance(workers.count, int) else workers.count()
        width = max(workers.ahead * count, 1)
        for place in itertools.islice(left, max(width - len(running), 0)):
            hand_out(place, 1)

    looked = time.monotonic()
    try:
        fill()
        while running:
            now = time.monotonic()
            if now - looked >= IDLE_S:
                workers.idle()
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
            yield JobOutcome(place, ending, value, error, attempt, seconds)
    finally:
        for future in list(running):
            future.cancel()


def _result(future: Future[Any]) -> tuple[Ending, Any, str, float]:
    try:
        found: tuple[Ending, Any, str, float] = future.result()
    except CancelledError:
        raise Lost("what they were handed is given up") from None
    except Exception as e:
        if type(e).__name__ == KILLED_WORKER:
            return Ending.DIED, None, GIVEN_UP, 0.0
        raise Lost(f"one cannot run a job: {type(e).__name__}: {e}") from None
    return found


def attempt_at(function: Callable[[T], R], job: T, limit_s: float | None) -> tuple[Ending, R | None, str, float]:
    """On a worker's thread: one attempt in the process of this thread. Ending, value, error, seconds."""
    process: Process | None = getattr(_processes, "own", None)
    if process is None:  # a worker that is not ours: Dask's
        process = _processes.own = Process()
        atexit.register(process.stop)
    began = time.monotonic()
    try:
        value = process.run(function, job, limit_s)
    except NotDone as e:
        return e.ending, None, str(e), time.monotonic() - began
    return Ending.DONE, value, "", time.monotonic() - began
