"""Logs of scenarios, made once per test run."""

from collections.abc import Callable
from pathlib import Path

import pytest

from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import read_scenario
from wrcd.settings import parse_toml

LogOf = Callable[[str], Path]


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
