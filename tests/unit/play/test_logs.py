"""Logs of `sim-ecu play`: in every format that a logger writes they hold all frames and replay to the same adhesion, or
they are refused before the first."""

from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from wrcd.cli.main import main as wrcd
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"  # one of its messages is CAN FD
SCENARIO = 'duration_s = 0.2\naxles = [1, 2]\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.1 }\n'
FLOOD = "error-flood:at=0.05"


def play(tmp_path: Path, log: Path, *more: str) -> int:
    scenario = tmp_path / "short.toml"
    scenario.write_text(SCENARIO)
    return main(["play", str(scenario), "--log", str(log), *more])


def frames(log: Path) -> list[tuple[int, bool, bool, bytes]]:
    damage = Damage()
    found = [(f.can_id, f.extended, f.fd, f.data) for f, _ in read_log(log, damage)]
    assert damage.whole
    return found


@pytest.mark.parametrize(
    ("name", "more"),
    [
        ("a.db", ["--fast"]),  # it loses its last frames without a word
        ("a.DB", ["-i", "virtual", "--channel", "logs"]),
        ("a.trc", ["--fast", "--fault", FLOOD]),  # takes no error frames
        ("a.trc.gz", ["--fast", "--config", str(THIRD_PARTY)]),  # no CAN FD
        ("a.csv", ["--fast", "--config", str(THIRD_PARTY)]),
    ],
)
def test_format_that_would_lose_frames_is_refused_before_the_first(
    name: str, more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / name
    assert play(tmp_path, log, *more) == 2
    assert f"{log}: cannot be written: " in capsys.readouterr().err
    assert not log.exists()


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_formats_that_a_refusal_names_hold_can_fd(suffix: str, tmp_path: Path) -> None:
    logs = [tmp_path / name for name in ("a.log", f"a{suffix}")]
    for log in logs:
        assert play(tmp_path, log, "--fast", "--config", str(THIRD_PARTY)) == 0
    assert frames(logs[0]) == frames(logs[1])
    assert any(fd for _, _, fd, _ in frames(logs[1]))


# a change of rail, a fault that costs frames, and the adhesion in between
RUN = """
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
    assert wrcd(["replay", str(log), "--relative", "--csv", str(out)]) == 0
    return out.read_text()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("round")
    (folder / "run.toml").write_text(RUN)
    return folder


@pytest.fixture(scope="module")
def of_the_candump_log(folder: Path) -> str:
    assert main(["play", str(folder / "run.toml"), "--fast", "--log", str(folder / "a.log")]) == 0
    found = adhesion(folder / "a.log")
    assert {line.split(",")[2] for line in found.splitlines()[1:]} == {"NotAvailable", "Valid", "Degraded"}
    return found


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".mf4", ".csv", ".asc.gz"])
def test_every_format_gives_the_adhesion_of_the_candump_log(suffix: str, folder: Path, of_the_candump_log: str) -> None:
    log = folder / f"b{suffix}"
    assert main(["play", str(folder / "run.toml"), "--fast", "--log", str(log)]) == 0
    assert frames(log) == frames(folder / "a.log")
    assert adhesion(log) == of_the_candump_log
