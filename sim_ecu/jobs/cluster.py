"""Workers of a Dask scheduler: they come and go; one with other code is reported, and nothing runs there."""

import importlib
import logging
import math
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import distributed

from sim_ecu.jobs.job import LIBRARIES, code
from sim_ecu.jobs.pool import Lost, Stopped, Workers
from wrcd.errors import InputError

CONNECT_S = 5.0
ADDRESS = re.compile(r"(tcp|tls|ucx)://.+:\d+")
AHEAD = 16  # jobs handed out for each thread: a worker that is far away has its next ones, too
COUNT_S = 1.0  # how often the workers are counted
WAIT_S = 0.5
RUNNING = "running"
GONE = "no scheduler answers any more"


@contextmanager
def cluster(address: str, module: str) -> Iterator[Workers]:
    """Yield the workers at a scheduler; `gather` waits for the first. module: of the jobs' function.

    Raises InputError for an address without a scheduler.
    """
    for name in ("distributed", "distributed.client"):  # who runs reports what is lost
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if not ADDRESS.fullmatch(address):
        raise InputError(f"{address}: takes tcp://HOST:PORT", key="--scheduler", hint="`dask scheduler` prints it")
    make: Any = distributed.Client  # it has no types
    try:
        client: Any = make(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError):
        reason = f"{address}: no scheduler answers there"
        raise InputError(reason, key="--scheduler", hint="start one with `dask scheduler`") from None
    try:
        crew = _Crew(client, address, module)
        yield Workers(client.get_executor(pure=False), crew.count, AHEAD, crew.gather, crew.look)
    finally:
        with suppress(OSError):  # nobody answers: who raised it reports what ended it
            client.close(timeout=CONNECT_S)


class _Crew:
    """The workers that are there."""

    def __init__(self, client: Any, address: str, module: str) -> None:
        self._client, self._address, self._module = client, address, module
        self._counted_s, self._count = -math.inf, 0
        self._waits = False  # and it is reported

    def gather(self) -> None:
        """Wait for the first worker, then look at the code of all that are there. Raises Stopped for other code."""
        found: dict[str, Any] = {}
        while not found:
            self.look()
            if self._count:
                with _there():
                    answers = self._client.run(_code_of, self._module, on_error="return")
                found = {worker: a for worker, a in answers.items() if not isinstance(a, OSError)}  # it has gone
            if not found:
                time.sleep(WAIT_S)
        for worker, digest in sorted(found.items()):
            if isinstance(digest, BaseException):
                raise Stopped(f"the worker {worker} cannot run wrcd: {digest}", hint="install the same version there")
            if digest != code(self._module):
                raise Stopped(
                    f"the worker {worker} has other sources of wrcd, or other libraries, than are here",
                    hint=f"have the same versions everywhere, with {', '.join(LIBRARIES)}, and start the workers anew",
                )

    def count(self) -> int:
        """Threads of all workers; 1 while none is there: what is handed out waits."""
        if time.monotonic() - self._counted_s > COUNT_S:
            with _there():
                self._count = sum(self._client.ncores(callback_timeout=CONNECT_S).values())
            self._counted_s = time.monotonic()
        return max(self._count, 1)

    def look(self) -> None:
        """Say it when nobody is there. Raises Lost where the scheduler has gone."""
        if self._client.status != RUNNING:
            raise Lost(GONE)
        self.count()
        if self._count == 0 and not self._waits:
            print(f"waiting for workers at {self._address}", file=sys.stderr, flush=True)
        self._waits = self._count == 0


def _code_of(module: str) -> str:
    """At a worker, which has not imported the module yet."""
    importlib.import_module(module)
    return code(module)


@contextmanager
def _there() -> Iterator[None]:
    """Raises Lost for what a scheduler does not answer."""
    try:
        yield
    except OSError:
        raise Lost(GONE) from None
