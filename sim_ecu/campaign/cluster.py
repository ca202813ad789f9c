"""Workers of a Dask scheduler: they come and go; one with other code is told of, and nothing runs there."""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import distributed

from sim_ecu.campaign.go import Stopped, Workers
from sim_ecu.campaign.job import code
from sim_ecu.campaign.runner import Lost
from wrcd.errors import InputError

CONNECT_S = 10.0
AHEAD = 16  # jobs handed out for each thread: a worker that is far away has its next ones, too
COUNT_S = 2.0  # how often the workers are counted
WAIT_S = 0.5
RUNNING = "running"
GONE = "no scheduler answers any more"


@contextmanager
def cluster(address: str) -> Iterator[Workers]:
    """The workers at a scheduler, one at least. Raises InputError for an address without one, Stopped for workers with
    other code."""
    for name in ("distributed", "distributed.client"):  # what is lost is said by who runs
        logging.getLogger(name).setLevel(logging.CRITICAL)
    make: Any = distributed.Client  # it has no types
    try:
        client: Any = make(address, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as e:
        reason = "no scheduler answers there" if isinstance(e, OSError) else f"is no scheduler's address: {e}"
        raise InputError(f"{address}: {reason}", key="--scheduler", hint="e.g. tcp://127.0.0.1:8786") from None
    try:
        crew = _Crew(client, address)
        crew.gather()
        yield Workers(client.get_executor(pure=False), crew.count, AHEAD, crew.look)
    finally:
        client.close(timeout=WAIT_S)


class _Crew:
    """The workers that are there."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._counted_s, self._count = 0.0, 0

    def gather(self) -> None:
        """Wait for the first worker, then look at the code of all."""
        if not self._client.ncores():
            print(f"waiting for workers at {self._address}", file=sys.stderr, flush=True)
        while not self._client.ncores():
            time.sleep(WAIT_S)
        self.look()
        found = self._client.run(code, on_error="return")
        for worker, digest in sorted(found.items()):
            if isinstance(digest, BaseException):
                raise Stopped(f"the worker {worker} cannot run wrcd: {digest}", hint="install the same version there")
            if digest != code():
                raise Stopped(
                    f"the worker {worker} has other sources of wrcd than are here",
                    hint="have the same version everywhere, and start the workers anew",
                )

    def count(self) -> int:
        """Threads of all workers; 1 while none is there: what is handed out waits."""
        now = time.monotonic()
        if now - self._counted_s > COUNT_S and self._client.status == RUNNING:
            self._count = sum(self._client.ncores().values())
            self._counted_s = now
        return max(self._count, 1)

    def look(self) -> None:
        """Raises Lost where the scheduler has gone."""
        if self._client.status != RUNNING:
            raise Lost(GONE)
