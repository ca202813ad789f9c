"""What is done: each row once, there after any end, for one process at a time."""

import math
import os
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

from sim_ecu.jobs.job import Ending, JobRow
from sim_ecu.jobs.pool import local
from sim_ecu.jobs.store import Store
from wrcd.errors import InputError

ROW = JobRow("a", Ending.DONE, {"x": 0.1 + 0.2, "n": None, "t": "é", "nan": math.nan, "inf": math.inf}, "", 2, 0.1)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "rows.sqlite"


def test_rows_are_there_again_to_the_bit_and_a_later_one_takes_the_place(file: Path) -> None:
    with Store(file) as one:
        one.add(JobRow("a", Ending.FAILED, error="no"))
        one.forget(["a", "never"])
        assert not one.rows
        one.add(ROW)
        one.add(JobRow("b", Ending.DIED, error="killed"))
    with Store(file) as one:
        assert repr(one.rows["a"]) == repr(ROW)
        assert repr(one.rows["b"]) == repr(JobRow("b", Ending.DIED, error="killed"))


def test_row_outlives_a_process_that_is_killed_and_the_file_is_free(file: Path) -> None:
    pid = os.fork()
    if not pid:
        Store(file).__enter__().add(ROW)
        os._exit(0)
    os.waitpid(pid, 0)
    with Store(file) as one:
        assert list(one.rows) == ["a"]


def test_file_is_of_one_process_at_a_time(file: Path) -> None:
    with Store(file), pytest.raises(InputError, match="another process is at work in it"), Store(file):
        pass
    with Store(file):
        pass


@pytest.mark.parametrize("what", ["text", "row"])
def test_file_that_holds_something_else_is_refused(file: Path, what: str) -> None:
    if what == "text":
        file.write_text("no database\n" * 100)
    else:
        with Store(file):
            pass
        with sqlite3.connect(file) as database:
            database.execute("INSERT INTO rows VALUES ('a', 'lost', '{}', '', 1, 0.1)")
        database.close()
    with pytest.raises(InputError, match=r"rows\.sqlite: cannot be used: "), Store(file):
        pass


def test_every_job_that_ends_is_kept_as_its_row_says(file: Path) -> None:
    def row(row: JobRow, value: float | None) -> JobRow:
        return replace(row, figures={"root": value})

    with Store(file) as store, local(1) as workers:
        found = dict(store.finish(math.sqrt, ["four", "less"], [4.0, -1.0], workers, row=row))
    assert (found[0].figures, found[0].ending) == ({"root": 2.0}, Ending.DONE)
    assert (found[1].ending, found[1].attempts) == (Ending.FAILED, 2)
    with Store(file) as store:
        assert store.rows == {"four": found[0], "less": found[1]}
