"""A campaign's rows on disk: a line of the journal, a row of a batch; files that are whole or not there."""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sim_ecu.campaign.job import Ending, Row, Scalar
from sim_ecu.campaign.kind import Figure, Type

ARROW = {Type.NUMBER: pa.float64(), Type.WHOLE: pa.int64(), Type.TEXT: pa.string(), Type.FLAG: pa.bool_()}


def line(row: Row) -> bytes:
    """Of the journal."""
    flat = {"key": row.key, "ending": row.ending.value, "error": row.error, "attempts": row.attempts,
            "seconds": row.seconds, **row.figures}  # fmt: skip
    return (json.dumps(flat) + "\n").encode()


def row(flat: Mapping[str, Any], figures: Sequence[Figure]) -> Row:
    """Of a line, or of a row of a batch. Raises KeyError, TypeError, ValueError for what is none."""
    found: dict[str, Scalar] = {f.name: flat[f.name] for f in figures if flat.get(f.name) is not None}
    return Row(flat["key"], Ending(flat["ending"]), found, flat["error"], flat["attempts"], flat["seconds"])


def batch(rows: Sequence[Row], figures: Sequence[Figure]) -> pa.Table:
    """Rows as they ended."""
    columns = {
        "key": pa.array([r.key for r in rows], pa.string()),
        "ending": pa.array([r.ending.value for r in rows], pa.string()),
        "error": pa.array([r.error for r in rows], pa.string()),
        "attempts": pa.array([r.attempts for r in rows], pa.int64()),
        "seconds": pa.array([r.seconds for r in rows], pa.float64()),
    }
    for f in figures:
        columns[f.name] = pa.array([r.figures.get(f.name) for r in rows], ARROW[f.type])
    return pa.table(columns)


def write(file: Path, table: pa.Table) -> None:
    """As Parquet, whole or not at all."""
    pq.write_table(table, beside(file), compression="zstd")
    _settle(file)


def replace(file: Path, data: bytes) -> None:
    """Whole or not at all."""
    beside(file).write_bytes(data)
    _settle(file)


def beside(file: Path) -> Path:
    """Where a file is written before it takes its place."""
    return file.with_suffix(".new")


def _settle(file: Path) -> None:
    """The whole file or the one before, whatever happens."""
    with beside(file).open("rb") as opened:
        os.fsync(opened.fileno())
    beside(file).replace(file)
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # its name, too, before what it replaces goes
    finally:
        os.close(folder)
