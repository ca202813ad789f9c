"""What tells one question from another: digests of files, of the code and of plain inputs."""

import hashlib
import json
import sys
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from wrcd.errors import InputError

ROOT = Path(__file__).parents[2]
READ = {".py", ".c", ".h", ".json", ".toml", ".dbc"}  # what a run is made of, named in it or not
LIBRARIES = ("numpy", "scipy", "cantools", "python-can", "numba")  # another version of one may give another last digit
KEY_LENGTH = 32


@cache
def code() -> str:
    """Digest both packages' sources and data, and the versions of Python and the libraries."""
    found = hashlib.sha256(repr([sys.version_info[:2], *map(version, LIBRARIES)]).encode())
    files = (f for package in ("sim_ecu", "wrcd") for f in (ROOT / package).rglob("*") if f.suffix in READ)
    for name, file in sorted((f.relative_to(ROOT).as_posix(), f) for f in files):
        found.update(f"\0{name}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return found.hexdigest()[:KEY_LENGTH]


def key_of(question: Mapping[str, Any]) -> str:
    """Digest plain inputs and the code: the same anywhere for the same question."""
    text = json.dumps({**question, "code": code()}, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


def digest(file: Path) -> str:
    """Return the SHA-256 of a file's contents. Raises InputError for one that cannot be read."""
    try:
        stat = file.stat()
        return _remembered(file, stat.st_mtime_ns, stat.st_size, stat.st_ino)
    except OSError as e:
        raise InputError(f"cannot be read: {e.strerror}", file=file, hint="check the path and your rights") from None


@lru_cache(1024)
def _remembered(file: Path, _changed_ns: int, _size: int, _inode: int) -> str:
    with file.open("rb") as opened:
        return hashlib.file_digest(opened, "sha256").hexdigest()
