"""Jobs on workers of this computer: each outcome once, whatever its job and its process do."""

import os
import pickle
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.jobs import pool
from sim_ecu.jobs.digests import code
from sim_ecu.jobs.pool import RESUMES, Ending, Stopped, Workers, kept, limited, local, run
from tests.support.processes import gone, wait_for
from tests.support.trial_kind import HANGS_S, figures, lines, meanwhile
from wrcd.errors import InputError

WAIT_S = 60.0
LIMIT_S = 5.0


@pytest.fixture(scope="module", name="_two")
def two_workers() -> Iterator[Workers]:
    with local(2) as workers:
        yield workers


@pytest.fixture
def two(_two: Workers) -> Workers:
    """Both are there: the test before may have ended one, which begins anew."""
    wait_for("both", WAIT_S, lambda: len(_two.there()) == 2)
    return _two


def jobs(count: int, **inputs: object) -> list[Mapping[str, Any]]:
    return [{"x": 1.0, "seed": seed, **inputs} for seed in range(1, count + 1)]


def test_every_job_has_one_outcome(two: Workers) -> None:
    found = sorted(run(figures, jobs(30), two), key=lambda o: o.place)
    assert [o.place for o in found] == list(range(30))
    assert [o.value and o.value["sum"] for o in found] == [2.0 + k for k in range(30)]
    assert {(o.ending, o.error) for o in found} == {(Ending.DONE, "")}


@pytest.mark.parametrize(
    ("act", "ending", "words"),
    [("fail", Ending.FAILED, "ValueError: seed 3 at"), ("die", Ending.DIED, "ended or was killed"),
     pytest.param("hang", Ending.TOO_LONG, f"not done within {LIMIT_S:g} s", marks=pytest.mark.night)],
)  # fmt: skip
def test_job_that_does_not_end_well_is_tried_once_more_and_takes_no_other_along(
    two: Workers, tmp_path: Path, act: str, ending: Ending, words: str
) -> None:
    """The others share its workers, one after the other."""
    record = tmp_path / "record"
    every = jobs(8, act=act, record=str(record))
    found = sorted(run(figures, every, two, LIMIT_S if act == "hang" else WAIT_S), key=lambda o: o.place)
    wrong = {o.place: o for o in found if o.ending is not Ending.DONE}
    assert {place: o.ending for place, o in wrong.items()} == {2: ending, 5: ending}
    assert words in wrong[2].error
    assert wrong[2].value is None
    began = sorted(int(line.split()[1]) for line in lines(record))
    assert began == sorted([*range(1, 9), 3, 6])


def test_worker_that_is_killed_loses_nothing(two: Workers, tmp_path: Path) -> None:
    record, gate = tmp_path / "record", tmp_path / "gate"

    def kill() -> None:
        wait_for("two jobs at work", WAIT_S, lambda: len(lines(record)) == 2)
        os.kill(int(lines(record)[0].split()[2]), signal.SIGKILL)
        gate.touch()

    with meanwhile(kill):
        found = list(run(figures, jobs(6, record=str(record), waits_for=str(gate)), two))
    assert sorted(o.place for o in found) == list(range(6))
    assert {o.ending for o in found} == {Ending.DONE}
    assert len(lines(record)) == 7


@pytest.mark.night
def test_result_that_is_lost_with_its_worker_is_made_again(two: Workers, tmp_path: Path) -> None:
    record, kill = tmp_path / "record", True
    found = []
    for o in run(figures, jobs(6, record=str(record)), two):
        found.append(o)
        if kill:
            wait_for("the other's job", WAIT_S, lambda: len(lines(record)) == 2)
            pids = {int(line.split()[1]): int(line.split()[2]) for line in lines(record)}
            time.sleep(1.0)  # it has ended, and nobody has fetched what it gave
            os.kill(next(pid for seed, pid in pids.items() if seed != o.place + 1), signal.SIGKILL)
            time.sleep(2.0)
            kill = False
    assert sorted(o.place for o in found) == list(range(6))
    assert {o.ending for o in found} == {Ending.DONE}


@pytest.mark.night
def test_job_that_does_not_go_on_in_a_worker_that_hears_no_signal_is_too_long(
    two: Workers, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The jobs need no module: what a worker would load counts."""
    monkeypatch.setattr(pool, "LATE_S", 3.0)
    stop = f"__import__('os').kill(__import__('os').getpid(), {signal.SIGSTOP:d})"
    found = {o.place: o.ending for o in run(eval, ["0", "0", stop, "0", "0"], two, 2.0)}
    assert found == dict.fromkeys(range(5), Ending.DONE) | {2: Ending.TOO_LONG}


def test_what_is_no_exception_fails_its_job_and_no_worker(two: Workers) -> None:
    (found,) = run(leave, [0], two)
    assert (found.ending, found.error) == (Ending.FAILED, "GeneratorExit: ")


def leave(_: int) -> None:
    raise GeneratorExit


def test_limit_holds_where_its_signal_was_blocked() -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    try:
        limited(pickle.dumps((abs, -1)), WAIT_S, code())
        assert signal.SIGALRM not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})


@pytest.mark.night
def test_worker_that_dies_again_and_again_comes_back_each_time(tmp_path: Path) -> None:
    """For longer than the 15 s after which Dask's own setting gives up one that is then not there."""
    record = tmp_path / "record"
    every = [{"x": 1.0, "seed": 3 * k, "act": "die", "record": str(record)} for k in range(15)]
    with local(1) as workers:
        assert [o.ending for o in run(figures, every, workers)] == [Ending.DIED] * 15
    assert len(lines(record)) == 30


def test_error_for_a_person_stands_without_its_class(two: Workers) -> None:
    assert [o.error for o in run(refuse, [0], two)] == ["x: no"]


def refuse(_: int) -> None:
    raise InputError("no", key="x")


def test_outcome_that_cannot_be_sent_is_a_failed_one(two: Workers) -> None:
    (found,) = run(unsendable, [0], two)
    assert found.ending is Ending.FAILED
    assert "pickle" in found.error.lower()


def unsendable(_: int) -> object:
    return lambda: None


def test_worker_that_cannot_even_begin_stops_all_of_it() -> None:
    with local(1) as workers, pytest.raises(Stopped, match="scheduler or worker cannot run jobs"):
        list(run(str, [Unreadable()], workers))


class Unreadable:
    """Is pickled here, and by no worker unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return __import__, ("a_module_that_nobody_has",)


@pytest.mark.parametrize("broken_off", [False, True])
def test_no_process_is_left_when_it_ends(tmp_path: Path, broken_off: bool) -> None:
    record = tmp_path / "record"
    others = [{"x": 1.0, "seed": 3, "act": "hang", "record": str(record)}] if broken_off else []
    with suppress(ZeroDivisionError), local(2) as workers:
        for _ in run(figures, [*jobs(1, record=str(record)), *others], workers):
            wait_for("all begun", WAIT_S, lambda: len(lines(record)) == 1 + len(others))
            assert 1 / (not broken_off)
    for line in lines(record):
        assert gone(int(line.split()[2]))


def test_nothing_is_left_in_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with local(1) as workers:
        assert [o.value for o in run(abs, [-1], workers)] == [1]
    assert list(tmp_path.iterdir()) == []


def test_workers_of_this_computer_listen_on_loopback_alone(two: Workers) -> None:
    pids = family(os.getpid())
    assert len(pids) > 2  # with the workers
    inodes = {os.readlink(fd) for pid in pids for fd in Path(f"/proc/{pid}/fd").iterdir() if fd.is_symlink()}
    listening = [
        fields for file in ("tcp", "tcp6") for line in Path(f"/proc/net/{file}").read_text().splitlines()[1:]
        if (fields := line.split())[3] == "0A" and f"socket:[{fields[9]}]" in inodes
    ]  # fmt: skip
    assert listening
    assert {fields[1].partition(":")[0] for fields in listening} == {"0100007F"}


def family(pid: int) -> list[int]:
    """A process and all below it."""
    below = [c for file in Path(f"/proc/{pid}/task").glob("*/children") for c in file.read_text().split()]
    return [pid, *(p for c in below for p in family(int(c)))]


def test_workers_that_never_begin_are_not_waited_for_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool, "BEGIN_S", 1.0)
    with local(1) as workers:
        workers.client.cluster.scale(0)
        with pytest.raises(Stopped, match="no worker begins"):
            list(run(time.sleep, [HANGS_S], workers))


def test_workers_that_are_gone_are_lost_and_only_what_is_kept_goes_on() -> None:
    with local(1) as workers:
        pass
    with pytest.raises(Stopped) as alone:
        list(run(figures, jobs(1), workers))
    with pytest.raises(Stopped) as of_kept, kept():
        list(run(figures, jobs(1), workers))
    assert (alone.value.hint, of_kept.value.hint) == ("", RESUMES)


def test_other_code_works_on_nothing() -> None:
    with pytest.raises(Stopped, match="other sources"):
        limited(b"", 1.0, "other")


@pytest.mark.night
def test_limit_is_of_a_job_and_ends_no_worker_that_waits(two: Workers) -> None:
    before = {o.value for o in run(own_id, range(8), two, LIMIT_S)}
    time.sleep(LIMIT_S + 0.2)
    assert {o.value for o in run(own_id, range(8), two, LIMIT_S)} == before


def own_id(_: int) -> int:
    return os.getpid()
