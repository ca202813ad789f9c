"""What most tests of the daemon begin with; and jobs without a process of their own."""

from collections.abc import Callable
from typing import Any

import pytest

from sim_ecu.jobs import pool, process
from sim_ecu.jobs.job import Ending
from sim_ecu.jobs.process import NotDone, Process
from tests.support.sensor_simulator import SensorSimulator
from wrcd.config.config import load_config
from wrcd.core.configuration import Config


@pytest.fixture(scope="session")
def config() -> Config:
    """The default configuration; it is immutable."""
    return load_config(None)


@pytest.fixture
def sim(config: Config) -> SensorSimulator:
    return SensorSimulator(config)


class NoProcess(Process):
    """Runs jobs where it is made."""

    def run(self, function: Callable[[Any], Any], argument: Any, limit_s: float | None = None) -> Any:
        try:
            return function(argument)
        except Exception as e:
            raise NotDone(Ending.FAILED, process._error_text(e)) from None


@pytest.fixture
def jobs_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jobs run in this process: another one takes seconds to load the rig."""
    monkeypatch.setattr(pool, "Process", NoProcess)
