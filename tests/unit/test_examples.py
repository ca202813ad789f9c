"""The examples run: on the virtual bus, or on files alone."""

import csv
import math
from pathlib import Path
from typing import Any

import can
import cantools
import pytest
from cantools.database.can import Database

from sim_ecu.cli.main import main as rig
from tests.support.contract import example
from wrcd.bus.candump import format_line
from wrcd.bus.units import G
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
GOLDEN = ROOT / "tests" / "golden" / "leaf-film.log"
CHANNEL = "examples"


def database(path: Path) -> Database:
    found = cantools.database.load_file(path)
    assert isinstance(found, Database)
    return found


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> list[can.Message]:
    """Adhesion_A1 of the golden log, as the daemon sends it."""
    log = tmp_path_factory.mktemp("examples") / "sent.log"
    assert main(["replay", str(GOLDEN), "-o", str(log)]) == 0
    frames = (frame for frame, _ in read_log(log, Damage()))
    return [
        can.Message(arbitration_id=f.can_id, data=f.data, is_extended_id=False) for f in frames if f.can_id == 0x091
    ]


def heard(frames: list[can.Message]) -> list[str]:
    """What the subscriber says of frames on a virtual bus."""
    subscribe = example("subscribe")
    with can.Bus(channel=CHANNEL, interface="virtual") as ours, can.Bus(channel=CHANNEL, interface="virtual") as theirs:
        for frame in frames:
            theirs.send(frame)
        return list(subscribe.listen(ours, database(subscribe.DBC)))


def test_subscriber_prints_adhesion_and_notices_silence(sent: list[can.Message]) -> None:
    lines = heard(sent)
    assert lines[0] == "axle 1: NotAvailable"
    assert any(line.startswith("axle 1: adhesion 2.7 % (Within1pp), 2.") for line in lines)
    assert lines[-1] == "axle 1: no frame within its time-out"
    assert not any("rejected" in line for line in lines)


def test_subscriber_rejects_a_damaged_and_a_repeated_frame(sent: list[can.Message]) -> None:
    damaged = can.Message(arbitration_id=0x091, data=bytes(8), is_extended_id=False)
    lines = heard([*sent[-3:-1], sent[-2], damaged])
    assert [line for line in lines if "rejected" in line] == ["axle 1: rejected, repeat", "axle 1: rejected, crc"]


def test_own_dbc_gives_valid_adhesion_from_translated_frames(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ours, train = database(ROOT / "dbc" / "wrcd.dbc"), database(EXAMPLES / "own-dbc" / "train.dbc")
    config = EXAMPLES / "own-dbc" / "train.toml"
    mapped = {i.source.signal for i in load_config(config).inputs}
    assert mapped == {"GyroZ", "AccY", "Effort", "BrakeEffort", "Load", "V"}
    rate = math.nan
    lines = []
    for frame, channel in read_log(GOLDEN, Damage()):
        if frame.can_id not in (0x101, 0x111, 0x121, 0x130):
            continue
        values: Any = ours.get_message_by_frame_id(frame.can_id).decode(frame.data)
        if "YawRate" in values:
            rate = math.degrees(values["YawRate"])
            continue
        if "LatAccel" in values:
            name, said = "Bogie1", {"GyroZ": rate, "AccY": values["LatAccel"] / G}
        elif "Torque" in values:
            name, said = "TCU1", {"Effort": values["Torque"] / 1e3, "Status": 0}
        else:
            name, said = "BCU_Speed", {"V": values["Speed"] * 3.6}
        message = train.get_message_by_name(name)
        lines.append(format_line(type(frame)(frame.stamp_us, message.frame_id, message.encode(said)), channel))
        if name == "BCU_Speed":
            brakes = train.get_message_by_name("BCU1")
            load = {"BrakeEffort": 0.0, "Load": 147.1}
            lines.append(format_line(type(frame)(frame.stamp_us, brakes.frame_id, brakes.encode(load)), channel))
    log, table = tmp_path / "train.log", tmp_path / "train.csv"
    log.write_text("\n".join(lines) + "\n")
    assert main(["replay", str(log), "--config", str(config), "--csv", str(table)]) == 0
    assert "rejected: none" in capsys.readouterr().err
    with table.open() as file:
        rows = list(csv.DictReader(file))
    valid = [r for r in rows if r["validity"] == "Valid"]
    assert len(valid) > len(rows) / 2
    assert float(valid[0]["mu_available_pct"]) == pytest.approx(32.7, abs=2.0)
    assert float(valid[-1]["mu_available_pct"]) == pytest.approx(2.7, abs=1.0)


def test_plot_of_a_replay_is_written_and_causes_are_counted(tmp_path: Path) -> None:
    table, picture = tmp_path / "a.csv", tmp_path / "a.png"
    assert main(["replay", str(GOLDEN), "--csv", str(table)]) == 0
    causes = example("plot_replay").plot(table, picture)
    assert causes["the window is not full yet"] == pytest.approx(1.0, abs=0.05)
    assert picture.stat().st_size > 10_000


def test_every_example_is_in_the_index_and_begins_with_its_use() -> None:
    index = (EXAMPLES / "README.md").read_text()
    for path in EXAMPLES.glob("*.py"):
        assert f"({path.name})" in index
        assert f"examples/{path.name}" in path.read_text().split('"""')[1]


def test_campaign_asks_for_every_combination(capsys: pytest.CaptureFixture[str]) -> None:
    assert rig(["campaign", str(EXAMPLES / "stops.toml"), "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith("Stops with wrcd and without: 40 jobs of kind drive")
