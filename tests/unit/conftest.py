"""What most tests of the daemon begin with."""

import pytest

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
