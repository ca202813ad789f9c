"""A campaign's folder as a comparison reads it."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sim_ecu.campaign.kind import Figure, Type
from sim_ecu.campaign.store import CAMPAIGN, FORMAT, RESULTS
from wrcd.errors import InputError

_AGAIN = "name the folder of `sim-ecu campaign … -o`"


@dataclass(frozen=True, slots=True)
class Campaign:
    """What a folder holds. suite: the input that tells what belongs together, "" for none. cluster: the inputs whose
    rows share a world where they are equal. rows: inputs, ending, error and figures by name."""

    folder: Path
    title: str
    kind: str
    suite: str
    cluster: tuple[str, ...]
    code: str
    inputs: Mapping[str, str]  # their types, by name
    figures: tuple[Figure, ...]
    rows: Sequence[Mapping[str, Any]]


def read(folder: Path) -> Campaign:
    """Raises InputError for a folder that holds no finished campaign."""
    file = folder / CAMPAIGN
    if not file.is_file():
        raise InputError("is no campaign's folder", file=folder, hint=_AGAIN)
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
        if told["format"] != FORMAT:
            raise InputError(f"has the format {told['format']}, not {FORMAT}", file=file, hint="run the campaign again")
        figures = tuple(
            Figure(f["name"], Type[f["type"].upper()], f["words"], f["unit"], f["better"]) for f in told["figures"]
        )
        cluster = tuple(n for n in told["cluster"] if n in told["inputs"])
        rows = _rows(folder, [*told["inputs"], "ending", *(f.name for f in figures)])
        return Campaign(
            folder, told["title"], told["kind"], told["suite"], cluster, told["code"], told["inputs"], figures, rows
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as e:
        raise InputError(f"cannot be read: {type(e).__name__} {e}", file=file, hint="run the campaign again") from None


def _rows(folder: Path, columns: Sequence[str]) -> list[dict[str, Any]]:
    file = folder / RESULTS
    if not file.is_file():
        raise InputError("is not there: the campaign has not come to its end", file=file,
                         hint="start it again: it goes on where it was")  # fmt: skip
    try:
        table = pq.read_table(file)
    except (pa.ArrowException, OSError) as e:
        raise InputError(f"cannot be read: {e}", file=file, hint="start the campaign again") from None
    if missing := [c for c in columns if c not in table.column_names]:
        raise InputError(f"has no column {missing[0]}", file=file, hint="start the campaign again")
    if not table.num_rows:
        raise InputError("has no row", file=file, hint="start the campaign again")
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows
