"""`sim-ecu campaign`: what it runs, what it says, and what is left when it is ended."""

import os
import signal
import subprocess
import sys
from collections import Counter
from contextlib import AbstractContextManager
from pathlib import Path

import pandas as pd
import pytest

from sim_ecu.cli.main import main
from sim_ecu.jobs import pool
from sim_ecu.jobs.pool import Workers
from tests.support.processes import ROOT, gone, running, wait_for
from tests.support.trial_kind import Write, lines, meanwhile, rows
from wrcd.errors import Status

RUN = (sys.executable, "-m", "tests.support.trial_kind", "campaign")
WAIT_S = 60


def run(file: Path, folder: Path, *more: str) -> int:
    return main(["campaign", str(file), "-o", str(folder), "--jobs", "2", *more])


def executed(record: Path) -> list[str]:
    """x and seed of every execution that began."""
    return [line.rpartition(" ")[0] for line in lines(record)]


@pytest.mark.usefixtures("jobs_here")
def test_every_job_is_a_row(write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write("title = 'Sums'\nseeds = 3", factor='x = [1, 2]\nmode = ["plain", "fancy"]')
    assert run(file, tmp_path / "out") == Status.DONE
    found = rows(tmp_path / "out").sort_values(["x", "mode", "seed"], ascending=[True, False, True])
    assert list(found[["x", "mode", "seed", "ending", "error", "sum", "even"]].itertuples(index=False, name=None)) == [
        (x, mode, seed, "done", "", x + seed, seed % 2 == 0)
        for x in (1.0, 2.0) for mode in ("plain", "fancy") for seed in (1, 2, 3)
    ]  # fmt: skip
    said = capsys.readouterr()
    assert "Sums: 12 of 12 jobs done\n" in said.out
    assert "sum" in said.out
    assert "12 of 12 jobs, " in said.err


@pytest.mark.usefixtures("jobs_here")
def test_campaign_that_is_extended_runs_the_new_jobs_only(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, out = tmp_path / "record", tmp_path / "out"
    assert run(write("seeds = 2", f'record = "{record}"'), out) == Status.DONE
    capsys.readouterr()
    assert run(write("seeds = 3", f'record = "{record}"', factor="x = [1, 2, 3]"), out) == Status.DONE
    said = [line for line in capsys.readouterr().err.splitlines() if " jobs, " in line]
    assert [(line.split(" jobs")[0], line.split(": ")[1].split(",")[0]) for line in said] == [
        (f"{done} of 9", f"{done / 9:.0%}".replace("%", " %")) for done in range(5, 10)
    ]
    assert Counter(executed(record)) == Counter(f"{x} {seed}" for x in (1, 2, 3) for seed in (1, 2, 3))
    assert len(rows(out)) == 9
    assert run(write("seeds = 1", f'record = "{record}"'), out) == Status.BAD_INPUT  # it would leave rows out
    assert "rows are not asked for" in capsys.readouterr().err
    assert len(rows(out)) == 9


@pytest.mark.usefixtures("jobs_here")
def test_finished_campaign_needs_no_worker(write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, local, crews = tmp_path / "out", pool.local, list[int]()

    def counted(count: int) -> AbstractContextManager[Workers]:
        crews.append(count)
        return local(count)

    monkeypatch.setattr(pool, "local", counted)
    for _ in range(2):
        assert run(write("", factor="x = [1]"), out) == Status.DONE
    assert crews == [1]  # of two that were asked for: there is one job


@pytest.mark.usefixtures("jobs_here")
def test_again_runs_what_did_not_end_well(write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    record, out = tmp_path / "record", tmp_path / "out"
    file = write("seeds = 3", f'record = "{record}"\nact = "fail"', "x = [1]")
    assert run(file, out) == Status.STOPPED
    assert run(file, out) == Status.STOPPED  # it has its row
    assert Counter(executed(record)) == {"1 1": 1, "1 2": 1, "1 3": 2}
    assert run(file, out, "--again") == Status.STOPPED
    assert Counter(executed(record)) == {"1 1": 1, "1 2": 1, "1 3": 4}
    assert rows(out)["ending"].tolist() == ["done", "done", "failed"]
    said = capsys.readouterr().out
    assert "2 of 3 jobs done, 1 failed" in said
    assert "act = fail, x = 1, seed = 3: ValueError: seed 3 at <object object at 0x…>" in said


@pytest.mark.usefixtures("jobs_here")
def test_file_that_is_edited_while_it_runs_fails_the_jobs_that_read_it(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    letters = tmp_path / "letters.txt"
    letters.write_text("abc")
    file = write("seeds = 3", 'file = "letters.txt"', "x = [1]")
    os.utime(letters, ns=(0, 0))
    drop = "sim_ecu.campaign.run_campaign.opened"
    opened = sys.modules["sim_ecu.campaign.run_campaign"].opened

    def edited(*arguments: object) -> object:
        letters.write_text("abcd")
        return opened(*arguments)

    monkeypatch.setattr(drop, edited)
    assert run(file, tmp_path / "out") == Status.STOPPED
    found = rows(tmp_path / "out")
    assert set(found["ending"]) == {"failed"}
    assert found["error"][0].startswith("letters.txt: is not as it was")


def test_dry_run_says_what_would_run_and_makes_nothing(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write("seeds = 4", factor='x = { from = 1, to = 8, steps = 4, log = true }\nmode = ["plain", "fancy"]')
    assert main(["campaign", str(file), "-o", str(tmp_path / "out"), "--dry-run"]) == Status.DONE
    assert capsys.readouterr().out.splitlines() == [
        "c: 32 jobs of kind trial",
        "  x: 1.0, 2.0, 4.0, 8.0",
        "  mode: plain, fancy",
        "  seed: 1, 2, 3, 4",
        "columns: key, x, mode, seed, ending, error, sum, letters, even",
    ]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{file}"], "-o: is missing"),
        ([], "CAMPAIGN.toml: is missing"),
        (["{file}", "-o", "{dir}/out", "--jobs", "0"], "--jobs: takes a whole number from 1 on, not 0"),
        (["{file}", "-o", "{dir}/out", "--train", "x"], "--train: is of --logs"),
        (["{file}", "--logs", ".", "-o", "{dir}/out"], "CAMPAIGN.toml: and --logs"),
        (["never.toml", "-o", "{dir}/out"], "never.toml: no such file"),
        (["{file}", "-o", "{file}"], "c.toml: cannot be written"),
        (["{file}", "-o", "{dir}"], "is no campaign's folder, and not empty"),
    ],
)
def test_bad_argument_is_named(
    write: Write, tmp_path: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write()
    status = main(["campaign", *(a.format(file=file, dir=tmp_path) for a in arguments)])
    assert status in (Status.BAD_INPUT, Status.NOT_THERE)
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_campaign_that_is_killed_goes_on_and_no_run_is_missing_or_twice(write: Write, tmp_path: Path) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 30", f'record = "{record}"\nwaits_for = "{gate}"\nwaits_from = 21', "x = [1]")
    with running(*RUN, file, "-o", out, "--jobs", "2") as process:
        wait_for("two that wait", WAIT_S, lambda: (len(rows(out)), len(lines(record))) == (20, 22))
        process.kill()
        process.wait(WAIT_S)
    begun = {int(line.split()[2]) for line in lines(record)}
    wait_for("that no process is left", WAIT_S, lambda: all(gone(pid) for pid in begun))
    assert rows(out)["seed"].tolist() == list(range(1, 21))
    gate.touch()
    assert run(file, out) == Status.DONE
    counts = Counter(executed(record))
    assert {job for job, count in counts.items() if count == 2} == {"1 21", "1 22"}  # they were at work
    assert (len(counts), sum(counts.values())) == (30, 32)
    assert run(file, tmp_path / "undisturbed") == Status.DONE
    pd.testing.assert_frame_equal(rows(out), rows(tmp_path / "undisturbed"))


@pytest.mark.night
def test_worker_that_is_killed_loses_nothing(write: Write, tmp_path: Path) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 12", f'record = "{record}"\nwaits_for = "{gate}"\nwaits_from = 7', "x = [1]")

    def kill() -> None:
        wait_for("two that wait", WAIT_S, lambda: (len(rows(out)), len(lines(record))) == (6, 8))
        os.kill(int(lines(record)[-1].split()[2]), signal.SIGKILL)
        gate.touch()

    with meanwhile(kill):
        assert run(file, out) == Status.DONE
    assert rows(out)["seed"].tolist() == list(range(1, 13))
    counts = Counter(executed(record))
    assert (len(counts), sum(counts.values())) == (12, 13)


@pytest.mark.night
def test_runs_that_die_or_hang_are_named_and_the_campaign_goes_on(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(write("seeds = 4\nlimit_s = 5", factor='x = [1]\nact = ["die", "hang"]'), out) == Status.STOPPED
    found = rows(out)
    assert found["ending"].tolist() == ["done", "done", "died", "done", "done", "done", "too long", "done"]
    said = capsys.readouterr().out
    assert "6 of 8 jobs done, 1 too long, 1 died\n" in said
    assert "  too long: x = 1, act = hang, seed = 3: not done within 5 s\n" in said


@pytest.mark.night
@pytest.mark.parametrize("signal_", [signal.SIGINT, signal.SIGTERM])
def test_signal_ends_it_and_the_same_command_goes_on(
    write: Write, tmp_path: Path, signal_: signal.Signals, capsys: pytest.CaptureFixture[str]
) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 4", f'waits_for = "{gate}"\nrecord = "{record}"')

    def end() -> None:
        wait_for("two jobs at work", WAIT_S, lambda: len(lines(record)) == 2)
        os.kill(os.getpid(), signal_)

    with meanwhile(end):
        assert run(file, out) == Status.INTERRUPTED
    assert f"stopped; what is finished is in {out}, the same command goes on from there" in capsys.readouterr().err
    assert all(gone(int(line.split()[2])) for line in lines(record))
    assert {f.name for f in out.rglob("*")} <= {"campaign.json", "lock", "rows"}
    gate.touch()
    assert run(file, out) == Status.DONE
    assert len(rows(out)) == 8


@pytest.mark.night
def test_full_disk_is_said_and_the_same_command_goes_on(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    file = write("seeds = 3", factor="x = [1]")
    full = subprocess.run(  # no file beyond 1 KiB: a description, but no rows; nor half a module for later programs
        ["bash", "-c", 'ulimit -f 1; exec "$@"', "bash", *RUN, str(file), "-o", str(out), "--jobs", "1"],
        cwd=ROOT, capture_output=True, text=True, timeout=WAIT_S, check=False,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert full.returncode == Status.STOPPED
    assert "cannot be written" in full.stderr
    assert "Traceback" not in full.stderr
    assert len(rows(out)) == 0
    assert list(out.rglob(".*")) == []  # nothing half-written
    assert run(file, out) == Status.DONE
    assert len(rows(out)) == 3
