"""The ride that these tests share: dry, leaf film, dry; alone, and with what a daemon sent beside it."""

import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.scenarios import LogOf
from tests.support.story import LEAF_RIDE, Ride, merged
from wrcd.bus.dbc import load_dbc
from wrcd.cli.main import main
from wrcd.core.configuration import Config
from wrcd.logs.story import gather


@pytest.fixture(scope="session")
def ride(log_of: LogOf, config: Config, tmp_path_factory: pytest.TempPathFactory) -> Ride:
    folder = tmp_path_factory.mktemp("ride")
    log, sent = log_of(LEAF_RIDE), folder / "sent.log"
    rows, events, both = folder / "rows.csv", folder / "events.csv", folder / "both.log"
    assert main(["replay", str(log), "-o", str(sent), "--csv", str(rows), "--events", str(events)]) == 0
    both.write_text(merged(log, sent))
    truth = load_dbc(TRUTH_DBC)
    return Ride(
        log, both, rows, events, truth, gather(log, config, [truth]), gather(both, config, [truth])
    )  # fmt: skip
