"""A committed candump log and the CSV that a replay of it gives.

A change of the estimate shows here as a readable diff. To accept it:

    .venv/bin/wrcd replay tests/golden/leaf-film.log --csv tests/golden/leaf-film.csv

as a commit of its own that says why.
"""

from pathlib import Path

import pytest

from wrcd.tools.cli import main

FOLDER = Path(__file__).parent
# last digits may differ between processors: hundredths of a percentage point
CLOSE = 0.02
COLUMNS_CLOSE = (3, 4)


@pytest.mark.parametrize("log", sorted(FOLDER.glob("*.log")), ids=lambda p: p.stem)
def test_replay_of_a_golden_log_gives_its_csv(log: Path, tmp_path: Path) -> None:
    assert main(["replay", str(log), "--csv", str(tmp_path / "out.csv")]) == 0
    found = (tmp_path / "out.csv").read_text().splitlines()
    expected = log.with_suffix(".csv").read_text().splitlines()
    assert len(found) == len(expected) > 100
    for got, want in zip(found, expected, strict=True):
        if got != want:
            a, b = got.split(","), want.split(",")
            for i, (x, y) in enumerate(zip(a, b, strict=True)):
                assert x == y or (i in COLUMNS_CLOSE and x and y and abs(float(x) - float(y)) <= CLOSE), (got, want)
