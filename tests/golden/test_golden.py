"""A committed candump log of lone wheelsets, and the CSV that a replay of it with their design gives.

A change of the estimate shows here as a readable diff. To accept it:

    .venv/bin/wrcd replay --design lone-wheelset tests/golden/leaf-film.log --csv tests/golden/leaf-film.csv

as a commit of its own that says why.
"""

import csv
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.scenarios import FOUR_AXLES, LogOf
from wrcd import native
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

FOLDER = Path(__file__).parent
# last digits may differ between processors: hundredths of a percentage point
CLOSE = 0.02
COLUMNS_CLOSE = ("mu_available_pct", "mu_used_pct", "half_width_pp", "low_pct", "high_pct")


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as f:
        return list(csv.DictReader(f))


@pytest.mark.parametrize("log", sorted(FOLDER.glob("*.log")), ids=lambda p: p.stem)
@pytest.mark.usefixtures("engine")
def test_replay_of_a_golden_log_gives_its_csv(log: Path, tmp_path: Path) -> None:
    assert main(["replay", "--design", "lone-wheelset", str(log), "--csv", str(tmp_path / "out.csv")]) == 0
    found, expected = rows(tmp_path / "out.csv"), rows(log.with_suffix(".csv"))
    assert len(found) == len(expected) > 100
    assert list(found[0]) == list(expected[0])
    for got, want in zip(found, expected, strict=True):
        for name, x in got.items():
            y = want[name]
            assert x == y or (name in COLUMNS_CLOSE and x and y and abs(float(x) - float(y)) <= CLOSE), (got, want)


def sent(log: Path, design: str, out: Path) -> list[Frame]:
    """The frames of a replay, but for which estimator ran and that frame's checksum."""
    assert main(["replay", "--design", design, str(log), "-o", str(out)]) == 0
    frames = [f for f, _ in read_log(out, Damage())]
    return [replace(f, data=bytes([0, f.data[1] & 0x3F, *f.data[2:]])) if f.can_id == 0x0B0 else f for f in frames]


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize("design", ["lone-wheelset", "multiple-unit"])
def test_engines_send_the_same_bytes(
    design: str, log_of: LogOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = FOLDER / "leaf-film.log" if design == "lone-wheelset" else log_of(FOUR_AXLES)
    compiled = sent(log, design, tmp_path / "compiled.log")
    assert "the reference in numpy runs" not in capsys.readouterr().err
    monkeypatch.setenv("WRCD_ENGINE", "reference")
    native._found.cache_clear()
    try:
        reference = sent(log, design, tmp_path / "reference.log")
    finally:
        native._found.cache_clear()
    assert "the reference in numpy runs" in capsys.readouterr().err
    assert reference == compiled
    assert len(compiled) > 1000
    assert (tmp_path / "reference.log").read_bytes() != (tmp_path / "compiled.log").read_bytes()  # WrcdStatus.Engine
