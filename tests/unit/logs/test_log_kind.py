"""Logs whose name says another thing than their content, and what is no log at all."""

import contextlib
import gzip
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from wrcd.cli.main import main
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log, read_stretches

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"
ASC = b"""date Sun Nov 22 14:07:10.381 2026
base hex  timestamps %s
internal events logged
Begin Triggerblock Tue Nov 14 22:13:20.5 2023
 0.000000 Start of measurement
 0.004800 1  300             Rx   d 8 11 5A 00 E6 00 00 00 00
 0.000200 1  310             Rx   d 8 00 86 00 E3 20 00 00 00
End TriggerBlock
"""


def made(suffix: str, folder: Path) -> bytes:
    """A small log of that format."""
    path = folder / f"made{suffix}"
    if suffix == ".mf4":
        return b"MDF     4.10    " + bytes(48)
    if suffix == ".db":
        return b"SQLite format 3\0" + bytes(84)
    if suffix == ".log":
        return b"".join(GOLDEN.read_bytes().splitlines(keepends=True)[:9])
    with can.Logger(path) as logger:
        for k in range(9):
            logger.on_message_received(can.Message(timestamp=1.7e9 + k, arbitration_id=k, data=bytes(8)))
    return path.read_bytes()


LOOKS = {
    ".blf": "a BLF, Vector's binary log",
    ".asc": "an ASC, Vector's text log",
    ".trc": "a TRC, PEAK's text log",
    ".log": "a candump log",
    ".mf4": "an ASAM MDF",
    ".db": "an SQLite database",
}


@pytest.mark.parametrize("named", [*LOOKS, ".csv", ".txt"])
@pytest.mark.parametrize("suffix", LOOKS)
def test_log_named_as_another_format_is_refused_with_what_it_looks_like(
    suffix: str, named: str, tmp_path: Path
) -> None:
    if suffix == named:
        return
    log = tmp_path / f"a{named}"
    log.write_bytes(made(suffix, tmp_path))
    said = (
        f"{log}: looks like {LOOKS[suffix]}, {named} says otherwise — the suffix tells the format: rename it to end in "
        f"{suffix}"
    )
    for reader in (read_log, read_stretches):
        with pytest.raises(InputError) as e:
            list(reader(log, Damage()))
        assert str(e.value) == said


@pytest.mark.parametrize(
    ("name", "pack", "said"),
    [
        ("a.log", gzip.compress, "looks like a candump log packed by gzip, .log says otherwise"),
        ("a.asc.gz", gzip.compress, "looks like a candump log packed by gzip, .asc.gz says otherwise"),
        ("a.log.gz", bytes, "looks like a candump log, .log.gz says otherwise"),
        ("a", bytes, "looks like a candump log, its name says otherwise"),
    ],
)
def test_packing_that_the_name_does_not_tell_is_refused(
    name: str, pack: Callable[[bytes], bytes], said: str, tmp_path: Path
) -> None:
    log = tmp_path / name
    log.write_bytes(pack(GOLDEN.read_bytes()))
    with pytest.raises(InputError, match=said):
        next(read_log(log, Damage()))


@pytest.mark.parametrize("suffix", [".log", ".asc", ".trc", ".csv", ".blf"])
def test_damaged_begin_is_left_to_the_reader(suffix: str, tmp_path: Path) -> None:
    log = tmp_path / f"a{suffix}"
    log.write_bytes(b"\x00\xff rubbish\n" * 9)
    with pytest.raises(InputError) as e:
        list(read_log(log, Damage()))
    assert "looks like" not in str(e.value)


def test_asc_with_stamps_from_line_to_line_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a.asc"
    log.write_bytes(ASC % b"absolute")
    assert len(list(read_log(log, Damage()))) == 2
    for kind in (b"relative", b"Relative"):
        log.write_bytes(ASC % kind)
        assert main(["replay", str(log), "--csv", str(tmp_path / "a.csv")]) == 2
        said = capsys.readouterr().err
        assert "each of its stamps counts from the line before (timestamps relative)" in said
        assert "export it again with absolute timestamps" in said
        assert not (tmp_path / "a.csv").exists()


def test_cut_database_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a.db"
    with contextlib.closing(sqlite3.connect(log)) as file, file:  # as python-can lays it out
        file.execute(
            "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, "
            "dlc INTEGER, data BLOB)"
        )
        rows = [(1.7e9 + k * 0.005, k, 0, 0, 0, 8, bytes(8)) for k in range(2000)]
        file.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    assert len(list(read_log(log, Damage()))) == len(rows)
    log.write_bytes(log.read_bytes()[:-5000])
    assert main(["replay", str(log)]) == 2
    assert f"{log}: cannot be read as .db: database disk image is malformed" in capsys.readouterr().err


def test_readers_write_no_raw_lines_to_the_terminal(tmp_path: Path) -> None:
    log = tmp_path / "a.trc"
    lines = made(".trc", tmp_path).splitlines(keepends=True)
    log.write_bytes(b"".join((*lines[:-2], b"rubbish of a line\n", *lines[-2:])))
    done = subprocess.run(
        [sys.executable, "-m", "wrcd.cli", "dump", str(log)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    (said,) = done.stderr.splitlines()
    assert "1 damaged line left out" in said
