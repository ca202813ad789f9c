"""`sim-ecu campaign`: what it runs, what it says, and what is left when it is ended."""

import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sim_ecu.campaign.campaign_folder import RESULTS, ROWS
from sim_ecu.cli.main import main
from tests.support.processes import ROOT, running, wait_for
from tests.support.trial_kind import Write, lines, meanwhile, rows

RUN = (sys.executable, "-m", "tests.support.trial_kind", "campaign")
WAIT_S = 60


def run(file: Path, folder: Path, *more: str) -> int:
    return main(["campaign", str(file), "-o", str(folder), "--jobs", "2", *more])


def executed(record: Path) -> list[str]:
    """x and seed of every execution that began."""
    return [line.rpartition(" ")[0] for line in lines(record)]


def columns(folder: Path, *names: str) -> list[tuple[object, ...]]:
    table = pq.read_table(folder / RESULTS)
    return list(zip(*(table[name].to_pylist() for name in names), strict=True))


@pytest.mark.usefixtures("jobs_here")
def test_every_job_is_a_row_in_the_order_of_the_file(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write("title = 'Sums'\nseeds = 3", factor='x = [1, 2]\nmode = ["plain", "fancy"]')
    assert run(file, tmp_path / "out") == 0
    rows = columns(tmp_path / "out", "x", "mode", "seed", "ending", "error", "sum", "even")
    assert rows == [
        (x, mode, seed, "done", "", x + seed, seed % 2 == 0)
        for x in (1.0, 2.0) for mode in ("plain", "fancy") for seed in (1, 2, 3)
    ]  # fmt: skip
    said = capsys.readouterr()
    assert "Sums: 12 of 12 jobs done\n" in said.out
    assert "| sum | m | 3.5 (3 … 4) | 3.5 (3 … 4) |" in said.out
    assert f"results: {tmp_path / 'out' / RESULTS}" in said.out
    assert "12 of 12 jobs, " in said.err


@pytest.mark.usefixtures("jobs_here")
def test_campaign_that_is_extended_runs_the_new_jobs_only_and_counts_those_that_were_there(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record, out = tmp_path / "record", tmp_path / "out"
    assert run(write("seeds = 2", f'record = "{record}"'), out) == 0
    capsys.readouterr()
    assert run(write("seeds = 3", f'record = "{record}"', factor="x = [1, 2, 3]"), out) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if " jobs, " in line]
    assert [(line.split(" jobs")[0], line.split(": ")[1].split(",")[0]) for line in said] == [
        (f"{done} of 9", f"{done / 9:.0%}".replace("%", " %")) for done in range(5, 10)
    ]
    assert Counter(executed(record)) == Counter(f"{x} {seed}" for x in (1, 2, 3) for seed in (1, 2, 3))
    assert len(columns(out, "key")) == 9
    assert run(write("seeds = 1", f'record = "{record}"'), out) == 0  # of fewer: what it asks for
    assert (len(columns(out, "key")), len(executed(record))) == (2, 9)


def test_again_runs_what_did_not_end_well(write: Write, tmp_path: Path) -> None:
    wanted, out = tmp_path / "wanted.txt", tmp_path / "out"
    record = tmp_path / "record"
    file = write("seeds = 2", f'waits_for = "{wanted}"\nrecord = "{record}"\n', "x = [1]")
    file.write_text(f"limit_s = 1\n{file.read_text()}")
    assert run(file, out) == 1
    wanted.touch()
    assert run(file, out) == 1  # they have their rows
    assert len(executed(record)) == 2
    assert run(file, out, "--again") == 0
    assert columns(out, "ending") == [("done",), ("done",)]
    assert len(executed(record)) == 4


def test_dry_run_says_what_would_run_and_makes_nothing(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write("seeds = 4", factor='x = { from = 1, to = 8, steps = 4, log = true }\nmode = ["plain", "fancy"]')
    assert main(["campaign", str(file), "-o", str(tmp_path / "out"), "--dry-run"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "c: 32 jobs of kind trial: adds up",
        "  x     1 … 8, 4 steps, by its logarithm",
        "  mode  plain, fancy",
        "  seed  1 … 4",
        "columns: key, x, mode, seed, ending, error, sum, letters, even",
    ]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{file}"], "-o: is missing"),
        (["{file}", "-o", "{dir}/out", "--jobs", "0"], "--jobs: takes a whole number from 1 on, not 0"),
        (["never.toml", "-o", "{dir}/out"], "never.toml: no such file"),
        (["{file}", "-o", "{file}"], "c.toml: cannot be written"),
        (["{file}", "-o", "{dir}"], "is no campaign's folder, and not empty"),
        (["{file}", "-o", "{dir}/out", "--scheduler", "nonsense"], "--scheduler: nonsense: takes tcp://HOST:PORT"),
    ],
)
def test_bad_argument_is_named(
    write: Write, tmp_path: Path, arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file = write()
    assert main(["campaign", *(a.format(file=file, dir=tmp_path) for a in arguments)]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_campaign_that_is_killed_runs_no_finished_job_twice(write: Write, tmp_path: Path) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 60", f'record = "{record}"\nwaits_for = "{gate}"\nwaits_from = 41', "x = [1]")
    with running(*RUN, file, "-o", out, "--jobs", "2") as process:
        wait_for("two that wait", WAIT_S, lambda: (len(rows(out / ROWS)), len(lines(record))) == (40, 42))
        process.kill()
        process.wait(WAIT_S)
    begun = {Path(f"/proc/{line.split()[2]}") for line in lines(record)}
    wait_for("that no process is left", WAIT_S, lambda: not any(p.exists() for p in begun))
    finished = {f"1 {row['sum'] - 1:.0f}" for row in rows(out / ROWS)}
    assert finished == {f"1 {seed}" for seed in range(1, 41)}
    gate.touch()
    assert run(file, out) == 0
    counts = Counter(executed(record))
    assert {job for job, count in counts.items() if count == 2} == {"1 41", "1 42"}  # they were at work
    assert (len(counts), sum(counts.values())) == (60, 62)
    assert run(file, tmp_path / "undisturbed") == 0
    assert (out / RESULTS).read_bytes() == (tmp_path / "undisturbed" / RESULTS).read_bytes()


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
        assert run(file, out) == 130
    assert f"stopped; what is finished is in {out}, the same command goes on from there" in capsys.readouterr().err
    assert not (out / RESULTS).exists()
    for line in lines(record):
        assert not Path(f"/proc/{line.split()[2]}").exists()
    gate.touch()
    assert run(file, out) == 0
    assert len(columns(out, "key")) == 8


def test_full_disk_is_said_and_the_same_command_goes_on(write: Write, tmp_path: Path) -> None:
    out = tmp_path / "out"
    file = write("seeds = 50", factor="x = [1]")
    full = subprocess.run(  # no file beyond 64 KiB
        ["bash", "-c", 'ulimit -f 64; exec "$@"', "bash", *RUN, str(file), "-o", str(out)],
        cwd=ROOT, capture_output=True, text=True, timeout=WAIT_S, check=False,
    )  # fmt: skip
    assert full.returncode == 1
    assert "a row cannot be written: disk I/O error — make room; the same command goes on from there" in full.stderr
    assert "Traceback" not in full.stderr
    assert 0 < len(rows(out / ROWS)) < 50
    assert run(file, out) == 0
    assert len(columns(out, "key")) == 50


def test_file_that_is_edited_while_it_runs_stops_it(
    write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gate, record, letters = tmp_path / "gate", tmp_path / "record", tmp_path / "letters.txt"
    letters.write_text("abc")
    file = write("seeds = 40", f'waits_for = "{gate}"\nrecord = "{record}"\nfile = "letters.txt"', "x = [1]")

    def edit() -> None:
        wait_for("two jobs at work", WAIT_S, lambda: len(lines(record)) == 2)
        letters.write_text("abcd")
        gate.touch()

    with meanwhile(edit):
        assert run(file, tmp_path / "out") == 1
    assert "letters.txt" in (said := capsys.readouterr().err)
    assert "is not as it was here when the campaign began" in said
    assert rows(tmp_path / "out" / ROWS) == []  # what they read may be either
