"""What most tests of the daemon begin with; and jobs without a process of their own."""

import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from typing import Any

import pytest

from sim_ecu.jobs import pool, whole
from sim_ecu.jobs.pool import TRIES, Ending, JobOutcome, Workers
from tests.support.sensor_simulator import SensorSimulator
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError


@pytest.fixture(scope="session")
def config() -> Config:
    """The default configuration; it is immutable."""
    return load_config(None)


@pytest.fixture
def sim(config: Config) -> SensorSimulator:
    return SensorSimulator(config)


def run_here(
    function: Callable[[Any], Any], jobs: Sequence[Any], _workers: object, _limit_s: float = 0.0
) -> Iterator[JobOutcome[Any]]:
    """As pool.run, one after the other where it is called; each as a worker would get it."""
    for place, one in enumerate(jobs):
        work, job = pickle.loads(pickle.dumps((function, one)))
        error = ""
        for _ in range(TRIES):
            try:
                yield JobOutcome(place, Ending.DONE, work(job), "")
            except Exception as e:
                error = str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"
            else:
                break
        else:
            yield JobOutcome(place, Ending.FAILED, None, error)


@pytest.fixture
def jobs_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run in this process: another one takes seconds to load the rig."""
    for module in (pool, whole):
        monkeypatch.setattr(module, "run", run_here)
        monkeypatch.setattr(module, "local", lambda _count: nullcontext(Workers(None)))
