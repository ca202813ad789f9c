"""A committed candump log of lone wheelsets, and the CSV that a replay of it with their design gives.

A change of the estimate shows here as a readable diff. To accept it:

    .venv/bin/wrcd replay --design lone-wheelset tests/golden/leaf-film.log --csv tests/golden/leaf-film.csv

as a commit of its own that says why.
"""

import csv
from pathlib import Path

import pytest

from wrcd.cli.main import main

FOLDER = Path(__file__).parent
# last digits may differ between processors: hundredths of a percentage point
CLOSE = 0.02
COLUMNS_CLOSE = ("mu_available_pct", "mu_used_pct", "half_width_pp", "low_pct", "high_pct")


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as f:
        return list(csv.DictReader(f))


@pytest.mark.parametrize("log", sorted(FOLDER.glob("*.log")), ids=lambda p: p.stem)
def test_replay_of_a_golden_log_gives_its_csv(log: Path, tmp_path: Path) -> None:
    assert main(["replay", "--design", "lone-wheelset", str(log), "--csv", str(tmp_path / "out.csv")]) == 0
    found, expected = rows(tmp_path / "out.csv"), rows(log.with_suffix(".csv"))
    assert len(found) == len(expected) > 100
    assert list(found[0]) == list(expected[0])
    for got, want in zip(found, expected, strict=True):
        for name, x in got.items():
            y = want[name]
            assert x == y or (name in COLUMNS_CLOSE and x and y and abs(float(x) - float(y)) <= CLOSE), (got, want)
