"""`sim-ecu campaign --logs`: a fleet's logs as rows and as a page."""

import gzip
import os
import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sim_ecu.cli.main import main
from tests.support.fleet import ONE_AXLE, SOUND, with_fault
from tests.support.scenarios import LogOf

BROKEN = "7402/broken.log"


def campaign(*arguments: str | Path) -> int:
    return main(["campaign", *map(str, arguments)])


@pytest.fixture(scope="module")
def fleet(log_of: LogOf, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two trains. The second has a configuration of its own, of one axle, and a log that is none."""
    folder = tmp_path_factory.mktemp("fleet")
    for train in ("7401", "7402"):
        (folder / train).mkdir()
    sound, reversed_gyro = log_of(SOUND), log_of(with_fault("reverse", 2, 4.0))
    (folder / "7401/a.log").write_bytes(sound.read_bytes())
    (folder / "7401/b.log").write_bytes(reversed_gyro.read_bytes())
    (folder / "7402/a.log.gz").write_bytes(gzip.compress(sound.read_bytes()))
    (folder / "7402/wrcd.toml").write_text(ONE_AXLE)
    (folder / BROKEN).write_text("no log at all\n")
    return folder


@pytest.fixture(scope="module")
def out(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The fleet's results."""
    folder = tmp_path_factory.mktemp("out") / "fleet"
    assert campaign("--logs", fleet, "-o", folder, "--jobs", "1") == 1  # for the broken one
    return folder


def test_every_log_is_a_row(out: Path) -> None:
    rows = {r["log"]: r for r in pq.read_table(out / "results.parquet").to_pylist()}
    assert {name: (r["train"], r["ending"]) for name, r in rows.items()} == {
        "7401/a.log": ("7401", "done"), "7401/b.log": ("7401", "done"), "7402/a.log.gz": ("7402", "done"),
        BROKEN: ("7402", "failed"),
    }  # fmt: skip
    assert "not one readable frame" in rows[BROKEN]["error"]
    assert rows[BROKEN]["valid"] is None
    assert (rows["7401/a.log"]["axles"], rows["7402/a.log.gz"]["axles"]) == (2, 1)
    assert rows["7402/a.log.gz"]["configuration"] == "7402/wrcd.toml"
    assert (rows["7401/a.log"]["suspects"], rows["7401/b.log"]["suspects"]) == (0, 1)


def test_second_go_replays_nothing(fleet: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = {name: (out / name).read_bytes() for name in ("results.parquet", "times.parquet", "summary.html")}
    assert campaign("--logs", fleet, "-o", out) == 1
    assert {name: (out / name).read_bytes() for name in before} == before
    said = capsys.readouterr().out
    assert "| 7401 | 2 |" in said
    assert "suspicious: 7401 axle 2: GyroReversed" in said
    assert f"failed: {BROKEN}: has not one readable frame" in said


def test_other_trains_need_no_replay(fleet: Path, out: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(out, again)
    assert campaign("--logs", fleet, "-o", again, "--train", r"(?P<train>\w+)\.log") == 1
    rows = {r["log"]: r["train"] for r in pq.read_table(again / "results.parquet").to_pylist()}
    assert rows == {"7401/a.log": "a", "7402/a.log.gz": "a", "7401/b.log": "b", BROKEN: "broken"}
    assert sorted(pq.read_table(again / "times.parquet")["seconds"].to_pylist()) == sorted(
        pq.read_table(out / "times.parquet")["seconds"].to_pylist()
    )


@pytest.mark.usefixtures("jobs_here")
def test_log_whose_name_is_no_text_is_a_row_with_its_error(
    log_of: LogOf, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for train in (b"a", b"b\xff"):
        folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/logs/" + train))
        folder.mkdir(parents=True)
        (folder / "x.log").write_bytes(log_of(SOUND).read_bytes())
        (folder / "wrcd.toml").write_text(ONE_AXLE)
    assert campaign("--logs", tmp_path / "logs", "-o", tmp_path / "out", "--jobs", "1") == 1
    rows = pq.read_table(tmp_path / "out/results.parquet").to_pylist()
    assert [(r["train"], r["ending"]) for r in rows] == [("a", "done"), ("b\\xff", "failed")]
    assert "failed: b\\xff/x.log: has a name that is no UTF-8" in capsys.readouterr().out


def test_page_has_what_is_suspicious_first_and_the_command_of_a_report_where_there_is_none(
    fleet: Path, out: Path
) -> None:
    text = (out / "summary.html").read_text()
    places = [text.index(word) for word in ("<h1>", "GyroReversed", "not one readable frame", 'id="train1"')]
    assert places == sorted(places)
    assert "http" not in text.replace("http-equiv", "")
    command = "wrcd report 7402/a.log.gz --replay -o a.log.gz.html --config 7402/wrcd.toml"
    assert f"<code>cd {fleet} &amp;&amp; {command}</code>" in text


@pytest.mark.usefixtures("jobs_here")
def test_reports_are_made_once_and_linked(fleet: Path, tmp_path: Path) -> None:
    only, made = f"{fleet}/7402/a.*", tmp_path / "out/reports/a.log.gz.html"
    assert campaign("--logs", only, "-o", tmp_path / "out", "--reports", "--jobs", "1") == 0
    assert 'content="wrcd report"' in made.read_text()
    assert '<a href="reports/a.log.gz.html">' in (tmp_path / "out/summary.html").read_text()
    os.utime(made, ns=(made.stat().st_mtime_ns + 10**9,) * 2)
    stamp = made.stat().st_mtime_ns
    assert campaign("--logs", only, "-o", tmp_path / "out", "--reports", "--jobs", "1") == 0
    assert made.stat().st_mtime_ns == stamp


def test_dry_run_says_what_would_run(fleet: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert campaign("--logs", fleet, "--dry-run", "--train", r"(?P<train>\w+)\.log") == 0
    assert capsys.readouterr().out.splitlines() == ["4 logs of 3 trains", "  a: 2", "  b: 1", "  broken: 1"]


def test_configuration_with_a_mistake_is_told_before_anything_runs(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / "wrong.toml"
    wrong.write_text("[vehicel]\n")
    assert campaign("--logs", fleet, "--config", wrong, "-o", tmp_path / "out") == 2
    assert "wrong.toml:1: vehicel" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("-o", "out"), "CAMPAIGN.toml: is missing"),
        (("x.toml", "--logs", ".", "-o", "out"), "two questions"),
        (("x.toml", "--train", "x", "-o", "out"), "--train: is of --logs"),
        (("--logs", ".", "--limit", "0", "-o", "out"), "--limit: takes more than 0 s"),
        (("--logs", "."), "-o: is missing"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    arguments: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert campaign(*arguments) == 2
    assert said in capsys.readouterr().err
