"""A campaign's folder: campaign.json, what is asked, and rows/part-N.parquet, a row for each job that has ended."""

import fcntl
import json
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.kind import Type
from sim_ecu.jobs.digests import code
from sim_ecu.jobs.pool import RESUMES, Stopped
from sim_ecu.reporting.result_files import save
from wrcd.errors import InputError

FORMAT = "wrcd-campaign/3"
CAMPAIGN, ROWS, LOCK = "campaign.json", "rows", "lock"
FORMER = ("rows.sqlite", "journal.jsonl", "results.parquet")
# Rows are written when they are so many of those that are there, or after so long: a kill costs a fiftieth of the work,
# or ten minutes of it, and a million rows lie in some 500 parts.
PART, PART_S = 0.02, 600.0
ARROW: dict[Type, Any] = {float: pa.float64(), int: pa.int64(), str: pa.string(), bool: pa.bool_()}
ANOTHER = "name another folder"


class RowFolder:
    """The rows of a folder, each in one part. endings: of those that are there, by key."""

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        self._folder, self._asked = folder, {job.key: place for place, job in enumerate(campaign.jobs)}
        ends = {"ending": str, "error": str}
        columns = {"key": str, **campaign.columns, **ends, **campaign.kind.figures}
        self._schema = pa.schema([(name, ARROW[of]) for name, of in columns.items()])
        self._held: list[Mapping[str, Any]] = []
        self._written_s = time.monotonic()
        tables = [_read(file, ["key", "ending"]) for file in self._parts()]
        self.endings = {row["key"]: row["ending"] for table in tables for row in table.to_pylist()}

    def _parts(self) -> list[Path]:
        return sorted(self._folder.glob("part-[0-9]*.parquet"))

    def add(self, row: Mapping[str, Any]) -> None:
        """Take a row. Raises Stopped for a full disk."""
        self._held.append(row)
        self.endings[row["key"]] = row["ending"]
        if len(self._held) >= PART * len(self.endings) or time.monotonic() - self._written_s > PART_S:
            self.write()

    def write(self) -> None:
        """Put the rows that are held into a part of their own."""
        held, self._held, self._written_s = self._held, [], time.monotonic()  # Ctrl-C writes nothing twice
        if held:
            newest = max((int(file.stem.partition("-")[2]) for file in self._parts()), default=0)
            self._save(self._folder / f"part-{newest + 1:06}.parquet", pa.Table.from_pylist(held, self._schema))

    def drop(self, keys: Collection[str]) -> None:
        """Leave out rows that are to be made again, or are not asked for any more."""
        for file in self._parts() if keys else ():
            table = _read(file)
            stays = table.filter([key not in keys for key in table["key"].to_pylist()])
            if not len(stays):
                file.unlink()
            elif len(stays) < len(table):
                self._save(file, stays)
        self.endings = {key: ending for key, ending in self.endings.items() if key not in keys}

    def table(self) -> pd.DataFrame:
        """Return the rows in the campaign's order."""
        parts = [_read(file, self._schema.names) for file in self._parts()]
        found = pa.concat_tables([self._schema.empty_table(), *parts]).to_pandas()
        return found.sort_values("key", key=lambda keys: keys.map(self._asked), ignore_index=True)

    def _save(self, file: Path, table: pa.Table) -> None:
        try:
            save(file, partial(pq.write_table, table))
        except InputError as e:
            raise Stopped(f"rows {e.reason}", file=file, hint=f"make room; {RESUMES}") from None


@contextmanager
def opened(folder: Path, campaign: Campaign) -> Iterator[RowFolder]:
    """Make or open a folder, which nobody else has meanwhile. Raises InputError for one that cannot be used, or that
    holds another campaign: of another kind or code, with other columns, or with rows that this one does not ask for."""
    if former := next((name for name in FORMER if (folder / name).exists()), None):
        raise InputError(f"holds rows of an earlier version, in {former}, which is not read", file=folder, hint=ANOTHER)
    if not (folder / CAMPAIGN).exists() and {p.name for p in folder.glob("[!.]*")} - {ROWS, LOCK}:
        raise InputError("is no campaign's folder, and not empty", file=folder, hint=ANOTHER)
    try:
        (folder / ROWS).mkdir(parents=True, exist_ok=True)
        lock = (folder / LOCK).open("a")
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=folder, hint=ANOTHER) from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError("another process is at work in it", file=folder, hint="wait for its end") from None
        text = _described(folder / CAMPAIGN, campaign)
        rows = RowFolder(folder / ROWS, campaign)
        others = rows.endings.keys() - {job.key for job in campaign.jobs}
        if others and not campaign.drops:
            reason = f"holds another campaign: {len(others)} of its rows are not asked for"
            raise InputError(reason, file=folder, hint=f"{ANOTHER}; a campaign may grow in its folder, but not change")
        save(folder / CAMPAIGN, lambda beside: beside.write_text(text, encoding="utf-8"))
        rows.drop(others)
        try:
            yield rows
        finally:
            rows.write()


def _described(file: Path, campaign: Campaign) -> str:
    """What is asked, as JSON. Raises InputError where something else is there."""
    asked: dict[str, Any] = {"format": FORMAT, "kind": campaign.kind.name, "title": campaign.title, "code": code()}
    for name, types in (("inputs", campaign.columns), ("figures", campaign.kind.figures)):
        asked[name] = {column: of.__name__ for column, of in types.items()}
    try:
        there = json.loads(file.read_text(encoding="utf-8")) if file.exists() else asked
        differs = [name for name in asked if name != "title" and there.get(name) != asked[name]]
    except (OSError, ValueError, AttributeError) as e:
        raise InputError(f"cannot be read: {type(e).__name__} {e}", file=file, hint=ANOTHER) from None
    if differs:
        hint = f"{ANOTHER}; code: a digest of the sources of wrcd and of the libraries' versions"
        raise InputError(f"holds another campaign, of another {' and '.join(differs)}", file=file.parent, hint=hint)
    return f"{json.dumps(asked, indent=1, ensure_ascii=False)}\n"


def _read(file: Path, columns: list[str] | None = None) -> pa.Table:
    try:
        return pq.read_table(file, columns=columns)
    except (pa.ArrowException, OSError) as e:
        raise InputError(f"cannot be read: {e}", file=file, hint="remove it: its jobs run again") from None
