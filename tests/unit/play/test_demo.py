"""`sim-ecu demo` in real time on python-can's virtual bus."""

from pathlib import Path

import pytest

from sim_ecu.cli import main
from tests.support.scenarios import held


def test_the_demo_shows_the_estimate_and_leaves_log_and_picture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "wet.toml").write_text(held("C", 4.0))
    arguments = ["demo", "-i", "virtual", "-c", "test", "--scenario", str(tmp_path / "wet.toml"), "-o", str(tmp_path)]
    assert main(arguments) == 0
    said = capsys.readouterr().out
    assert said.count(" s A1 |") >= 5
    assert " Valid " in said
    assert "percentage points" in said
    assert (tmp_path / "wet.log").read_text().count(" 091#") > 100
    assert (tmp_path / "wet.png").read_bytes().startswith(b"\x89PNG")
