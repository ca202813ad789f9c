"""Many jobs on Dask, one at a time in each worker process: of this computer, or of a scheduler.

Dask's `retries` are for a task that raises. A worker that ends is blamed on all that was assigned to it; how often that
is allowed says the scheduler's `allowed-failures`. No task has a limit of time. So each job is given to one worker by
its address, alone, and is given out once more from here; at its limit the kernel ends the worker, which its nanny
starts anew.
"""

import itertools
import logging
import pickle
import signal
import sys
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from typing import Any, Generic, TypeVar

import dask
import distributed
from distributed.scheduler import KilledWorker

from sim_ecu.jobs.digests import code
from wrcd.errors import InputError, Status

T = TypeVar("T")
R = TypeVar("R")
LIMIT_S = 3600.0  # of a job, where nobody says another
TRIES = 2
RESUMES = "the same command goes on from there"
LOST = "the workers are lost: no scheduler answers any more"
CONNECT_S = 5.0
LOOK_S = 0.5  # how often it is looked which workers are there
BEGIN_S = 120.0  # without any worker of this computer: none will come
FETCH_S = 60.0  # of a value: its worker may have ended since it was there
DASK = {
    "distributed.scheduler.allowed-failures": 0,  # said at once
    "distributed.worker.preload": [__name__],
    "distributed.deploy.lost-worker-timeout": "100 days",  # else one that is just starting anew then is given up
    "distributed.admin.large-graph-warning-threshold": "1TiB",  # recordings are large
}


class Ending(StrEnum):
    """How a job ended."""

    DONE = "done"
    FAILED = "failed"  # it raised an error
    TOO_LONG = "too long"  # it was ended at its limit
    DIED = "died"  # its process ended by itself or was killed


class Stopped(InputError):
    """The run ended before its end; what is finished is kept."""

    status = Status.STOPPED


@dataclass(frozen=True, slots=True)
class JobOutcome(Generic[R]):
    """How the job at a place in the sequence ended. value: None unless it is done; error: why not."""

    place: int
    ending: Ending
    value: R | None
    error: str


class Workers:
    """Those of a client of Dask. They come and go. address: of a scheduler; "" where they are of this computer."""

    def __init__(self, client: Any, address: str = "") -> None:
        self.client, self.address = client, address

    def there(self) -> set[str]:
        """Return their addresses. Raises Stopped where nobody can work."""
        with suppress(OSError):
            if self.client.status == "running":
                threads = self.client.nthreads()
                if max(threads.values(), default=1) == 1:
                    return set(threads)
                hint = "`dask worker --nthreads 1`: one job's limit would end the other"
                raise InputError("a worker has several threads", key="--scheduler", hint=hint)
        raise Stopped(LOST, hint=RESUMES)


@contextmanager
def local(count: int) -> Iterator[Workers]:
    """Yield so many workers on this computer. Whatever happens, no process is left when it ends."""
    loopback = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0", "scheduler_kwargs": {"dashboard": False}}
    with (
        dask.config.set(DASK),
        TemporaryDirectory() as scratch,
        distributed.LocalCluster(
            n_workers=count, threads_per_worker=1, memory_limit=0, local_directory=scratch, **loopback,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        yield Workers(client)


def dask_setup(_worker: Any) -> None:
    """In a worker of this computer, as it begins: Ctrl-C at a terminal is for who started it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """Yield the workers at a scheduler. Raises InputError for an address without one."""
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # who runs reports what is lost
    with dask.config.set(DASK):
        try:
            client = distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError):
            hint = "tcp://HOST:PORT, as `dask scheduler` prints it"
            raise InputError(f"{address}: no scheduler answers there", key="--scheduler", hint=hint) from None
        try:
            yield Workers(client, address)
        finally:
            with suppress(OSError):  # nobody answers: who raised it reports what ended it
                client.close(timeout=CONNECT_S)


def run(
    function: Callable[[T], R], jobs: Sequence[T], workers: Workers, limit_s: float = LIMIT_S
) -> Generator[JobOutcome[R], None, None]:
    """Run function(job) of all, each outcome as soon as it is there: in no order, and one for each job.

    function is found by its module and name. What fails, dies or hangs is tried once more; then it is an outcome, no
    error. Raises Stopped where nobody works any more, or with other code.
    """
    left: Iterator[tuple[int, int]] = zip(range(len(jobs)), itertools.repeat(1))
    again: list[tuple[int, int]] = []
    at_work: dict[str, tuple[Any, int, int, float]] = {}  # future, place, attempt, begin: by worker
    ended: SimpleQueue[Any] = SimpleQueue()
    missing, absent = len(jobs), 0
    try:
        while missing:
            there = workers.there()
            for address in sorted(there - at_work.keys()):
                if (one := again.pop() if again else next(left, None)) is not None:
                    request = pickle.dumps((function, jobs[one[0]]), pickle.HIGHEST_PROTOCOL)
                    future = workers.client.submit(limited, request, limit_s, code(), workers=[address], pure=False)
                    at_work[address] = future, *one, time.monotonic()
                    future.add_done_callback(ended.put)
            absent = 0 if there else absent + 1
            if absent == 1 and workers.address:
                print(f"waiting for workers at {workers.address}", file=sys.stderr, flush=True)
            elif absent * LOOK_S > BEGIN_S and not workers.address:
                raise Stopped("no worker begins on this computer", hint=RESUMES)
            with suppress(Empty):
                ended.get(timeout=LOOK_S)
            for address, (future, place, attempt, since_s) in list(at_work.items()):
                if future.done() or address not in there:
                    del at_work[address]
                    outcome = _outcome(future, place, limit_s, time.monotonic() - since_s)
                    if outcome.ending is Ending.DONE or attempt == TRIES:
                        missing -= 1
                        yield outcome
                    else:
                        again.append((place, attempt + 1))
    finally:
        if workers.client.status == "running":
            workers.client.cancel([future for future, *_ in at_work.values()])


def _outcome(future: Any, place: int, limit_s: float, took_s: float) -> JobOutcome[Any]:
    """How an attempt ended. Raises Stopped where the worker could not even begin."""
    error: BaseException | None = None
    try:
        if future.status == "finished":
            with suppress(TimeoutError):  # its worker has ended since
                value, why = future.result(timeout=FETCH_S)
                ended = (Ending.FAILED, None, why) if why else (Ending.DONE, pickle.loads(value), "")
                return JobOutcome(place, *ended)
        elif future.status == "error":
            error = future.exception(timeout=FETCH_S)
        elif future.status == "pending":
            future.cancel()
        else:
            raise Stopped(LOST, hint=RESUMES)
    finally:
        future.release()  # what is lost with a worker would be worked out again for who holds on to it
    if error is not None and not isinstance(error, KilledWorker):
        raise error if isinstance(error, Stopped) else Stopped(f"a worker cannot run jobs: {error!r}", hint=RESUMES)
    died = (Ending.DIED, None, "its process ended or was killed")
    return JobOutcome(place, *(died if took_s < limit_s else (Ending.TOO_LONG, None, f"not done within {limit_s:g} s")))


def limited(request: bytes, limit_s: float, asked: str) -> tuple[bytes, str]:
    """On a worker: what a function gives for its job, all pickled, or why not. asked: the code of who asks."""
    if code() != asked:
        reason = "a worker has other sources of wrcd, or other libraries, than are here"
        raise Stopped(reason, hint="have the same versions everywhere, and start the workers anew")
    function, job = pickle.loads(request)  # not by Dask: its scheduler would load the rig, too
    signal.setitimer(signal.ITIMER_REAL, limit_s)  # SIGALRM ends the process, whatever it is at
    try:
        return pickle.dumps(function(job), pickle.HIGHEST_PROTOCOL), ""
    except Exception as e:  # one that is written for a person stands for itself
        return b"", str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
