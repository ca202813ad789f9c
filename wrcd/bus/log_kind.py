"""Which format a log's name tells, and which one its first bytes look like."""

import gzip
import re
import zlib
from pathlib import Path

from wrcd.errors import InputError

_HEAD_BYTES = 1024
_GZIP = b"\x1f\x8b"
# what a format's files begin with, and their suffix
_KINDS = (
    (re.compile(rb"LOGG"), ".blf", "a BLF, Vector's binary log"),
    (re.compile(rb"MDF     |UnFinMF "), ".mf4", "an ASAM MDF"),
    (re.compile(rb"SQLite format 3\0"), ".db", "an SQLite database"),
    (re.compile(rb"\s*;\$FILEVERSION", re.IGNORECASE), ".trc", "a TRC, PEAK's text log"),
    (
        re.compile(rb"(?:\s*//[^\n]*\n)*\s*(?:date\s+\w+\s|base\s+(?:hex|dec)\b)", re.IGNORECASE),
        ".asc",
        "an ASC, Vector's text log",
    ),
    (re.compile(rb"\s*\(\d{1,11}\.\d{6}(?:\d{3})?\)\s+\S+\s+[0-9A-Fa-f]{3,8}#"), ".log", "a candump log"),
)


def log_suffix(path: Path) -> str:
    """What tells a log's format: its last suffix, without .gz."""
    return Path(path.name.removesuffix(".gz")).suffix.lower()


def check_log(path: Path) -> None:
    """Raises InputError for a folder, and for a file that is surely of another format than its suffix tells.

    A file that cannot be read, or that looks like nothing known, is left to its reader. A pipe is not looked into.
    """
    if path.is_dir():
        raise InputError("is a folder, not a log", file=path, hint="name a file in it")
    if not path.is_file():
        return
    head, zipped = _head(path)
    named_zipped = path.suffix == ".gz"
    found = next(((suffix, name) for pattern, suffix, name in _KINDS if pattern.match(head)), None)
    if found is not None and (found[0] != log_suffix(path) or zipped != named_zipped):
        suffix, looks_like = found
    elif zipped and not named_zipped:
        suffix, looks_like = log_suffix(path), "a file"
    else:
        return
    told = "".join(Path(path.name).suffixes[-2:] if named_zipped else path.suffix) or "its name"
    raise InputError(
        f"looks like {looks_like}{' packed by gzip' * zipped}, {told} says otherwise",
        file=path,
        hint=f"the suffix tells the format: rename it to end in {suffix}{'.gz' * zipped}",
    )


def _head(path: Path) -> tuple[bytes, bool]:
    """The first bytes of a file, unpacked, and whether it is packed by gzip."""
    zipped = False
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
            zipped = head.startswith(_GZIP)
            if zipped:
                file.seek(0)
                with gzip.GzipFile(fileobj=file) as unpacked:
                    head = unpacked.read(_HEAD_BYTES)
    except (OSError, EOFError, zlib.error):
        head = b""
    return head, zipped
