"""A bounded folder of dumps. What is there under a dump's name is complete, and no link is followed."""

import errno
import os
import re
import stat
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

LOG, EVENTS = ".log", ".events.csv"
_NAME = re.compile(r"(wrcd-.+-\d{8}T\d{6}Z-[a-z]+)\.[a-z.]+")  # whatever a version has beside its log


def dump_name(channel: str, now_us: int, trigger: str) -> str:
    """Without a suffix: wrcd-can0-20261121T172446Z-validity."""
    when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now_us // 1_000_000))
    return f"wrcd-{safe_channel_name(channel)}-{when}-{trigger}"


def safe_channel_name(channel: str) -> str:
    """A channel as a word for file names and logs."""
    return re.sub(r"[^A-Za-z0-9_.]", "_", channel)[:40] or "can"


def write_dump(folder: Path, name: str, log: Iterable[bytes], events: bytes, max_dumps: int, max_bytes: int) -> None:
    """Write name.log and name.events.csv, and remove the oldest dumps beyond so many and so many bytes. Raises OSError;
    then there is neither."""
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    # what a killed process of this channel's has left
    channel = name[: name.rindex("-", 0, name.rindex("-")) + 1]
    for left in folder.glob(f".{channel}*.part"):
        left.unlink()
    parts = {suffix: folder / f".{name}{suffix}.part" for suffix in (EVENTS, LOG)}
    try:
        size = _write(parts[LOG], log, max_bytes)
        size += _write(parts[EVENTS], (events,), max_bytes - size)
        _prune(folder, max_dumps - 1, max_bytes - size)
        for suffix, part in parts.items():  # the log last: where it is, the events are
            part.replace(folder / (name + suffix))
    except BaseException:
        for part in parts.values():
            part.unlink(missing_ok=True)
        raise


def _write(path: Path, chunks: Iterable[bytes], max_bytes: int) -> int:
    """A file that was not there before, on the disk; its size. Raises OSError."""
    size = 0
    # O_EXCL: whatever is there under this name, a link too, is not written to
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(fd, "wb") as f:
        for chunk in chunks:
            size += len(chunk)
            if size > max_bytes:
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            f.write(chunk)
        f.flush()
        os.fsync(fd)
    return size


def _prune(folder: Path, max_dumps: int, max_bytes: int) -> None:
    """Remove the oldest dumps until the rest fits. Only regular files of dumps' names count."""
    found: dict[str, dict[Path, os.stat_result]] = {}
    for file in folder.iterdir():
        if (match := _NAME.fullmatch(file.name)) and stat.S_ISREG((status := file.lstat()).st_mode):
            found.setdefault(match[1], {})[file] = status
    count, size = len(found), sum(s.st_size for files in found.values() for s in files.values())
    for _, files in sorted(found.items(), key=lambda item: (min(s.st_mtime_ns for s in item[1].values()), item[0])):
        if count <= max_dumps and size <= max_bytes:
            break
        for file in files:
            file.unlink(missing_ok=True)
        count, size = count - 1, size - sum(s.st_size for s in files.values())
