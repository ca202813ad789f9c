"""`sim-ecu campaign --scheduler`: a scheduler and workers of Dask as real processes."""

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any, cast

import pyarrow.parquet as pq
import pytest
from distributed.scheduler import KilledWorker, WorkerState

from sim_ecu.campaign.campaign_folder import RESULTS, ROWS
from sim_ecu.cli.main import main
from sim_ecu.jobs import cluster, pool
from sim_ecu.jobs.job import Ending
from tests.support.pages import blocks
from tests.support.processes import ROOT, running, wait_for
from tests.support.trial_kind import Write, lines, meanwhile, rows

WAIT_S = 60
# How the page starts them; here with a free port, and each worker by itself and mortal.
(PAGE,) = (b for b in blocks(ROOT / "docs/how-to/run-a-campaign.md") if "dask scheduler" in b.body)
ADDRESS, PORT = "tcp://127.0.0.1:8786", "8786"
SCHEDULER, WORKER = (shlex.split(c.removesuffix("&"))[1:] for c in PAGE.commands[:2])


class Dask:
    """A scheduler, and workers beside it. Files go to folder."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0
        self._workers = ExitStack()
        self._file = folder / "scheduler.json"
        at_any = ["0" if word == PORT else word for word in SCHEDULER]
        with ExitStack() as starting:
            self.scheduler = starting.enter_context(
                _dask(ROOT, *at_any, "--dashboard-address", "127.0.0.1:0", "--scheduler-file", self._file)
            )
            wait_for("the scheduler", WAIT_S, self._file.exists)
            self._scheduler = starting.pop_all()
        self.address = str(json.loads(self._file.read_text())["address"])

    def worker(self, sources: Path = ROOT) -> subprocess.Popen[bytes]:
        """One more."""
        self._count += 1
        folder = self._folder / f"worker{self._count}"
        here = [self.address if word == ADDRESS else word for word in WORKER]
        return self._workers.enter_context(
            _dask(sources, *here, "--nworkers", "1", "--no-nanny", "--local-directory", folder)
        )

    def dismiss(self) -> None:
        """Stop the workers."""
        self._workers.close()

    def close(self) -> None:
        """Stop everything."""
        self.dismiss()
        self._scheduler.close()


def _dask(sources: Path, *arguments: str | Path) -> AbstractContextManager[subprocess.Popen[bytes]]:
    code = f"import sys; sys.path[:0] = [{str(sources)!r}, {str(ROOT)!r}]; from dask.__main__ import main; main()"
    return running(sys.executable, "-c", code, *arguments, stop=signal.SIGKILL)


@pytest.fixture(scope="module")
def started() -> Iterator[list[Dask]]:
    """Schedulers; the last one may be alive."""
    every: list[Dask] = []
    yield every
    for one in every:
        one.close()


@pytest.fixture
def dask(started: list[Dask], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """A scheduler without workers: starting one takes a second or two, so a test leaves it to the next."""
    if not started or started[-1].scheduler.poll() is not None:
        started.append(Dask(tmp_path_factory.mktemp("dask")))
    yield started[-1]
    started[-1].dismiss()


def run(file: Path, folder: Path, *more: str) -> int:
    return main(["campaign", str(file), "-o", str(folder), *more])


def test_workers_that_come_and_die_give_what_the_pool_gives(
    write: Write, tmp_path: Path, dask: Dask, capfd: pytest.CaptureFixture[str]
) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 60", f'record = "{record}"\nwaits_for = "{gate}"\nwaits_from = 31', "x = [1]")

    def come_and_die() -> None:
        wait_for("that it waits", WAIT_S, lambda: "waiting for workers" in capfd.readouterr().err)
        first, _ = dask.worker(), dask.worker()
        wait_for("a job in each", WAIT_S, lambda: (len(rows(out / ROWS)), len(lines(record))) == (30, 32))
        first.kill()
        gate.touch()

    with meanwhile(come_and_die):
        assert run(file, out, "--scheduler", dask.address) == 0
    counts = Counter(line.rpartition(" ")[0] for line in lines(record))
    assert set(counts) == {f"1 {seed}" for seed in range(1, 61)}
    # who holds on to results has all of the first worker's made again, about 15; word that one is let go comes after
    # its row, and may still be on its way for the last ones
    assert sum(counts[f"1 {seed}"] - 1 for seed in range(1, 31)) <= 3
    assert run(file, tmp_path / "pool", "--jobs", "2") == 0
    assert (out / RESULTS).read_bytes() == (tmp_path / "pool" / RESULTS).read_bytes()


def test_jobs_that_do_not_end_well_are_told_and_the_same_rows_on_two_workers_and_the_pool(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    out, pool = tmp_path / "out", tmp_path / "pool"
    file = write("seeds = 3\nlimit_s = 1.5", factor='x = [1]\nact = ["fail", "die", "hang"]')
    dask.worker(), dask.worker()
    assert run(file, out, "--scheduler", dask.address) == run(file, pool, "--jobs", "2") == 1
    assert (out / RESULTS).read_bytes() == (pool / RESULTS).read_bytes()
    names = ("act", "seed", "ending", "error", "sum")
    rows = [tuple(r[name] for name in names) for r in pq.read_table(pool / RESULTS).to_pylist()]
    assert [r for r in rows if r[2] != "done"] == [
        ("fail", 3, "failed", "ValueError: seed 3 at <object object at 0x…>", None),
        ("die", 3, "died", "its process was ended by SIGKILL", None),
        ("hang", 3, "too long", "not done within 1.5 s", None),
    ]
    said = capsys.readouterr().out
    assert said.count("c: 6 of 9 jobs done, 1 failed, 1 took too long, 1 died\n") == 2
    assert said.count("  took too long: x = 1, act = hang, seed = 3: not done within 1.5 s\n") == 2


def test_ctrl_c_leaves_the_workers_to_the_same_command(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 4", f'record = "{record}"\nwaits_for = "{gate}"', "x = [1]")
    dask.worker()

    def end() -> None:
        wait_for("a job at work", WAIT_S, lambda: len(lines(record)) == 1)
        os.kill(os.getpid(), signal.SIGINT)

    with meanwhile(end):
        assert run(file, out, "--scheduler", dask.address) == 130
    assert f"stopped; what is finished is in {out}" in capsys.readouterr().err
    gate.touch()  # the one at work ends by itself
    assert run(file, out, "--scheduler", dask.address) == 0
    assert pq.read_table(out / RESULTS)["ending"].to_pylist() == ["done"] * 4


def test_job_that_killed_workers_is_given_to_no_more_of_them() -> None:
    (found,) = pool.run(abs, [1], pool.Workers(Deadly(), 1))
    assert (found.ending, found.attempts, found.error) == (Ending.DIED, 1, pool.GIVEN_UP)


class Deadly(Executor):
    """Every job kills its workers, as Dask says it."""

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_exception(KilledWorker("a job", cast("WorkerState", None), 3))
        return future


def test_worker_with_other_code_is_refused(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    for package in ("sim_ecu", "wrcd"):
        shutil.copytree(ROOT / package, other / package, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "sim_ecu" / "resources.py").open("a") as file:
        file.write("# another version\n")
    out = tmp_path / "out"
    asked = write("seeds = 4", factor="x = [1]")
    dask.worker(other)
    assert run(asked, out, "--scheduler", dask.address) == 1
    assert "has other sources of wrcd, or other libraries, than are here" in capsys.readouterr().err
    assert not (out / RESULTS).exists()
    assert rows(out / ROWS) == []


def test_scheduler_that_goes_away_is_said_and_the_pool_goes_on(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    gate, out = tmp_path / "gate", tmp_path / "out"
    file = write("seeds = 20", f'waits_for = "{gate}"\nwaits_from = 6', "x = [1]")
    dask.worker()

    def go() -> None:
        wait_for("the rows before it waits", WAIT_S, lambda: len(rows(out / ROWS)) == 5)
        dask.scheduler.kill()
        dask.scheduler.wait(WAIT_S)

    with meanwhile(go):
        assert run(file, out, "--scheduler", dask.address) == 1
    said = capsys.readouterr().err
    assert "the workers are lost: " in said
    assert f"5 rows are in {out}, the same command goes on from there" in said
    gate.touch()
    assert run(file, out) == 0
    assert "20 of 20 jobs done (5 were there)" in capsys.readouterr().out


def test_address_without_a_scheduler_is_told(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.2)
    assert run(write(), tmp_path / "out", "--scheduler", "tcp://127.0.0.1:1") == 2
    assert "--scheduler: tcp://127.0.0.1:1: no scheduler answers there" in capsys.readouterr().err
