"""A campaign's folder: what is finished is there, whatever ends the process.

campaign.json     what is asked: kind, columns, code's version
journal.jsonl     rows since the last batch, a line each, written as they end
batches/*.parquet rows, one file for so many
results.parquet   all rows of the campaign in its order: equal bytes, however and in however many goes they were made
times.parquet     seconds and attempts of each: what differs from one go to the next
"""

import contextlib
import fcntl
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pyarrow as pa
import pyarrow.parquet as pq

from sim_ecu.campaign import rows
from sim_ecu.campaign.job import Job, Row
from sim_ecu.campaign.kind import Kind, Type
from sim_ecu.campaign.rows import ARROW
from wrcd.errors import InputError

BATCH = 500  # rows
FORMAT = "wrcd-campaign/1"
CAMPAIGN, JOURNAL, BATCHES = "campaign.json", "journal.jsonl", "batches"
RESULTS, TIMES, LOCK = "results.parquet", "times.parquet", "lock"
NO_ROW = (ValueError, KeyError, TypeError)


@dataclass(frozen=True, slots=True)
class Asked:
    """What a folder holds the answers to. columns: the inputs of the jobs with their types, in order."""

    title: str
    kind: Kind
    columns: Mapping[str, Type]
    code: str

    def document(self) -> dict[str, Any]:
        """As campaign.json says it."""
        return {
            "format": FORMAT,
            "title": self.title,
            "kind": self.kind.name,
            "suite": self.kind.suite,
            "cluster": [name for name in self.kind.cluster if name in self.columns],
            "inputs": {name: t.name.lower() for name, t in self.columns.items()},
            "figures": [{k: v for k, v in asdict(f).items() if k != "type"} | {"type": f.type.name.lower()}
                        for f in self.kind.figures],
            "code": self.code,
        }  # fmt: skip


class Store:
    """A folder that is open for one process. Use as a context; rows are added as they end."""

    def __init__(self, folder: Path, asked: Asked) -> None:
        self._folder, self._asked = folder, asked
        self._rows: dict[str, Row] = {}
        self._fresh: list[Row] = []  # in the journal, in no batch yet
        self._former = ""  # the title that was there

    def __enter__(self) -> Self:
        """Make or open the folder, take its lock, read what is finished. Raises InputError where that cannot be."""
        try:
            (self._folder / BATCHES).mkdir(parents=True, exist_ok=True)
            self._lock = (self._folder / LOCK).open("w")
        except OSError as e:
            raise InputError(
                f"cannot be written: {e.strerror}", file=self._folder, hint="name another folder"
            ) from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.close()
            raise InputError(
                "another campaign is at work in it", file=self._folder, hint="wait for its end, or name another folder"
            ) from None
        try:
            self._check()
            self._read()
        except BaseException:
            self._lock.close()
            raise
        if not (self._folder / CAMPAIGN).exists():
            self._describe()
        self._journal = (self._folder / JOURNAL).open("ab")
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        """Leave the folder to the next."""
        with contextlib.suppress(OSError):  # the row that a full disk did not take is said already, and runs again
            self._journal.close()
        self._lock.close()

    @property
    def rows(self) -> Mapping[str, Row]:
        """What is finished, by key."""
        return self._rows

    def claim(self, keys: Iterable[str]) -> None:
        """Raises InputError where the folder's rows are another campaign's: none of them is of these jobs, and it has
        another title."""
        if self._rows and self._former != self._asked.title and self._rows.keys().isdisjoint(keys):
            raise InputError(
                f"holds another campaign: {self._former!r}, with {len(self._rows)} rows", file=self._folder,
                hint="name another folder; with the same title, rows are added to those that are there",
            )  # fmt: skip

    def forget(self, keys: Iterable[str]) -> None:
        """Rows that are to be made again: a later row of the same key takes their place."""
        for key in keys:
            self._rows.pop(key, None)

    def add(self, row: Row) -> None:
        """Keep a row: from the end of this call on it outlives the process."""
        self._rows[row.key] = row
        self._fresh.append(row)
        self._journal.write(rows.line(row))
        self._journal.flush()
        if len(self._fresh) >= BATCH:
            self._flush()

    def merge(self, jobs: Sequence[Job]) -> Path:
        """Write results.parquet and times.parquet of the jobs, in their order; what is not finished is not in it."""
        self._flush()
        self._describe()
        pairs = [(job, self._rows[key]) for job in jobs if (key := job.key(self._asked.code)) in self._rows]
        rows.write(self._folder / RESULTS, self._table(pairs))
        times = {
            "key": [row.key for _, row in pairs],
            "attempts": pa.array([row.attempts for _, row in pairs], pa.int64()),
            "seconds": pa.array([row.seconds for _, row in pairs], pa.float64()),
        }
        rows.write(self._folder / TIMES, pa.table(times))
        return self._folder / RESULTS

    def _table(self, pairs: Sequence[tuple[Job, Row]]) -> pa.Table:
        columns: dict[str, pa.Array] = {"key": pa.array([r.key for _, r in pairs], pa.string())}
        for name, kind in self._asked.columns.items():
            columns[name] = pa.array([j.inputs.get(name) for j, _ in pairs], ARROW[kind])
        columns["ending"] = pa.array([r.ending.value for _, r in pairs], pa.string())
        columns["error"] = pa.array([r.error for _, r in pairs], pa.string())
        for f in self._asked.kind.figures:
            columns[f.name] = pa.array([r.figures.get(f.name) for _, r in pairs], ARROW[f.type])
        return pa.table(columns)

    def _describe(self) -> None:
        document = json.dumps(self._asked.document(), indent=1, ensure_ascii=False)
        rows.replace(self._folder / CAMPAIGN, f"{document}\n".encode())

    def _flush(self) -> None:
        if not self._fresh:
            return
        number = 1 + max((int(p.stem) for p in self._batches()), default=0)
        rows.write(self._folder / BATCHES / f"{number:06d}.parquet", rows.batch(self._fresh, self._asked.kind.figures))
        self._journal.truncate(0)  # a process that ends before this has its rows twice: the key tells
        self._fresh.clear()

    def _batches(self) -> list[Path]:
        """In their order; they are numbered, and what has another name is none."""
        return sorted(p for p in (self._folder / BATCHES).glob("*.parquet") if p.stem.isdecimal())

    def _check(self) -> None:
        """Raises InputError for a folder with something else in it."""
        file = self._folder / CAMPAIGN
        known = {JOURNAL, BATCHES, LOCK, rows.beside(file).name}  # the last of a process that was killed at its begin
        if not file.exists():
            if any(self._folder.glob(f"{BATCHES}/*")) or any(p.name not in known for p in self._folder.iterdir()):
                raise InputError("is no campaign's folder, and not empty", file=self._folder, hint="name a new one")
            return
        try:
            there = json.loads(file.read_text(encoding="utf-8"))
        except ValueError as e:
            raise InputError(f"cannot be read: {e}", file=file, hint="name another folder") from None
        if not isinstance(there, dict):
            raise InputError("describes no campaign", file=file, hint="name another folder")
        self._former = there.get("title", "")
        if there.get("format") != FORMAT or there.get("kind") != self._asked.kind.name:
            raise InputError(f"holds a campaign of another kind: {there.get('kind')}", file=self._folder,
                             hint="name another folder")  # fmt: skip
        if there.get("code") != self._asked.code:
            raise InputError(
                "holds rows of another version of the code or its libraries", file=self._folder,
                hint="name another folder; `sim-ecu compare` tells what differs",
            )  # fmt: skip

    def _read(self) -> None:
        for file in self._batches():
            try:
                batch = [rows.row(r, self._asked.kind.figures) for r in pq.read_table(file).to_pylist()]
            except (pa.ArrowException, OSError, *NO_ROW) as e:
                reason = f"cannot be read: {type(e).__name__}: {e}"
                raise InputError(reason, file=file, hint="remove it: its jobs run again") from None
            self._rows |= {r.key: r for r in batch}
        journal = self._folder / JOURNAL
        lines = journal.read_bytes().splitlines(keepends=True) if journal.exists() else []
        if lines and not lines[-1].endswith(b"\n"):  # the process ended within it: the job was not finished
            lines.pop()
        fresh = [self._journaled(number, line) for number, line in enumerate(lines, 1)]
        if journal.exists():
            os.truncate(journal, sum(map(len, lines)))
        self._rows |= {r.key: r for r in fresh}
        self._fresh = fresh

    def _journaled(self, number: int, line: bytes) -> Row:
        try:
            return rows.row(json.loads(line), self._asked.kind.figures)
        except NO_ROW as e:
            raise InputError(
                f"is no row: {type(e).__name__}: {e}", file=self._folder / JOURNAL, line=number,
                hint="remove the line: its job runs again",
            ) from None  # fmt: skip
