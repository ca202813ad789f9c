"""One run of the rig through every format that a logger writes: each holds its frames and replays to its adhesion."""

from pathlib import Path

import pytest

from sim_ecu.cli.main import main as rig
from wrcd.cli.main import main
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

# a change of rail, a fault that costs frames, and the adhesion in between
SCENARIO = """
duration_s = 4.0
speed_m_s = 25.0
axles = [1, 2]
rail = [{ curve = "A" }, { from_m = 60, curve = "E" }]
drive = { utilisation = 0.6 }
fault = [{ kind = "crc", of = "yaw_rate", axle = 2, at_s = 1.5, duration_s = 0.1 }]
"""


def adhesion(log: Path) -> str:
    """The rows of a replay, their times counted from the log's first frame."""
    out = log.with_suffix(".rows")
    assert main(["replay", str(log), "--relative", "--csv", str(out)]) == 0
    return out.read_text()


def frames(log: Path) -> list[tuple[int, bool, bool, bytes]]:
    damage = Damage()
    found = [(f.can_id, f.extended, f.fd, f.data) for f, _ in read_log(log, damage)]
    assert damage.whole
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("round")
    (folder / "run.toml").write_text(SCENARIO)
    return folder


@pytest.fixture(scope="module")
def of_the_candump_log(folder: Path) -> str:
    assert rig(["play", str(folder / "run.toml"), "--fast", "--log", str(folder / "a.log")]) == 0
    return adhesion(folder / "a.log")


def test_run_has_an_adhesion_that_changes(of_the_candump_log: str) -> None:
    lines = of_the_candump_log.splitlines()
    assert len(lines) > 350
    assert {line.split(",")[2] for line in lines[1:]} == {"NotAvailable", "Valid", "Degraded"}
    levels = [float(cell) for line in lines[1:] if (cell := line.split(",")[3])]
    assert max(levels) > 2 * min(levels)


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".mf4", ".csv", ".asc.gz"])
def test_every_format_gives_the_adhesion_of_the_candump_log(suffix: str, folder: Path, of_the_candump_log: str) -> None:
    log = folder / f"b{suffix}"
    assert rig(["play", str(folder / "run.toml"), "--fast", "--log", str(log)]) == 0
    assert frames(log) == frames(folder / "a.log")
    assert adhesion(log) == of_the_candump_log
