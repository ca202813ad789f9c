"""Jobs on an executor: each outcome once, whatever its job and its process do."""

import os
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_ecu.jobs.job import Ending, Job
from sim_ecu.jobs.pool import Lost, Workers, local, run
from tests.support.trial_kind import figures

HANG_S = 1.5  # a job that does nothing is done within it on a busy machine, too


@pytest.fixture(scope="module")
def two() -> Iterator[Workers]:
    with local(2) as workers:
        yield workers


def jobs(count: int, **inputs: object) -> list[Job]:
    return [Job("trial", {"x": 1.0, "seed": seed, **inputs}) for seed in range(1, count + 1)]


def test_every_job_has_one_outcome(two: Workers) -> None:
    found = sorted(run(figures, jobs(50), two), key=lambda o: o.place)
    assert [o.place for o in found] == list(range(50))
    assert [o.value and o.value["sum"] for o in found] == [2.0 + k for k in range(50)]
    assert {(o.ending, o.attempts, o.error) for o in found} == {(Ending.DONE, 1, "")}


@pytest.mark.parametrize(
    ("act", "ending", "attempts", "words"),
    [("fail", Ending.FAILED, 2, "ValueError: seed 3 at"), ("die", Ending.DIED, 2, "its process was ended by SIGKILL"),
     ("hang", Ending.TOO_LONG, 1, f"not done within {HANG_S:g} s")],
)  # fmt: skip
def test_job_that_does_not_end_well_is_an_outcome(
    two: Workers, act: str, ending: Ending, attempts: int, words: str
) -> None:
    found = sorted(run(figures, jobs(4, act=act), two, HANG_S), key=lambda o: o.place)
    assert [o.ending for o in found] == [Ending.DONE, Ending.DONE, ending, Ending.DONE]
    assert found[2].value is None
    assert (found[2].attempts, found[2].error.startswith(words)) == (attempts, True)


def test_what_a_job_prints_is_no_outcome(two: Workers) -> None:
    (found,) = run(loud, ["here"], two)
    assert found.value == "here"


def loud(text: str) -> str:
    print(text)
    os.write(1, b"and past Python\n")
    return text


def test_outcome_that_cannot_be_sent_is_a_failed_one(two: Workers) -> None:
    (found,) = run(unsendable, [0], two)
    assert found.ending is Ending.FAILED
    assert "pickle" in found.error.lower()


def unsendable(_: int) -> object:
    return lambda: None


@pytest.mark.parametrize("broken_off", [False, True])
def test_no_process_is_left_when_the_executor_ends(tmp_path: Path, broken_off: bool) -> None:
    record = tmp_path / "record"
    others = jobs(9, act="hang", record=str(record)) if broken_off else []
    with suppress(ZeroDivisionError), local(2) as workers:
        for _ in run(figures, [*jobs(1, record=str(record)), *others], workers):
            assert 1 / (not broken_off)
    for pid in {int(line.split()[2]) for line in record.read_text().splitlines()}:
        assert not Path(f"/proc/{pid}").exists()


def test_executor_that_takes_no_jobs_any_more_is_lost() -> None:
    with local(1) as workers:
        pass
    with pytest.raises(Lost):
        list(run(figures, jobs(1), workers))


def test_idle_ends_a_run_by_what_it_raises(tmp_path: Path) -> None:
    def gone() -> None:
        raise Lost("gone")

    with pytest.raises(Lost, match="gone"), local(1) as workers:
        list(run(figures, jobs(1, waits_for=str(tmp_path / "never")), replace(workers, idle=gone)))


def test_workers_that_are_not_there_yet_are_waited_for(two: Workers) -> None:
    there = iter([0, 0])
    found = list(run(figures, jobs(9), replace(two, count=lambda: next(there, 2))))
    assert sorted(o.place for o in found) == list(range(9))


class Silent(Executor):
    """Takes jobs and begins none."""

    def __init__(self) -> None:
        self.taken: list[Future[Any]] = []

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        self.taken.append(Future())
        return self.taken[-1]


def test_jobs_that_nobody_has_begun_are_taken_back() -> None:
    silent = Silent()

    def gone() -> None:
        raise Lost("gone")

    with pytest.raises(Lost, match="gone"):
        list(run(figures, jobs(3), Workers(silent, 1, idle=gone)))
    assert [f.cancelled() for f in silent.taken] == [True] * 3
