"""One question of many: its inputs, the key that names it, and its answer by the code and files that it is of."""

import hashlib
import json
import math
import re
import socket
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeAlias

from wrcd.errors import InputError

Scalar: TypeAlias = str | int | float | bool | None
ROOT = Path(__file__).parents[2]
PACKAGES = ("sim_ecu", "wrcd")
DATA = {".json", ".toml", ".dbc"}  # what a run may read without naming it: designs, scenarios, databases
LIBRARIES = ("numpy", "scipy", "cantools", "numba")  # another version of one may give another last digit
KEY_LENGTH = 32
MEMORY_ADDRESS = re.compile(r"\b0x[0-9a-f]{6,}\b")
# as quick as a worker needs it; a line of prose that looks like one names no module, or one too many
IMPORT = re.compile(r"^ *(?:from +([\w.]+) +import +(\([^)]*\)|[^\n#]*)|import +([^\n#]*))", re.MULTILINE)
REMEMBERED = 1024  # files whose contents are not read again while their time and size stay


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
        """Return the key of inputs, files' contents and the code's version: the same anywhere for the same question."""
        inputs = {name: value for name, value in self.inputs.items() if name not in self.labels}
        content = {"kind": self.kind, "inputs": inputs, "files": dict(self.files), "code": code}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), default=_plain)
        return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


@dataclass(frozen=True, slots=True)
class JobRow:
    """What a job came to. figures: empty unless it is done. seconds, of the last attempt: no part of the result."""

    key: str
    ending: Ending
    figures: Mapping[str, Scalar] = field(default_factory=dict)
    error: str = ""
    attempts: int = 1
    seconds: float = math.nan


@dataclass(frozen=True, slots=True)
class Task:
    """What a worker gets. job: file names among its inputs are absolute. files: contents (SHA-256) by path.

    code: the digest of the campaign's code.
    """

    function: Callable[[Job], Mapping[str, Scalar]]
    job: Job
    files: Mapping[str, str]
    code: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a worker does not do its task: it would answer another question."""

    text: str
    hint: str


def answer(task: Task) -> dict[str, Scalar] | Refusal:
    """Return the job's figures, worked out in this process. Raises what its function raises."""
    where = f"on {socket.gethostname()}"
    if code(task.function.__module__) != task.code:
        text = f"the sources of wrcd {where}, or its libraries, are others than those that the campaign began with"
        return Refusal(text, "have the same versions everywhere, and start what works on it anew")
    if refusal := _of_files(task, where):
        return refusal
    figures = dict(task.function(task.job))
    return _of_files(task, where) or figures  # it may have read either version


def _of_files(task: Task, where: str) -> Refusal | None:
    for name, expected in task.files.items():
        try:
            if digest(Path(name)) != expected:
                return Refusal(f"{name} {where} is not as it was here when the campaign began", "begin it again")
        except InputError as e:
            return Refusal(f"{name} {where} {e.reason}", "every worker needs the files at the same paths")
    return None


@cache
def code(module: str) -> str:
    """Digest what a function of the module depends on: the sources that it imports, both packages' data, Python's
    version and the libraries'. Rows of other code are never taken for this one's."""
    found = hashlib.sha256(f"{versions()}\0".encode())
    data = (f for package in PACKAGES for f in (ROOT / package).rglob("*") if f.suffix in DATA)
    named = {f.relative_to(ROOT).as_posix(): f for f in data} | sources(module)
    for name, file in sorted(named.items()):
        found.update(f"{name}\0".encode())
        found.update(hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()[:KEY_LENGTH]


def sources(module: str) -> dict[str, Path]:
    """Return the files of the module and of all of both packages that it imports, however late, by module name."""
    found: dict[str, Path] = {}
    left, seen = [module], {module}
    while left:
        name = left.pop()
        file = _source(name)
        if file is None:
            continue
        found[name] = file
        of_ours = {n for n in _imported(file, name) if n.partition(".")[0] in PACKAGES} - seen
        left += of_ours
        seen |= of_ours
    return found


def _source(module: str) -> Path | None:
    """The file of a module; None for a name that is within one."""
    if module.partition(".")[0] not in PACKAGES:
        return Path(str(sys.modules[module].__file__)) if hasattr(sys.modules.get(module), "__file__") else None
    place = ROOT.joinpath(*module.split("."))
    return next((f for f in (place.with_suffix(".py"), place / "__init__.py") if f.is_file()), None)


def _imported(file: Path, module: str) -> Iterator[str]:
    """Names that may be modules: a package before what is in it."""
    yield module.rpartition(".")[0]
    for package, names, modules in IMPORT.findall(file.read_text(encoding="utf-8")):
        yield package
        words = [part.split()[0] for part in (names or modules).strip("()").split(",") if part.strip()]
        yield from (f"{package}.{name}" if package else name for name in words)


def versions() -> dict[str, str]:
    """Return Python's version, without its last number, and those of the libraries that figures depend on; empty for
    none."""
    python = f"{sys.version_info.major}.{sys.version_info.minor}"
    return {"python": python} | {name: _version(name) for name in LIBRARIES}


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""


def digest(file: Path) -> str:
    """Return the SHA-256 of a file's contents. Raises InputError for one that cannot be read."""
    try:
        stat = file.stat()
        return _remembered(file, stat.st_mtime_ns, stat.st_size, stat.st_ino)
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror}", file=file, hint="check the path and your rights") from None


@lru_cache(REMEMBERED)
def _remembered(file: Path, _changed_ns: int, _size: int, _inode: int) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()


def plain_error(text: str, folder: str) -> str:
    """Return an error's text without what differs between places and runs: the folder, addresses in memory."""
    return MEMORY_ADDRESS.sub("0x…", text.replace(f"{folder}/", ""))


def _plain(value: Any) -> Any:
    if isinstance(value, Path):
        return value.as_posix()
    raise TypeError(f"a job's inputs are plain data, not {type(value).__name__}")
