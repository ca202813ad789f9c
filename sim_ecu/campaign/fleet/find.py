"""Which logs there are, whose each is, with which configuration it is replayed; and the campaign of them."""

import glob
import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from sim_ecu.campaign.campaign_folder import CampaignRequest
from sim_ecu.campaign.definition import Campaign, placed
from sim_ecu.campaign.kinds.log import KIND, OWN
from sim_ecu.jobs.job import Job, code, digest
from wrcd.errors import InputError
from wrcd.logs.reader import log_suffix
from wrcd.progress import Progress

SUFFIXES = (".log", ".blf", ".asc", ".mf4", ".trc", ".csv", ".db")
CONFIGURATION = "wrcd.toml"
LABELS = ("train",)  # the same log of another train is the same question
# what a log of python-can begins with, where other files have the same suffix: tables, the thumbnails of a folder
_HEADS = {".csv": b"timestamp,arbitration_id,", ".db": b"SQLite format 3\0"}


@dataclass(frozen=True, slots=True)
class Log:
    """A log. name: its path below the folder that was given, as text. configuration: None for the packaged one."""

    file: Path
    name: str
    train: str
    configuration: Path | None


@dataclass(frozen=True, slots=True)
class Fleet:
    """Logs by train and name. folder: what their names are relative to."""

    folder: Path
    logs: tuple[Log, ...]

    @property
    def trains(self) -> dict[str, int]:
        """How many logs each train has."""
        return dict(Counter(one.train for one in self.logs))


def find(where: str, pattern: str | None, configuration: Path | None) -> Fleet:
    """The logs of a folder and the folders below it, or of a glob.

    A train is the first folder below the one given, or what the pattern's group `train` matches in the name. The
    wrcd.toml nearest above a log is its configuration; without one it is the one given.

    Raises InputError where there is no log, or the pattern does not fit.
    """
    root, files = _files(where)
    expression = None if pattern is None else _compiled(pattern)
    found = []
    for file in files:
        path = file.relative_to(root).as_posix()
        name = printable(path)  # a name that is no text cannot be opened by it: the job says so, and nothing is read
        own = _nearest(file.parent, root) if name == path else None
        found.append(Log(file, name, _train(name, root, expression), own or configuration))
    if not found:
        raise InputError(
            "has no log", file=where, key="--logs", hint=f"a log's name ends in {', '.join(SUFFIXES)}, or that and .gz"
        )
    return Fleet(root, tuple(sorted(found, key=lambda one: (one.train, one.name))))


def printable(name: str) -> str:
    """A file's name as text that can be written anywhere: bytes that are no UTF-8 as \\xff."""
    return os.fsencode(name).decode("utf-8", "backslashreplace")


def _files(where: str) -> tuple[Path, list[Path]]:
    """The folder that names are below, and the logs in it."""
    folder = Path(where)
    if folder.is_dir():
        return folder, [p for p in _walked(folder) if _is_log(p)]
    if folder.is_file():
        return folder.parent, [folder]
    if not glob.has_magic(where):
        raise InputError("no such folder", file=where, key="--logs", hint="name a folder, or a glob in quotes")
    parts = Path(where).parts
    fixed = next(k for k, part in enumerate(parts) if glob.has_magic(part))
    matched = dict.fromkeys(map(Path, glob.glob(where, recursive=True)))  # two ** find a file more than once
    return Path(*parts[:fixed]), [p for p in matched if _is_log(p)]


def _walked(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        yield from (Path(parent) / name for name in names if not name.startswith("."))


def _is_log(file: Path) -> bool:
    suffix = log_suffix(file)
    if suffix not in SUFFIXES or not file.is_file():
        return False
    head = _HEADS.get(file.suffix.lower(), b"")  # one that is packed is looked at when it is read
    try:
        with file.open("rb") as opened:
            return opened.read(len(head)) == head
    except OSError:
        return True


def _compiled(pattern: str) -> re.Pattern[str]:
    try:
        expression = re.compile(pattern)
    except re.error as e:
        raise InputError(f"is no regular expression: {e}", key="--train") from None
    if "train" not in expression.groupindex:
        raise InputError("has no group called train", key="--train", hint="e.g. '(?P<train>[^/_]+)_'")
    return expression


def _train(name: str, root: Path, expression: re.Pattern[str] | None) -> str:
    if expression is None:
        first, slash, _ = name.partition("/")
        return first if slash else printable(root.absolute().name) or "logs"
    matched = expression.search(name)
    if matched is None or not matched["train"]:
        raise InputError(f"finds no train in {name}", key="--train", hint="it is looked for in the path below --logs")
    return matched["train"]


@cache
def _nearest(folder: Path, root: Path) -> Path | None:
    """The configuration in a folder or one above it, up to the root."""
    own = folder / CONFIGURATION
    if own.is_file():
        return own
    return None if folder == root or folder.parent == folder else _nearest(folder.parent, root)


def campaign(fleet: Fleet, channel: str, limit_s: float | None, progress: Progress) -> Campaign:
    """Raises InputError for a configuration that has a mistake. A log that cannot be read fails in its own job."""
    jobs, paths = [], {}
    for number, one in enumerate(fleet.logs):
        progress.at(f"looked at {number} of {len(fleet.logs)} logs", number / len(fleet.logs))
        inputs = _inputs(one, fleet.folder, channel)
        files = _digests(placed(KIND, inputs, fleet.folder))
        absolute = placed(KIND, inputs, fleet.folder.resolve())
        # a log that changes meanwhile, for it is still being written, is its job's matter and ends nobody else's
        paths[tuple(absolute[f.name] for f in KIND.factors if f.is_file)] = {
            str(path.resolve()): found for name, (path, found) in files.items() if name not in OWN
        }
        jobs.append(Job(KIND.name, inputs, {name: found for name, (_, found) in files.items()}, LABELS))
    progress.end()
    types = {f.name: f.type for f in KIND.factors}
    request = CampaignRequest(
        f"Logs of {printable(fleet.folder.absolute().name)}", KIND, types, code(KIND.function.__module__)
    )
    return Campaign(request, tuple(jobs), {}, None, 0, limit_s, fleet.folder.resolve(), paths)


def _inputs(one: Log, folder: Path, channel: str) -> dict[str, Any]:
    """File names are relative to the folder: a fleet that is moved has the same keys."""
    configuration = "" if one.configuration is None else os.path.relpath(one.configuration, folder)
    return {"train": one.train, "log": one.name, "configuration": configuration, "channel": channel}


def _digests(inputs: dict[str, Any]) -> dict[str, tuple[Path, str]]:
    out = {}
    for name, path in KIND.files(inputs).items():
        try:
            out[name] = path, digest(path)
        except InputError:
            if name not in OWN:
                raise
    return out
