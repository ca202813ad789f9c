"""Many jobs on Dask, one at a time in each worker process: of this computer, or of a scheduler.

Dask's `retries` are for a task that raises. A worker that ends is blamed on all that was assigned to it; how often that
is allowed says the scheduler's `allowed-failures`. No task has a limit of time. So each job is given to one worker by
its address, alone, and is given out once more from here; at its limit the kernel ends the worker, which its nanny
starts anew. One whose job has not even begun by then is ended by the nanny.
"""

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
from distributed.comm import resolve_address
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
FETCH_S = 10.0  # of a value: its worker may have ended since it was there
LATE_S = 60.0  # beyond a job's limit: it loads the rig first
DASK = {
    "distributed.scheduler.allowed-failures": 0,  # reported at once
    "distributed.worker.preload": [__name__],
    "distributed.deploy.lost-worker-timeout": "100 days",  # else one that is just starting anew then is given up
    "distributed.admin.large-graph-warning-threshold": "1TiB",  # recordings are large
    # Workers keep what their arrays have freed: given back to the kernel it is cleared page by page again and again
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 30,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 1 << 25,
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


@contextmanager
def kept() -> Iterator[None]:
    """Around what keeps what is finished: a person who stops it reads that the same command goes on."""
    try:
        yield
    except Stopped as e:
        raise e if e.hint else Stopped(e.reason, file=e.file, hint=RESUMES) from None


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
        """Return the addresses of those with one thread. Raises Stopped where nobody can work."""
        with suppress(OSError):
            if self.client.status == "running":
                threads = self.client.nthreads()
                if (found := {address for address, count in threads.items() if count == 1}) or not threads:
                    return found
                hint = "`dask worker --nthreads 1`: one job's limit would end the other"
                raise InputError("every worker has several threads", key="--scheduler", hint=hint)
        raise Stopped(LOST)

    def end(self, address: str) -> None:
        """End one, whatever it is at; its nanny starts it anew. A scheduler that is gone is told by who asks next."""
        how = {"timeout": FETCH_S, "wait_for_workers": False, "on_error": "return", "stimulus_id": "too long"}
        with suppress(OSError):  # the client's own restart_workers refuses one without a nanny
            self.client.sync(self.client.scheduler.restart_workers, workers=[address], **how)


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
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # who runs reports what is lost
    with dask.config.set(DASK):
        try:
            resolve_address(address)  # of one that is none a client would be left half made, and lock the next one out
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
    left = [(place, 1) for place in reversed(range(len(jobs)))]  # with the attempt
    at_work: dict[str, tuple[Any, int, int, float]] = {}  # future, place, attempt, begin: by worker
    ended: SimpleQueue[Any] = SimpleQueue()
    missing, seen_s, tell = len(jobs), time.monotonic(), bool(workers.address)
    try:
        while missing:
            there = workers.there()
            for address in sorted(there - at_work.keys()):
                if left:
                    place, attempt = left.pop()
                    request = pickle.dumps((function, jobs[place]), pickle.HIGHEST_PROTOCOL)
                    future = workers.client.submit(limited, request, limit_s, code(), workers=[address], pure=False)
                    at_work[address] = future, place, attempt, time.monotonic()
                    future.add_done_callback(ended.put)
            seen_s = time.monotonic() if there else seen_s
            if not there and tell:
                print(f"waiting for workers at {workers.address}", file=sys.stderr, flush=True)
                tell = False
            elif time.monotonic() - seen_s > BEGIN_S and not workers.address:
                raise Stopped("no worker begins on this computer")
            with suppress(Empty):
                ended.get(timeout=LOOK_S)
            for address, (future, place, attempt, since_s) in list(at_work.items()):
                took_s = time.monotonic() - since_s
                if late := not future.done() and took_s > limit_s + LATE_S:
                    workers.end(address)
                if late or future.done() or address not in there:
                    del at_work[address]
                    outcome = _outcome(future, place, limit_s, took_s)
                    if outcome.ending is Ending.DONE or attempt == TRIES:
                        missing -= 1
                        yield outcome
                    else:
                        left.append((place, attempt + 1))
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
        elif future.status in ("pending", "lost"):  # lost: with its worker, since it was there
            future.cancel()
        else:
            raise Stopped(LOST)
    finally:
        future.release()  # what is lost with a worker would be worked out again for who holds on to it
    if error is not None and not isinstance(error, KilledWorker):
        raise error if isinstance(error, Stopped) else Stopped(f"scheduler or worker cannot run jobs: {error!r}")
    died = (Ending.DIED, None, "its process ended or was killed")
    return JobOutcome(place, *(died if took_s < limit_s else (Ending.TOO_LONG, None, f"not done within {limit_s:g} s")))


def limited(request: bytes, limit_s: float, asked: str) -> tuple[bytes, str]:
    """On a worker: what a function gives for its job, all pickled, or why not. asked: the code of who asks."""
    if code() != asked:
        reason = "a worker has other sources of wrcd, or other libraries, than are here"
        raise Stopped(reason, hint="have the same versions everywhere, and start the workers anew")
    function, job = pickle.loads(request)  # not by Dask: its scheduler would load the rig, too
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})  # who started the worker may have blocked it
    signal.setitimer(signal.ITIMER_REAL, limit_s)  # SIGALRM ends the process, whatever it is at
    try:
        return pickle.dumps(function(job), pickle.HIGHEST_PROTOCOL), ""
    except (SystemExit, KeyboardInterrupt):
        raise
    except BaseException as e:  # one that is written for a person stands for itself
        return b"", str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
