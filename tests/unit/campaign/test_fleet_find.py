"""Which logs a fleet has, whose each is, with which configuration."""

from pathlib import Path

import pytest

from sim_ecu.campaign.fleet.find import find
from wrcd.errors import InputError


def made(folder: Path, *names: str, text: str = "") -> Path:
    for name in names:
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return folder


def test_folder_gives_every_log_below_it_and_nothing_else(tmp_path: Path) -> None:
    logs = ("7401/a.log", "7401/2026/b.blf", "7402/c.log.gz", "7402/d.MF4", "e.trc")
    made(tmp_path, *logs, "7401/a.state.json", "7401/.hidden/x.log", "7401/.y.log", "7402/report.html", "wrcd.toml")
    made(tmp_path, "7402/a.events.csv", text="time_s,axle,from\n")
    made(tmp_path, "7402/frames.csv", text="timestamp,arbitration_id,extended,remote,error,dlc,data\n")
    assert {one.name for one in find(str(tmp_path), None, None).logs} == {*logs, "7402/frames.csv"}


def test_database_that_is_no_log_is_left_out(tmp_path: Path) -> None:
    made(tmp_path, "7401/Thumbs.db")
    made(tmp_path, "7401/a.db", text="SQLite format 3\0")
    assert [one.name for one in find(str(tmp_path), None, None).logs] == ["7401/a.db"]


def test_train_is_the_first_folder_below(tmp_path: Path) -> None:
    folder = made(tmp_path / "fleet", "7402/a.log", "7401/2026/11/b.log", "c.log")
    assert [(one.train, one.name) for one in find(str(folder), None, None).logs] == [
        ("7401", "7401/2026/11/b.log"), ("7402", "7402/a.log"), ("fleet", "c.log"),
    ]  # fmt: skip


def test_train_is_what_the_pattern_finds(tmp_path: Path) -> None:
    made(tmp_path, "2026/T7401_a.log", "2026/T7402_b.log", "2027/T7401_c.log")
    assert find(str(tmp_path), r"/T(?P<train>\d+)_", None).trains == {"7401": 2, "7402": 1}


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ("(", "no regular expression"),
        ("T(.*)_", "no group called train"),
        ("X(?P<train>.*)", "no train in 2026/T1.log"),
    ],
)
def test_pattern_that_finds_no_train_is_refused(tmp_path: Path, pattern: str, said: str) -> None:
    made(tmp_path, "2026/T1.log")
    with pytest.raises(InputError, match=said):
        find(str(tmp_path), pattern, None)


def test_glob_gives_what_it_matches_by_the_folder_before_it(tmp_path: Path) -> None:
    made(tmp_path, "7401/ride-1.log", "7401/other.log", "7402/ride-2.log")
    found = find(f"{tmp_path}/*/ride-*.log", None, None)
    assert found.folder == tmp_path
    assert [(one.train, one.name) for one in found.logs] == [("7401", "7401/ride-1.log"), ("7402", "7402/ride-2.log")]


def test_glob_that_meets_a_log_twice_gives_it_once(tmp_path: Path) -> None:
    made(tmp_path, "7401/2026/a.log")
    assert len(find(f"{tmp_path}/**/**/*.log", None, None).logs) == 1


def test_nearest_configuration_above_a_log_is_its_own(tmp_path: Path) -> None:
    made(tmp_path, "fleet/7401/2026/a.log", "fleet/7401/wrcd.toml", "fleet/7402/b.log", "wrcd.toml")
    given = tmp_path / "given.toml"
    found = {one.train: one.configuration for one in find(str(tmp_path / "fleet"), None, given).logs}
    assert found == {"7401": tmp_path / "fleet/7401/wrcd.toml", "7402": given}


@pytest.mark.parametrize(("asked", "said"), [("", "has no log"), ("none", "no such folder"), ("*/*.blf", "has no log")])
def test_no_log_is_an_error(tmp_path: Path, asked: str, said: str) -> None:
    made(tmp_path, "7401/notes.txt")
    with pytest.raises(InputError, match=said):
        find(str(tmp_path / asked), None, None)
