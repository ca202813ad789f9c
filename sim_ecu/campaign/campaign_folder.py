"""A campaign's folder: what is requested, what is done, and the results as a table once all of it is.

campaign.json     what is requested: kind, columns, code's version
rows.sqlite       what is finished, a row as soon as its job ends
results.parquet   all rows of the campaign in its order: equal bytes, however and in however many goes they were made
times.parquet     seconds and attempts of each: what differs from one go to the next
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from sim_ecu.campaign.kind import Kind, Metric, Type
from sim_ecu.jobs.job import Job, JobRow
from sim_ecu.jobs.store import BESIDE, Store, save
from wrcd.errors import InputError

FORMAT, FORMER = "wrcd-campaign/2", "wrcd-campaign/1"
CAMPAIGN, ROWS, RESULTS, TIMES = "campaign.json", "rows.sqlite", "results.parquet", "times.parquet"
ARROW = {Type.NUMBER: pa.float64(), Type.WHOLE: pa.int64(), Type.TEXT: pa.string(), Type.FLAG: pa.bool_()}
_AGAIN = "name the folder of `sim-ecu campaign … -o`"


@dataclass(frozen=True, slots=True)
class CampaignRequest:
    """What a folder holds the answers to. columns: the inputs of the jobs with their types, in order."""

    title: str
    kind: Kind
    columns: Mapping[str, Type]
    code: str

    def document(self) -> dict[str, Any]:
        """Return what campaign.json says."""
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


@contextmanager
def opened_store(folder: Path, request: CampaignRequest, keys: Iterable[str]) -> Iterator[Store]:
    """Make or open a folder, which nobody else has meanwhile, before anybody is waited for. keys: of the requested
    jobs.

    Raises InputError for one that cannot be used, or that holds another campaign: of another kind or code, or without
    one of these jobs and of another title.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be written: {e.strerror}", file=folder, hint="name another folder") from None
    title = _title(folder, request)
    with Store(folder / ROWS) as store:
        if store.rows and title != request.title and store.rows.keys().isdisjoint(keys):
            raise InputError(
                f"holds another campaign: {title!r}, with {len(store.rows)} rows", file=folder,
                hint="name another folder; with the same title, rows are added to those that are there",
            )  # fmt: skip
        _describe(folder, request)
        yield store


def _title(folder: Path, request: CampaignRequest) -> str:
    """The title of what is there, "" for nothing."""
    file = folder / CAMPAIGN
    if not file.exists():
        ours = {ROWS, f"{ROWS}-wal", file.with_suffix(BESIDE).name}  # of a process that was killed at its begin
        if any(p.name not in ours for p in folder.iterdir()):
            raise InputError("is no campaign's folder, and not empty", file=folder, hint="name a new one")
        return ""
    there = _document(file, "name another folder")
    if there.get("format") == FORMER:
        raise InputError("holds a campaign of an earlier version, which is not resumed", file=folder,
                         hint="name another folder; `sim-ecu compare` still reads this one")  # fmt: skip
    if there.get("format") != FORMAT or there.get("kind") != request.kind.name:
        raise InputError(f"holds a campaign of another kind: {there.get('kind')}", file=folder,
                         hint="name another folder")  # fmt: skip
    if there.get("code") != request.code:
        raise InputError(
            "holds rows of another version of the code or its libraries", file=folder,
            hint="name another folder; `sim-ecu compare` tells what differs",
        )  # fmt: skip
    return str(there.get("title", ""))


def _document(file: Path, hint: str) -> dict[str, Any]:
    try:
        there = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {type(e).__name__} {e}", file=file, hint=hint) from None
    if not isinstance(there, dict):
        raise InputError("describes no campaign", file=file, hint=hint)
    return there


def _describe(folder: Path, request: CampaignRequest) -> None:
    text = f"{json.dumps(request.document(), indent=1, ensure_ascii=False)}\n"
    save(folder / CAMPAIGN, lambda beside: beside.write_text(text, encoding="utf-8"))


def merge(folder: Path, request: CampaignRequest, pairs: Sequence[tuple[Job, JobRow]]) -> Path:
    """Write results.parquet and times.parquet of jobs and their rows, in this order. Returns the first's place."""
    columns: dict[str, pa.Array] = {"key": pa.array([r.key for _, r in pairs], pa.string())}
    for name, kind in request.columns.items():
        columns[name] = pa.array([j.inputs.get(name) for j, _ in pairs], ARROW[kind])
    columns["ending"] = pa.array([r.ending.value for _, r in pairs], pa.string())
    columns["error"] = pa.array([r.error for _, r in pairs], pa.string())
    for f in request.kind.figures:
        columns[f.name] = pa.array([r.figures.get(f.name) for _, r in pairs], ARROW[f.type])
    times = {
        "key": columns["key"],
        "attempts": pa.array([row.attempts for _, row in pairs], pa.int64()),
        "seconds": pa.array([row.seconds for _, row in pairs], pa.float64()),
    }
    for name, table in ((RESULTS, columns), (TIMES, times)):
        save(folder / name, partial(pq.write_table, pa.table(table), compression="zstd"))
    return folder / RESULTS


@dataclass(frozen=True, slots=True)
class Results:
    """What a folder holds. suite: the input that shows what belongs together, "" for none. cluster: the inputs whose
    rows share a world where they are equal. rows: inputs, ending, error and figures by name."""

    folder: Path
    title: str
    kind: str
    suite: str
    cluster: tuple[str, ...]
    code: str
    inputs: Mapping[str, str]  # their types, by name
    figures: tuple[Metric, ...]
    rows: Sequence[Mapping[str, Any]]


def read_results(folder: Path) -> Results:
    """Read a finished campaign. Raises InputError for a folder that holds none."""
    file = folder / CAMPAIGN
    if not file.is_file():
        raise InputError("is no campaign's folder", file=folder, hint=_AGAIN)
    there = _document(file, "run the campaign again")
    try:
        if there["format"] not in (FORMAT, FORMER):
            raise InputError(
                f"has the format {there['format']}, not {FORMAT}", file=file, hint="run the campaign again"
            )
        figures = tuple(
            Metric(f["name"], Type[f["type"].upper()], f["words"], f["unit"], f["better"]) for f in there["figures"]
        )
        cluster = tuple(n for n in there["cluster"] if n in there["inputs"])
        rows = _rows(folder, [*there["inputs"], "ending", *(f.name for f in figures)])
        return Results(
            folder, there["title"], there["kind"], there["suite"], cluster, there["code"], there["inputs"], figures,
            rows,
        )  # fmt: skip
    except (ValueError, KeyError, TypeError, AttributeError) as e:
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
