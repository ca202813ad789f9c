"""A mapping that asks for a parameter group: whoever sends it, at whatever priority."""

import re
from pathlib import Path

import pytest

from sim_ecu.cli.main import main as sim_ecu
from wrcd.cli.main import main

OWN = Path(__file__).parents[3] / "examples/own-dbc"
RIDE = 'duration_s = 4\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.3 }\n'
SPEED = 0x18FE6E0B  # the group of the speed in the DBC: priority 6, source address 11


def train(folder: Path, keys: str) -> Path:
    """The example's train with its speed in J1939."""
    dbc, toml = ((OWN / name).read_text() for name in ("train.dbc", "train.toml"))
    (folder / "train.dbc").write_text(re.sub(r"\b560\b", str(SPEED | 1 << 31), dbc))
    config = folder / "train.toml"
    config.write_text(toml.replace('"BCU_Speed.V"', f'{{ signal = "BCU_Speed.V"{keys} }}'))
    return config


def replayed(config: Path, can_id: int) -> bytes:
    """The rows that come of a ride whose speed is sent under another id of the same group."""
    log, out = config.parent / "ride.log", config.parent / "out.csv"
    (config.parent / "ride.toml").write_text(RIDE)
    played = [
        "play",
        str(config.parent / "ride.toml"),
        "--config",
        str(config),
        "--no-truth",
        "--fast",
        "--log",
        str(log),
    ]
    assert sim_ecu(played) == 0
    log.write_text(log.read_text().replace(f" {SPEED:08X}#", f" {can_id:08X}#"))
    assert main(["replay", str(log), "--config", str(config), "--csv", str(out)]) == 0
    return out.read_bytes()


@pytest.mark.parametrize(
    ("keys", "can_id"),
    [
        ("", SPEED),
        # Ids are matched whole, in Python's core and in C's lane. One core that owns its state is to know groups.
        pytest.param(", pgn = true", 0x0CFE6E33, marks=pytest.mark.xfail(reason="there is no such key", strict=True)),
    ],
)
def test_group_is_read_whoever_sends_it(keys: str, can_id: int, tmp_path: Path) -> None:
    (tmp_path / "plain").mkdir()
    rows = replayed(train(tmp_path, keys), can_id)
    assert rows.count(b",Valid,") > 100
    assert rows == replayed(train(tmp_path / "plain", ""), SPEED)
