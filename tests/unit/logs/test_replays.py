"""Several logs at once: each gives what it gives alone."""

import shutil
from pathlib import Path

import pytest

from wrcd.cli.main import main

GOLDEN = Path(__file__).parents[2] / "golden" / "leaf-film.log"


@pytest.fixture
def logs(tmp_path: Path) -> list[Path]:
    first, second = tmp_path / "first.log", tmp_path / "second.log"
    shutil.copy(GOLDEN, first)
    second.write_text("".join(GOLDEN.read_text().splitlines(keepends=True)[:20_000]))
    return [first, second]


@pytest.mark.parametrize("jobs", [1, 2])
def test_several_logs_give_what_each_gives_alone(
    logs: list[Path], jobs: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = {o: tmp_path / o.strip("-") for o in ("--csv", "-o", "--events", "--mf4", "--mcap")}
    named = [str(word) for option in folders.items() for word in option]
    assert main(["replay", *map(str, logs), *named, "--jobs", str(jobs)]) == 0
    said = capsys.readouterr().err
    assert said.index("first.log:") < said.index("second.log:")
    assert said.count("frames read") == 2
    for log in logs:
        alone = {option: tmp_path / f"alone{option}" for option in ("--csv", "-o", "--events")}
        assert main(["replay", str(log), *(str(word) for option in alone.items() for word in option)]) == 0
        for option, suffix in (("--csv", ".csv"), ("-o", ".log"), ("--events", ".events.csv")):
            assert (folders[option] / f"{log.stem}{suffix}").read_bytes() == alone[option].read_bytes()
        for extra in ("mf4", "mcap"):
            assert (folders[f"--{extra}"] / f"{log.stem}.{extra}").stat().st_size > 10_000


def test_one_unreadable_log_fails_alone(logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty.log").write_text("")
    names = [str(tmp_path / "empty.log"), str(logs[1])]
    assert main(["replay", *names, "--csv", str(tmp_path / "csv")]) == 2
    assert "has not one readable frame" in capsys.readouterr().err
    assert len((tmp_path / "csv" / "second.csv").read_text().splitlines()) > 100


def test_output_over_one_of_the_logs_is_an_error(logs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    before = [log.read_bytes() for log in logs]
    assert main(["replay", *map(str, logs), "-o", str(logs[0].parent)]) == 2
    for option in ("-o", "--csv", "--events"):
        assert main(["replay", str(logs[0]), option, str(logs[0])]) == 2
    for extra in ("mf4", "mcap"):
        same = logs[0].with_suffix(f".{extra}")
        same.symlink_to(logs[0])
        assert main(["replay", str(logs[0]), f"--{extra}", str(same)]) == 2
    assert capsys.readouterr().err.count("wrcd: error: ") == 6
    assert [log.read_bytes() for log in logs] == before


def test_two_logs_whose_outputs_are_one_file_are_an_error(
    logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The changes of a.log and the rows of a.events.log."""
    names = [logs[0].rename(tmp_path / "a.log"), logs[1].rename(tmp_path / "a.events.log")]
    out = tmp_path / "out"
    assert main(["replay", *map(str, names), "--csv", str(out), "--events", str(out)]) == 2
    assert f"{out / 'a.events.csv'}: " in capsys.readouterr().err
    assert not out.exists()
