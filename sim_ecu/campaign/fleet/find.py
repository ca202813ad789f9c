"""Which logs there are, whose each is, and with which configuration it is replayed."""

import glob
import os
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from wrcd.bus.log_kind import log_suffix
from wrcd.errors import InputError

SUFFIXES = (".log", ".blf", ".asc", ".mf4", ".trc", ".csv", ".db")
CONFIGURATION = "wrcd.toml"
_FRAMES = b"timestamp,arbitration_id,"  # a .csv of python-can begins with it; others are tables


@dataclass(frozen=True, slots=True)
class Log:
    """A log. name: its path below the folder that was asked for. configuration: None for the packaged one."""

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
        """How many logs each has."""
        return dict(Counter(one.train for one in self.logs))


def find(asked: str, pattern: str | None, configuration: Path | None) -> Fleet:
    """The logs of a folder and the folders below it, or of a glob.

    A train is the first folder below what was asked for, or what the pattern's group `train` matches in the name. The
    wrcd.toml nearest above a log is its configuration; without one it is the one given.

    Raises InputError where there is no log, or the pattern does not fit.
    """
    root, files = _files(asked)
    expression = None if pattern is None else _compiled(pattern)
    found = []
    for file in files:
        name = file.relative_to(root).as_posix()
        found.append(Log(file, name, _train(name, root, expression), _nearest(file.parent, root) or configuration))
    if not found:
        raise InputError(
            "has no log", file=asked, key="--logs", hint=f"a log's name ends in {', '.join(SUFFIXES)}, or that and .gz"
        )
    return Fleet(root, tuple(sorted(found, key=lambda one: (one.train, one.name))))


def _files(asked: str) -> tuple[Path, list[Path]]:
    """The folder that names are below, and the logs in it."""
    folder = Path(asked)
    if folder.is_dir():
        return folder, [p for p in _walked(folder) if _is_log(p)]
    if folder.is_file():
        return folder.parent, [folder]
    if not glob.has_magic(asked):
        raise InputError("no such folder", file=asked, key="--logs", hint="name a folder, or a glob in quotes")
    parts = Path(asked).parts
    fixed = next(k for k, part in enumerate(parts) if glob.has_magic(part))
    return Path(*parts[:fixed]), [p for p in map(Path, glob.glob(asked, recursive=True)) if _is_log(p)]


def _walked(folder: Path) -> Iterator[Path]:
    for parent, folders, names in os.walk(folder):
        folders[:] = [f for f in folders if not f.startswith(".")]
        yield from (Path(parent) / name for name in names if not name.startswith("."))


def _is_log(file: Path) -> bool:
    suffix = log_suffix(file)
    if suffix not in SUFFIXES or not file.is_file():
        return False
    if file.suffix != ".csv":
        return True
    try:
        with file.open("rb") as opened:
            return opened.read(len(_FRAMES)) == _FRAMES
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
        return first if slash else root.absolute().name or "logs"
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
