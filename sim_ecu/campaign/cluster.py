"""Workers of a Dask scheduler: they come and go; one with other code is told of, and nothing runs there."""

import logging
import math
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import distributed

from sim_ecu.campaign.go import Stopped, Workers
from sim_ecu.campaign.job import LIBRARIES, code
from sim_ecu.campaign.runner import Lost
from wrcd.errors import InputError

CONNECT_S = 5.0
ADDRESS = re.compile(r"(tcp|tls|ucx)://.+:\d+")
AHEAD = 16  # jobs handed out for each thread: a worker that is far away has its next ones, too
COUNT_S = 1.0  # how often the workers are counted
WAIT_S = 0.5
RUNNING = "running"
GONE = "no scheduler answers any more"


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers at a scheduler; `gather` waits for the first. Raises InputError for an address without one."""
    for name in ("distributed", "distributed.client"):  # what is lost is said by who runs
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
        crew = _Crew(client, address)
        yield Workers(client.get_executor(pure=False), crew.count, AHEAD, crew.gather, crew.look)
    finally:
        with suppress(OSError):  # nobody answers: what ended it is said by who raised it
            client.close(timeout=WAIT_S)


class _Crew:
    """The workers that are there."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._counted_s, self._count = -math.inf, 0
        self._waits = False  # and it is said

    def gather(self) -> None:
        """Wait for the first worker, then look at the code of all that are there. Raises Stopped for other code."""
        found: dict[str, Any] = {}
        while not found:
            self.look()
            if self._count:
                with _there():
                    answers = self._client.run(code, on_error="return")
                found = {worker: a for worker, a in answers.items() if not isinstance(a, OSError)}  # it has gone
            if not found:
                time.sleep(WAIT_S)
        for worker, digest in sorted(found.items()):
            if isinstance(digest, BaseException):
                raise Stopped(f"the worker {worker} cannot run wrcd: {digest}", hint="install the same version there")
            if digest != code():
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


@contextmanager
def _there() -> Iterator[None]:
    """Raises Lost for what a scheduler does not answer."""
    try:
        yield
    except OSError:
        raise Lost(GONE) from None
