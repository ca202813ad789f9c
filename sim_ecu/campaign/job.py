"""One question of many: its inputs, and the key that names it."""

import hashlib
import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeAlias

from wrcd.errors import InputError

Scalar: TypeAlias = str | int | float | bool | None
PACKAGES = ("sim_ecu", "wrcd")
CODE = {".py", ".json", ".toml", ".dbc"}  # what a run depends on: sources, designs, scenarios, databases
LIBRARIES = ("numpy", "scipy", "cantools", "numba")  # another version of one may give another last digit
KEY_LENGTH = 32


class Ending(StrEnum):
    """How a job ended."""

    DONE = "done"
    FAILED = "failed"  # it raised an error
    TOO_LONG = "too long"  # it was ended at its limit
    DIED = "died"  # its process ended by itself or was killed


@dataclass(frozen=True, slots=True)
class Job:
    """What a kind's function is given. Plain data, so that it goes to another process or computer as it is.

    inputs: all that the figures depend on, by name. files: the contents (SHA-256) of the files that inputs name, by
    what each is to the job: an edited file is another question. labels: inputs that only say where a row belongs: no
    part of the question.
    """

    kind: str
    inputs: Mapping[str, Any]
    files: Mapping[str, str] = field(default_factory=dict)
    labels: tuple[str, ...] = ()

    def key(self, code: str) -> str:
        """Of the inputs, the files' contents and the code's version: the same question has the same key anywhere."""
        inputs = {name: value for name, value in self.inputs.items() if name not in self.labels}
        asked = {"kind": self.kind, "inputs": inputs, "files": dict(self.files), "code": code}
        text = json.dumps(asked, sort_keys=True, separators=(",", ":"), default=_plain)
        return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


@dataclass(frozen=True, slots=True)
class Row:
    """What a job came to. figures: empty unless it is done. seconds, of the last attempt: no part of the result."""

    key: str
    ending: Ending
    figures: Mapping[str, Scalar] = field(default_factory=dict)
    error: str = ""
    attempts: int = 1
    seconds: float = math.nan


@cache
def code() -> str:
    """A digest of both packages' sources and data, of Python's version and the libraries' that figures depend on: rows
    of other code are never taken for this one's."""
    digest = hashlib.sha256(f"{versions()}\0".encode())
    root = Path(__file__).parents[2]
    for file in sorted(f for package in PACKAGES for f in (root / package).rglob("*") if f.suffix in CODE):
        digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:KEY_LENGTH]


def versions() -> dict[str, str]:
    """Of Python, without its last number, and of the libraries that figures depend on; empty for none."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {"python": python} | {name: _version(name) for name in LIBRARIES}


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""


def contents(file: Path) -> str:
    """SHA-256 of a file. Raises InputError for one that cannot be read."""
    try:
        with file.open("rb") as opened:
            return hashlib.file_digest(opened, "sha256").hexdigest()
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror}", file=file, hint="check the path and your rights") from None


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return value.as_posix()
    raise TypeError(f"a job's inputs are plain data, not {type(value).__name__}")
