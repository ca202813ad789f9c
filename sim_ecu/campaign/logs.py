"""`sim-ecu campaign --logs`: a fleet's logs through the core; rows, a table of adhesion by kilometre and a picture."""

import glob
import json
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from sim_ecu.campaign.definition import Campaign, jobs_of
from sim_ecu.campaign.kind import Job, Scalar
from sim_ecu.campaign.kinds.log import CLASSES, LOG
from sim_ecu.campaign.row_folder import ROWS
from sim_ecu.campaign.run_campaign import go
from sim_ecu.campaign.track_table import by_block, draw_track, place_of, places_of, stretches
from sim_ecu.jobs.digests import key_of
from sim_ecu.jobs.pool import Ending
from sim_ecu.reporting.result_files import save
from wrcd.errors import InputError, Status
from wrcd.logs.reader import log_suffix

SUFFIXES = (".log", ".blf", ".asc", ".mf4", ".trc", ".csv", ".db")
# what a log of python-can begins with, where other files have the same suffix: tables, the thumbnails of a folder
HEADS = {".csv": b"timestamp,arbitration_id,", ".db": b"SQLite format 3\0"}
CONFIGURATION, KILOMETRES, PICTURE = "wrcd.toml", "kilometres.parquet", "adhesion.png"
TRACK, TRACK_PICTURE = "low-rail.csv", "low-rail.png"
COLOURS = ("#d9e8f2", "#a9cbe3", "#6ba3cf", "#3877ad", "#173f66", "#e8c48a")  # by class
SHOWN = 20  # lines of what is wrong; trains in the picture


@dataclass(frozen=True, slots=True)
class Logs:
    """Which logs, and how: the arguments of the command."""

    where: str
    train: str | None
    configuration: Path | None
    channel: str
    limit_s: float
    from_km: Path | None = None  # where each log begins


def plan(logs: Logs) -> int:
    """Check, and say what would run."""
    trains = pd.Series([job.inputs["train"] for job in _campaign(logs).jobs], name=None).value_counts(sort=False)
    print(f"{trains.sum()} logs of {len(trains)} trains\n{trains.to_string()}")
    return Status.DONE


def run(logs: Logs, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Replay what is left, print, write table and picture. Returns 1 where a log could not be judged."""
    rows = go(_campaign(logs), folder, jobs, scheduler, again)
    if rows is None:
        return Status.INTERRUPTED
    done = rows[rows["ending"] == Ending.DONE]
    told = done[["train", "log", "detail"]].itertuples(index=False)
    details = [(train, log, json.loads(text)) for train, log, text in told]
    by_km = [(train, log, axle["axle"], km, *metres) for train, log, detail in details for axle in detail["axles"]
             for km, metres in enumerate(axle["metres"])]  # fmt: skip
    table = pd.DataFrame(by_km, columns=["train", "log", "axle", "km", *CLASSES]).astype(dict.fromkeys(CLASSES, float))
    save(folder / KILOMETRES, table.to_parquet)
    save(folder / PICTURE, partial(_draw, table))
    suspects = pd.DataFrame([{"train": t, **s} for t, _, detail in details for s in detail["suspects"]])
    print("\n".join(_summary(rows, done, suspects)))
    if logs.from_km is not None and details:
        track = by_block([(train, detail["blocks"]) for train, _, detail in details])
        save(folder / TRACK, partial(track.to_csv, index=False, float_format="%.6g"))
        save(folder / TRACK_PICTURE, partial(draw_track, track))
        print("\n".join(["", *(list(stretches(track)) or ["low rail: none"])]))
        print(f"by kilometre: {folder / TRACK}, {folder / TRACK_PICTURE}")
    print(f"\nrows: {folder / ROWS}\nmetres by kilometre: {folder / KILOMETRES}, {folder / PICTURE}")
    return Status.DONE if len(done) == len(rows) else Status.STOPPED


def _campaign(logs: Logs) -> Campaign:
    """Find the logs of a folder and the folders below it, or of a glob. Raises InputError where there is none, or for a
    configuration that has a mistake; a log that cannot be read fails in its own job."""
    root, files = _files(Path(logs.where))
    jobs: list[Job] = []
    places = {} if logs.from_km is None else places_of(logs.from_km)
    for file in sorted(files):
        # bytes of a name that are no UTF-8 as \xff: such a log is not found, and its row says so
        name = os.fsencode(file.relative_to(root)).decode("utf-8", "backslashreplace")
        folders = file.parents[: len(file.relative_to(root).parts) * (file == root / name)]  # up to the root
        own = next((p / CONFIGURATION for p in folders if (p / CONFIGURATION).is_file()), logs.configuration)
        inputs: dict[str, Scalar] = {"train": _train(name, root, logs.train), "log": name}
        inputs |= {"configuration": "" if own is None else os.path.relpath(own, root), "channel": logs.channel}
        inputs |= place_of(places, name, logs.from_km) if logs.from_km is not None else {}
        try:
            jobs += jobs_of(LOG, inputs, root)
        except InputError as e:
            if e.file != root / name:
                raise
            jobs.append(Job(key_of({"unread": inputs}), inputs, LOG.placed(inputs, root), {}, 1.0, LOG.function))
    if not jobs:
        hint = f"a log's name ends in {', '.join(SUFFIXES)}, or that and .gz"
        raise InputError("there is no log", file=logs.where, key="--logs", hint=hint)
    jobs.sort(key=lambda job: str(job.inputs["train"]))
    columns = dict.fromkeys(inputs, str) | ({} if logs.from_km is None else {"from_km": float})
    return Campaign(f"Logs of {root}", LOG, columns, jobs, root, logs.limit_s, drops=True)


def _files(where: Path) -> tuple[Path, list[Path]]:
    """The folder that names are below, and the logs in it."""
    fixed = next((k for k, part in enumerate(where.parts) if glob.has_magic(part)), None)
    if where.exists() or fixed is None:
        root, pattern = (where, "**/*") if where.is_dir() else (where.parent, glob.escape(where.name))
    else:
        root, pattern = Path(*where.parts[:fixed]), str(Path(*where.parts[fixed:]))
    root = root.resolve()
    found = {root / name for name in glob.glob(pattern, root_dir=root, recursive=True)}  # none of a name with a dot
    return root, [file for file in found if log_suffix(file) in SUFFIXES and file.is_file() and _is_log(file)]


def _is_log(file: Path) -> bool:
    head = HEADS.get(file.suffix.lower(), b"")  # one that is packed is looked at when it is read
    if not head or not os.access(file, os.R_OK):
        return True
    with file.open("rb") as opened:
        return opened.read(len(head)) == head


def _train(name: str, root: Path, pattern: str | None) -> str:
    """The first folder's name, or what the pattern's group `train` matches."""
    if pattern is None:
        return name.partition("/")[0] if "/" in name else root.name or "logs"
    try:
        if (found := re.search(pattern, name)) and found["train"]:
            return str(found["train"])
        raise IndexError("no match")
    except (re.error, IndexError) as e:
        reason = f"finds no group `train` in {name}: {e}"
        raise InputError(reason, key="--train", hint="e.g. '(?P<train>[^/_]+)_', of the path below --logs") from None


def _draw(table: pd.DataFrame, file: Path) -> None:
    """The classes' shares of the axles' metres by kilometre of the logs, a panel for each train."""
    from matplotlib.figure import Figure

    trains = list(table.groupby("train", sort=False))[:SHOWN] or [("", table)]
    figure = Figure(figsize=(8.0, 1.0 + 1.4 * len(trains)), layout="constrained")
    panels = figure.subplots(len(trains), squeeze=False)[:, 0]
    for panel, (train, rows) in zip(panels, trains, strict=True):
        metres = rows.groupby("km")[list(CLASSES)].sum()
        shares = metres.div(metres.sum(axis=1).replace(0.0, np.nan), axis=0).reindex(range(len(metres) + 1)).ffill()
        panel.stackplot(shares.index, shares.to_numpy().T, step="post", labels=CLASSES, colors=COLOURS)
        panel.set(ylabel=train, ylim=(0, 1), yticks=(0, 1), xlim=(0, max(len(metres), 1)))
    panels[0].legend(ncols=len(CLASSES), loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False, fontsize="small")
    panels[-1].set_xlabel("km of the logs")
    figure.savefig(file, format="png", dpi=120)


def _summary(rows: pd.DataFrame, done: pd.DataFrame, suspects: pd.DataFrame) -> Iterator[str]:
    """Yield lines for a terminal: trains, what is suspicious, what failed."""
    hours = [f"hours_{c}" for c in CLASSES]
    sums = done.groupby("train", sort=False)[["km", "hours", *hours]].sum()
    shares = sums[hours].div(sums[hours].sum(axis=1), axis=0).set_axis(CLASSES, axis=1)
    trains = pd.concat([done["train"].value_counts(sort=False).rename("logs"), sums[["km", "hours"]], shares], axis=1)
    yield f"{len(rows)} logs, {len(rows) - len(done)} that could not be judged; shares of the axles' time:\n"
    yield trains.to_string(float_format="{:.3g}".format)
    if len(suspects):
        each = suspects.sort_values("seconds").groupby(["train", "axle", "what"], sort=False)
        found = each.agg(seconds=("seconds", "sum"), logs=("seconds", "count"), text=("text", "last"))
        for (train, axle, what), s in found.nlargest(SHOWN, "seconds").iterrows():
            yield f"suspicious: {train} axle {axle}: {what}, {s['seconds']:.1f} s in {s['logs']} logs: {s['text']}"
    for name, error in rows.drop(done.index)[["log", "error"]].head(SHOWN).itertuples(index=False):
        yield f"failed: {name}: {error}"
