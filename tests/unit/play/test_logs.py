"""Logs of `sim-ecu play`: every frame is in them, or they are refused before the first."""

from pathlib import Path

import pytest

from sim_ecu.cli.main import main
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

THIRD_PARTY = Path(__file__).parents[2] / "data/dbc/third-party.toml"  # one of its messages is CAN FD
SCENARIO = 'duration_s = 0.2\naxles = [1, 2]\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.1 }\n'
FLOOD = "error-flood:at=0.05"


def play(tmp_path: Path, log: Path, *more: str) -> int:
    scenario = tmp_path / "short.toml"
    scenario.write_text(SCENARIO)
    return main(["play", str(scenario), "--log", str(log), *more])


@pytest.mark.parametrize(
    ("name", "more", "reason"),
    [
        ("a.db", ["--fast"], "a .db loses its last frames without a word"),
        ("a.DB", ["--fast"], "a .db loses its last frames without a word"),
        ("a.db", ["-i", "virtual", "--channel", "logs"], "a .db loses its last frames without a word"),
        ("a.trc", ["--fast", "--config", str(THIRD_PARTY)], "a .trc takes no CAN FD frames, which this train has"),
        ("a.trc.gz", ["--fast", "--config", str(THIRD_PARTY)], "a .trc takes no CAN FD frames, which this train has"),
        ("a.csv", ["--fast", "--config", str(THIRD_PARTY)], "a .csv takes no CAN FD frames, which this train has"),
    ],
)
def test_format_that_would_lose_frames_is_refused_before_the_first(
    name: str, more: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / name
    assert play(tmp_path, log, *more) == 2
    assert f"{log}: cannot be written: {reason} — use .log, .asc or .blf" in capsys.readouterr().err
    assert not log.exists()


def test_error_frames_are_refused_for_a_trc(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario, log = tmp_path / "short.toml", tmp_path / "a.trc"
    scenario.write_text(SCENARIO)
    assert main(["inject", str(scenario), "--fault", FLOOD, "--fast", "--log", str(log)]) == 2
    assert "a .trc takes no error frames, which error-flood sends" in capsys.readouterr().err
    assert not log.exists()


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_formats_that_a_refusal_names_hold_can_fd(suffix: str, tmp_path: Path) -> None:
    logs = []
    for name in ("a.log", f"a{suffix}"):
        assert play(tmp_path, tmp_path / name, "--fast", "--config", str(THIRD_PARTY)) == 0
        logs.append([(f.can_id, f.extended, f.fd, f.data) for f, _ in read_log(tmp_path / name, Damage())])
    assert logs[0] == logs[1]
    assert any(fd for _, _, fd, _ in logs[1])
