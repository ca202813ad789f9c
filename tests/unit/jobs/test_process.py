"""A process for jobs: what ends it, what it may find, and when its time begins."""

import colorsys
import os
import resource
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.jobs import process as process_module
from sim_ecu.jobs.job import Ending
from sim_ecu.jobs.process import NotDone, Process
from tests.support.trial_kind import HANGS_S
from wrcd.errors import InputError

WAIT_S = 60
SLOW = """import sys, time
time.sleep(2.0 if sys.argv[0] == "-c" else 0.0)  # in the process, not here
def quick(x):
    return -x
"""


@pytest.fixture
def child() -> Iterator[Process]:
    one = Process()
    yield one
    one.stop()
    one.close()


def test_limit_is_of_the_job_and_not_of_its_imports(
    child: Process, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "slow_to_import.py").write_text(SLOW)
    monkeypatch.syspath_prepend(tmp_path)
    from slow_to_import import quick  # type: ignore[import-not-found]  # made just now

    assert child.run(quick, 1, limit_s=1.5) == -1


def test_job_beyond_its_limit_is_ended_and_the_next_has_all_of_its_own(child: Process) -> None:
    assert child.run(abs, -1, limit_s=5.0) == 1
    first = child.pid
    with pytest.raises(NotDone, match=r"not done within 0\.01 s") as too_long:
        child.run(hang, None, 0.01)
    assert (too_long.value.ending, child.pid) == (Ending.TOO_LONG, None)
    assert not Path(f"/proc/{first}").exists()
    assert child.run(abs, -2, limit_s=5.0) == 2


def hang(_: object) -> None:
    threading.Event().wait(HANGS_S)


def test_process_that_does_not_begin_in_time_has_died(child: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_module, "BEGINS_S", 0.0)
    with pytest.raises(NotDone, match="did not begin within 0 s"):
        child.run(abs, -1)


@pytest.mark.parametrize("starts", [True, False])
def test_child_that_is_stopped_runs_nothing(child: Process, monkeypatch: pytest.MonkeyPatch, starts: bool) -> None:
    """While it starts, and before."""
    starting, go_on = threading.Event(), threading.Event()
    process = process_module._process

    def slowly() -> process_module._Running:
        starting.set()
        assert go_on.wait(WAIT_S)
        return process()

    monkeypatch.setattr(process_module, "_process", slowly)
    if not starts:
        child.stop()
    found: list[Any] = []
    at_work = threading.Thread(target=lambda: found.append(raised(child, hang)), daemon=True)
    at_work.start()
    if starts:
        assert starting.wait(WAIT_S)
    stops = threading.Thread(target=child.stop, daemon=True)
    stops.start()
    stops.join(0.2)  # it waits for the start, or is done
    go_on.set()
    at_work.join(WAIT_S)
    assert [(e.ending, str(e)) for e in found] == [(Ending.DIED, "it was stopped")]
    assert child.pid is None


def raised(child: Process, function: Callable[[Any], Any]) -> Exception | None:
    try:
        child.run(function, None)
    except Exception as e:
        return e
    return None


def test_files_where_it_is_started_are_no_modules(
    child: Process, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "colorsys.py").write_text("raise SystemExit('mine')\n")
    monkeypatch.chdir(tmp_path)
    assert child.run(place_of_colorsys, None) == colorsys.__file__


def place_of_colorsys(_: object) -> str:
    import colorsys as there

    return str(there.__file__)


def test_a_thousand_open_files_do_not_matter(child: Process) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(4096, hard), hard))
    opened: list[int] = []
    try:
        while not opened or opened[-1] < 1100:
            opened.append(os.open(os.devnull, os.O_RDONLY))
        assert child.run(abs, -1, limit_s=WAIT_S) == 1
    finally:
        for fd in opened:
            os.close(fd)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.mark.parametrize(
    ("number", "words"), [(signal.SIGKILL, "ended by SIGKILL"), (signal.SIGRTMIN + 3, r"ended by signal \d+")]
)
def test_signal_that_ends_it_is_told(child: Process, number: int, words: str) -> None:
    with pytest.raises(NotDone, match=words):
        child.run(signal.raise_signal, number)


@pytest.mark.parametrize(("key", "text"), [("", "ValueError: no"), ("x", "x: no")])
def test_error_for_a_person_stands_without_its_class(child: Process, key: str, text: str) -> None:
    with pytest.raises(NotDone) as caught:
        child.run(fail, key)
    assert str(caught.value) == text


def fail(key: str) -> None:
    if key:
        raise InputError("no", key=key)
    raise ValueError("no")
