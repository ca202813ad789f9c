"""The command line of `wrcd report`."""

from pathlib import Path

import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.story import Ride
from wrcd import resources
from wrcd.cli.main import main
from wrcd.config.config import DEFAULT


def test_report_is_written_and_its_verdict_printed(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "report.html"
    assert main(["report", str(ride.both), "-o", str(out), "--dbc", str(TRUTH_DBC)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == f"{ride.sent.verdict[0].level}: {ride.sent.verdict[0].text}"
    assert shown[-1].startswith(f"{out}: ")
    assert out.read_text().startswith("<!DOCTYPE html>")


def test_report_is_called_report_html(ride: Ride, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["report", str(ride.both)]) == 0
    assert (tmp_path / "report.html").stat().st_size > 100_000


def test_earlier_report_is_overwritten_and_another_file_is_not(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "page.html"
    out.write_text("<html>mine</html>")
    assert main(["report", str(ride.both), "-o", str(out)]) == 2
    assert ": -o: " in capsys.readouterr().err
    assert out.read_text() == "<html>mine</html>"
    assert main(["report", str(ride.both), "-o", str(out), "--force"]) == 0
    assert main(["report", str(ride.both), "-o", str(out)]) == 0


def test_log_is_never_overwritten(ride: Ride, capsys: pytest.CaptureFixture[str]) -> None:
    before = ride.both.read_bytes()
    assert main(["report", str(ride.both), "-o", str(ride.both), "--force"]) == 2
    assert ": -o: " in capsys.readouterr().err
    assert ride.both.read_bytes() == before


@pytest.mark.parametrize("kind", ["log", "json", "toml", "name"])
def test_against_takes_a_log_a_design_or_a_configuration(
    ride: Ride, tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / f"other.{kind}" if kind != "name" else Path("lone-wheelset")
    if kind == "log":
        other.write_bytes(ride.both.read_bytes())
    elif kind == "json":
        other.write_bytes(resources.DESIGN.read_bytes())
    elif kind == "toml":
        other.write_text(DEFAULT)
    out = tmp_path / "two.html"
    assert main(["report", str(ride.both), "--against", str(other), "-o", str(out)]) == 0
    assert "Axle 1: Valid for" in capsys.readouterr().out
    assert out.stat().st_size > 100_000


def test_mistake_in_what_is_compared_comes_before_the_work(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    monkeypatch.setattr("wrcd.logs.story.gather", never)
    out = str(tmp_path / "a.html")
    assert main(["report", str(ride.both), "--against", str(tmp_path / "never.toml"), "-o", out]) == 2
    assert main(["report", str(ride.both), "--against", str(tmp_path / "never.json"), "-o", out]) == 2
    assert capsys.readouterr().err.count("wrcd: error:") == 2


def test_bit_rate_of_the_bus_is_taken_for_its_load(
    ride: Ride, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.html"
    assert main(["report", str(ride.both), "-o", str(out), "--bit-rate", "250000"]) == 0
    assert "Load at an assumed 250 kbit/s" in out.read_text()
    assert main(["report", str(ride.both), "-o", str(out), "--bit-rate", "5"]) == 2
    assert "--bit-rate: " in capsys.readouterr().err
