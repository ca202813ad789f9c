"""The rides that these tests share: dry, leaf film, dry; alone, and with what a daemon sent beside it."""

from pathlib import Path

import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.lone_wheelset import LONE, PLAYED, lone_config
from tests.support.scenarios import LogOf
from tests.support.story import LEAF_RIDE, Ride, merged
from wrcd.bus.dbc import load_dbc
from wrcd.cli.main import main
from wrcd.core.configuration import Config
from wrcd.logs.story import gather


def _ridden(log: Path, config: Config, folder: Path, *options: str) -> Ride:
    """The log, and what a replay with these options sends, which is one with the configuration."""
    sent, rows, events, both = (folder / name for name in ("sent.log", "rows.csv", "events.csv", "both.log"))
    assert main(["replay", str(log), *options, "-o", str(sent), "--csv", str(rows), "--events", str(events)]) == 0
    both.write_text(merged(log, sent))
    truth = load_dbc(TRUTH_DBC)
    return Ride(
        log, both, rows, events, truth, gather(log, config, [truth]), gather(both, config, [truth])
    )  # fmt: skip


@pytest.fixture(scope="session")
def ride(log_of: LogOf, config: Config, tmp_path_factory: pytest.TempPathFactory) -> Ride:
    return _ridden(log_of(LEAF_RIDE), config, tmp_path_factory.mktemp("ride"))


@pytest.fixture(scope="session")
def lone_ride(log_of: LogOf, tmp_path_factory: pytest.TempPathFactory) -> Ride:
    """The ride of the lone wheelset, with its design: it saturates on the film, and another model fits there."""
    return _ridden(log_of(PLAYED + LEAF_RIDE), lone_config(), tmp_path_factory.mktemp("lone-ride"), "--design", LONE)
