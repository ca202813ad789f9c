"""What is done: rows in a small database, each there for good as soon as it is added."""

import json
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from sim_ecu.jobs.job import Ending, JobRow, Scalar
from sim_ecu.jobs.pool import RESUMES, Stopped, Workers, run
from wrcd.errors import InputError

T = TypeVar("T")
R = TypeVar("R")
TABLE = "CREATE TABLE IF NOT EXISTS rows (key PRIMARY KEY, ending, figures, error, attempts, seconds) WITHOUT ROWID"
ADD = "INSERT OR REPLACE INTO rows VALUES (?, ?, ?, ?, ?, ?)"
FULL = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE, sqlite3.SQLITE_IOERR_TRUNCATE, sqlite3.SQLITE_IOERR_FSYNC)

BESIDE = ".new"  # the suffix of a file that has not taken its place yet


def save(file: Path, write: Callable[[Path], object]) -> None:
    """Write a file beside its place, then put it there: the whole file or the one before, whatever happens. Raises
    InputError where it cannot be written."""
    beside = file.with_suffix(BESIDE)
    try:
        write(beside)
        with beside.open("rb") as opened:
            os.fsync(opened.fileno())
        beside.replace(file)
    except OSError as e:
        raise InputError(
            f"cannot be written: {e.strerror}", file=file, hint="check the folder, its room and your rights"
        ) from None


class Store:
    """A file of rows that is open for one process. Use as a context."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._rows: dict[str, JobRow] = {}

    def __enter__(self) -> Self:
        """Make or open the file and read its rows. Raises InputError where that cannot be."""
        try:
            self._database = sqlite3.connect(self._file, timeout=0.0, isolation_level=None)
        except sqlite3.Error as e:
            raise self._unusable(e) from None
        try:
            # a log ahead of the file: a row outlives a process that is killed without waiting for the disk
            for statement in ("locking_mode = EXCLUSIVE", "journal_mode = WAL", "synchronous = NORMAL"):
                self._database.execute(f"PRAGMA {statement}")
            self._database.execute(TABLE)
            self._rows = {row.key: row for row in map(_row, self._database.execute("SELECT * FROM rows"))}
        except (sqlite3.Error, ValueError, TypeError) as e:
            self._database.close()
            raise self._unusable(e) from None
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        """Leave the file to the next."""
        with suppress(sqlite3.Error):  # what a full disk did not take has been reported, and runs again
            self._database.close()

    @property
    def rows(self) -> Mapping[str, JobRow]:
        """What is finished, by key."""
        return self._rows

    def forget(self, keys: Iterable[str]) -> None:
        """Leave out rows that are to be made again: a later row of the same key takes their place."""
        for key in keys:
            self._rows.pop(key, None)

    def add(self, row: JobRow) -> None:
        """Keep a row: from the end of this call on it outlives the process. Raises Stopped for a full disk."""
        values = (row.key, row.ending.value, json.dumps(dict(row.figures)), row.error, row.attempts, row.seconds)
        try:
            self._database.execute(ADD, values)
        except sqlite3.OperationalError as e:
            if e.sqlite_errorcode not in FULL:
                raise
            raise Stopped(
                f"a row cannot be written: {e}", file=self._file.parent, hint=f"make room; {RESUMES}"
            ) from None
        self._rows[row.key] = row

    def _unusable(self, e: Exception) -> InputError:
        if isinstance(e, sqlite3.OperationalError) and e.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            return InputError(
                "another process is at work in it", file=self._file.parent,
                hint="wait for its end, or name another folder",
            )  # fmt: skip
        return InputError(f"cannot be used: {e}", file=self._file, hint="name another folder, or remove the file")

    def finish(
        self, function: Callable[[T], R], keys: Sequence[str], jobs: Sequence[T], workers: Workers,
        limit_s: float | None = None, *, row: Callable[[JobRow, R | None], JobRow],
    ) -> Iterator[tuple[int, JobRow]]:  # fmt: skip
        """Run function(job) of all and keep each as it ends: its place and row. row: with the figures of what came
        back. Raises Stopped, also as Lost, where it cannot go on; what has ended is kept."""
        workers.gather()
        ends = run(function, jobs, workers, limit_s)
        with closing(ends):
            for o in ends:
                made = row(JobRow(keys[o.place], o.ending, {}, o.error, o.attempts, o.seconds), o.value)
                self.add(made)
                yield o.place, made


def _row(found: Sequence[Any]) -> JobRow:
    """Raises ValueError, TypeError for what is none."""
    key, ending, figures, error, attempts, seconds = found
    named: Mapping[str, Scalar] = json.loads(figures)
    return JobRow(key, Ending(ending), named, error, attempts, float("nan") if seconds is None else seconds)
