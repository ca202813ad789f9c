"""Logs of scenarios, made once per test run."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import read_scenario
from tests.support.scenarios import LogOf
from wrcd.settings import parse_toml

# Property tests. What `make test` runs is the same examples every time: a failure comes from the change at hand, on
# every machine, and nothing needs to be kept. `make fuzz` draws others each time and prints how to see one again.
# No deadline and no complaint about slow drawing: how long an example takes says how busy the machine is.
SLOW = [HealthCheck.too_slow]
settings.register_profile(
    "ci", max_examples=300, deadline=None, derandomize=True, database=None, suppress_health_check=SLOW
)
settings.register_profile(
    "long",
    max_examples=int(os.environ.get("EXAMPLES", 100_000)),
    deadline=None,
    print_blob=True,
    suppress_health_check=SLOW,
)
settings.load_profile("ci")


@pytest.fixture(scope="session")
def log_of(tmp_path_factory: pytest.TempPathFactory) -> LogOf:
    """Plays the text of a scenario into a candump log; the same text gives the same file."""
    folder = tmp_path_factory.mktemp("logs")
    made: dict[str, Path] = {}

    def make(text: str) -> Path:
        if text not in made:
            made[text] = folder / f"{len(made)}.log"
            play_to_log(read_scenario(parse_toml(text, "test"), "test"), made[text])
        return made[text]

    return make
