"""A job as it goes to a worker: refused where code or files are others than those that it was asked of."""

import re
import socket
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from sim_ecu.campaign.job import Job, Scalar, code, contents
from wrcd.errors import InputError

ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}\b")
REMEMBERED = 1024  # files whose contents are not read again while their time and size stay


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker gets. job: file names among its inputs are absolute. files: contents (SHA-256) by path.

    code: the digest of whoever asks.
    """

    function: Callable[[Job], Mapping[str, Scalar]]
    job: Job
    files: Mapping[str, str]
    code: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a worker does not do what it is asked: it would answer another question."""

    text: str
    hint: str


def answer(task: Task) -> dict[str, Scalar] | Refusal:
    """The job's figures, worked out in this process. Raises what its function raises."""
    where = f"on {socket.gethostname()}"
    if code() != task.code:
        text = f"the sources of wrcd {where}, or its libraries, are others than those that the campaign began with"
        return Refusal(text, "have the same versions everywhere, and start what works on it anew")
    if refusal := _of_files(task, where):
        return refusal
    figures = dict(task.function(task.job))
    return _of_files(task, where) or figures  # nobody knows which of both it has read


def _of_files(task: Task, where: str) -> Refusal | None:
    for name, expected in task.files.items():
        try:
            if digest(Path(name)) != expected:
                return Refusal(f"{name} {where} is not as it was here when the campaign began", "begin it again")
        except InputError as e:
            return Refusal(f"{name} {where} {e.reason}", "every worker needs the files at the same paths")
    return None


def digest(file: Path) -> str:
    """SHA-256 of a file's contents. Raises InputError for one that cannot be read."""
    try:
        stat = file.stat()
    except OSError:
        return contents(file)  # says why not
    return _remembered(file, stat.st_mtime_ns, stat.st_size, stat.st_ino)


@lru_cache(REMEMBERED)
def _remembered(file: Path, _changed_ns: int, _size: int, _inode: int) -> str:
    return contents(file)


def plain_error(text: str, folder: str) -> str:
    """An error's text without what differs from one place or run to the next: the folder, addresses in memory."""
    return ADDRESS.sub("0x…", text.replace(f"{folder}/", ""))


def told(inputs: Mapping[str, Any]) -> str:
    """A job's inputs in a line, for a person."""
    return ", ".join(f"{name} = {_shown(value)}" for name, value in inputs.items())


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)
