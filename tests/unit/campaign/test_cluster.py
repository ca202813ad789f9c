"""`sim-ecu campaign --scheduler`: a scheduler and workers of Dask as real processes, as the page starts them."""

import gc
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import distributed
import pandas as pd
import pytest

from sim_ecu.cli.main import main
from sim_ecu.jobs import pool
from tests.support.pages import run_by
from tests.support.processes import ROOT, running, wait_for
from tests.support.trial_kind import Write, lines, meanwhile, rows
from wrcd.errors import Status

WAIT_S = 300  # ends what hangs; no time is judged by it
# How the page starts them; here with a free port.
(PAGE,) = run_by("tests/unit/campaign/test_cluster.py", "docs/how-to/run-a-campaign.md")
ADDRESS, PORT = "tcp://127.0.0.1:8786", "8786"
SCHEDULER, WORKER = (shlex.split(c.removesuffix("&"))[1:] for c in PAGE.commands[:2])


class Dask:
    """A scheduler, and workers beside it."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count, self._workers = folder, 0, ExitStack()
        file = folder / "scheduler.json"
        at_any = ["0" if word == PORT else word for word in SCHEDULER]
        self._open = _dask(ROOT, *at_any, "--dashboard-address", "127.0.0.1:0", "--scheduler-file", file)
        self.scheduler = self._open.__enter__()
        wait_for("the scheduler", WAIT_S, lambda: file.exists() and file.read_text().endswith("}"))
        self.address = str(json.loads(file.read_text())["address"])

    def workers(self, count: int = 2, sources: Path = ROOT) -> subprocess.Popen[bytes]:
        """So many more, under one process."""
        self._count += 1
        words = [self.address if word == ADDRESS else word for word in WORKER]
        words[words.index("--nworkers") + 1] = str(count)
        folder = self._folder / f"workers{self._count}"
        return self._workers.enter_context(_dask(sources, *words, "--local-directory", folder))

    def dismiss(self) -> None:
        """Stop the workers."""
        self._workers.close()

    def close(self) -> None:
        """Stop everything."""
        self.dismiss()
        self._open.__exit__(None, None, None)


def _dask(sources: Path, *arguments: str | Path) -> AbstractContextManager[subprocess.Popen[bytes]]:
    code = f"import sys; sys.path[:0] = [{str(sources)!r}, {str(ROOT)!r}]; from dask.__main__ import main; main()"
    return running(sys.executable, "-c", code, *arguments)


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


@pytest.mark.night
def test_rows_of_a_scheduler_with_two_workers_are_those_of_this_computer(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    out, here = tmp_path / "out", tmp_path / "here"
    file = write("seeds = 3\nlimit_s = 5", factor='x = [1]\nact = ["", "fail", "die", "hang"]')
    dask.workers()
    assert run(file, out, "--scheduler", dask.address) == run(file, here, "--jobs", "2") == Status.STOPPED
    pd.testing.assert_frame_equal(rows(out), rows(here))
    wrong = rows(out).query("ending != 'done'")
    assert wrong[["act", "seed", "ending"]].drop_duplicates().to_numpy().tolist() == [
        ["die", 3, "died"], ["fail", 3, "failed"], ["hang", 3, "too long"],
    ]  # fmt: skip
    assert capsys.readouterr().out.count("c: 9 of 12 jobs done, 1 failed, 1 too long, 1 died\n") == 2


def test_workers_may_come_later_and_be_killed(
    write: Write, tmp_path: Path, dask: Dask, capfd: pytest.CaptureFixture[str]
) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 20", f'record = "{record}"\nwaits_for = "{gate}"\nwaits_from = 11', "x = [1]")

    def come_and_die() -> None:
        wait_for("that it waits", WAIT_S, lambda: "waiting for workers" in capfd.readouterr().err)
        dask.workers()
        wait_for("a job in each", WAIT_S, lambda: (len(rows(out)), len(lines(record))) == (10, 12))
        os.kill(int(lines(record)[-1].split()[2]), signal.SIGKILL)
        gate.touch()

    with meanwhile(come_and_die):
        assert run(file, out, "--scheduler", dask.address) == Status.DONE
    assert rows(out)["seed"].tolist() == list(range(1, 21))
    counts = Counter(line.rpartition(" ")[0] for line in lines(record))
    assert (len(counts), sum(counts.values())) == (20, 21)


def test_ctrl_c_leaves_the_workers_to_the_same_command(write: Write, tmp_path: Path, dask: Dask) -> None:
    gate, record, out = tmp_path / "gate", tmp_path / "record", tmp_path / "out"
    file = write("seeds = 4", f'record = "{record}"\nwaits_for = "{gate}"', "x = [1]")
    dask.workers(1)

    def end() -> None:
        wait_for("a job at work", WAIT_S, lambda: len(lines(record)) == 1)
        os.kill(os.getpid(), signal.SIGINT)

    with meanwhile(end):
        assert run(file, out, "--scheduler", dask.address) == Status.INTERRUPTED
    gate.touch()  # the one at work ends by itself
    assert run(file, out, "--scheduler", dask.address) == Status.DONE
    assert rows(out)["seed"].tolist() == [1, 2, 3, 4]


def test_worker_with_other_code_is_refused(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    for package in ("sim_ecu", "wrcd"):
        shutil.copytree(ROOT / package, other / package, ignore=shutil.ignore_patterns("__pycache__"))
    with (other / "sim_ecu" / "resources.py").open("a") as file:
        file.write("# another version\n")
    dask.workers(1, other)
    assert run(write("seeds = 4"), tmp_path / "out", "--scheduler", dask.address) == Status.STOPPED
    assert "other sources of wrcd" in capsys.readouterr().err
    assert len(rows(tmp_path / "out")) == 0


@pytest.mark.night
def test_worker_of_several_threads_gets_nothing_and_is_refused_where_there_is_no_other(
    write: Write, tmp_path: Path, dask: Dask, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    record, sound = tmp_path / "record", WORKER
    file = write("seeds = 4", f'record = "{record}"')
    monkeypatch.setattr(sys.modules[__name__], "WORKER", ["2" if w == "1" else w for w in WORKER])
    dask.workers(1)
    assert run(file, tmp_path / "out", "--scheduler", dask.address) == Status.BAD_INPUT
    assert "--scheduler: every worker has several threads" in capsys.readouterr().err
    monkeypatch.setattr(sys.modules[__name__], "WORKER", sound)
    dask.workers(1)
    with pool.cluster(dask.address) as crew:
        wait_for("the other", WAIT_S, lambda: len(crew.client.nthreads()) == 2)
    assert run(file, tmp_path / "out", "--scheduler", dask.address) == Status.DONE
    assert len({line.split()[2] for line in lines(record)}) == 1


@pytest.mark.night
def test_scheduler_that_goes_away_is_said_and_this_computer_goes_on(write: Write, tmp_path: Path, dask: Dask) -> None:
    gate, out = tmp_path / "gate", tmp_path / "out"
    file = write("seeds = 10", f'waits_for = "{gate}"\nwaits_from = 6', "x = [1]")
    dask.workers(1)

    def go() -> None:
        wait_for("the rows before it waits", WAIT_S, lambda: len(rows(out)) == 5)
        dask.scheduler.kill()
        dask.scheduler.wait(WAIT_S)

    command = (sys.executable, "-m", "tests.support.trial_kind", "campaign", file, "-o", out)
    with meanwhile(go):
        done = subprocess.run(
            [*map(str, command), "--scheduler", dask.address],
            cwd=ROOT, capture_output=True, text=True, timeout=WAIT_S, check=False,
        )  # fmt: skip
    assert done.returncode == Status.STOPPED
    assert "the workers are lost: " in done.stderr
    assert done.stderr.endswith("the same command goes on from there\n")
    assert "Traceback" not in done.stderr
    assert len(rows(out)) == 5
    gate.touch()
    assert run(file, out) == Status.DONE
    assert rows(out)["seed"].tolist() == list(range(1, 11))


def test_address_without_a_scheduler_is_told(
    write: Write, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One after the other in a process: what a refused address leaves behind may be collected in the next one's thread,
    as it is here, and must not hold a lock of Dask's there."""
    begin = distributed.utils.asyncio_run

    def collect(*how: Any, **more: Any) -> Any:
        gc.collect()
        return begin(*how, **more)

    monkeypatch.setattr("distributed.utils.asyncio_run", collect)
    monkeypatch.setattr(pool, "CONNECT_S", 0.2)
    for address in ("nonsense", "http://127.0.0.1:1", "tcp://127.0.0.1:1", "tcp://127.0.0.1:2"):
        assert run(write(), tmp_path / "out", "--scheduler", address) == Status.BAD_INPUT
        assert f"--scheduler: {address}: no scheduler answers there" in capsys.readouterr().err
        assert not (tmp_path / "out").exists()
