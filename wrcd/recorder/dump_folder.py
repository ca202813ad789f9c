"""A bounded folder of dumps. What is there under a dump's name is complete, and no link is followed."""

import errno
import os
import re
import stat
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

LOG, STATE, EVENTS = ".log", ".state.json", ".events.csv"
_NAME = re.compile(r"(wrcd-.+-\d{8}T\d{6}Z-[a-z]+)(\.log|\.state\.json|\.events\.csv)")


@dataclass(frozen=True, slots=True)
class Bound:
    """How much a folder of dumps may hold: dumps (a log with its state and its events is one) and bytes."""

    dumps: int
    size: int


def dump_name(channel: str, now_us: int, trigger: str) -> str:
    """Without a suffix: wrcd-can0-20261121T172446Z-validity."""
    when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now_us // 1_000_000))
    return f"wrcd-{safe_channel_name(channel)}-{when}-{trigger}"


def safe_channel_name(channel: str) -> str:
    """A channel as a word for file names and logs."""
    return re.sub(r"[^A-Za-z0-9_.]", "_", channel)[:40] or "can"


def write_dump(folder: Path, name: str, log: bytes, state: bytes, events: bytes, bound: Bound) -> None:
    """Write name.log, name.state.json and name.events.csv, and remove the oldest dumps beyond the bound, before and
    after. Raises OSError; then there is no log."""
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    at = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        _remove_left_over(at, name)
        size = len(log) + len(state) + len(events)
        if size > bound.size:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
        _prune(at, Bound(bound.dumps - 1, bound.size - size))
        temporaries = {suffix: f".{name}{suffix}.part" for suffix in (STATE, EVENTS, LOG)}
        try:
            write_new(at, temporaries[STATE], state)
            write_new(at, temporaries[EVENTS], events)
            write_new(at, temporaries[LOG], log)
            for suffix, temporary in temporaries.items():  # the log last: where it is, the others are
                os.rename(temporary, name + suffix, src_dir_fd=at, dst_dir_fd=at)
        except BaseException:
            for left in temporaries.values():
                with suppress(OSError):
                    os.unlink(left, dir_fd=at)
            raise
        _prune(at, bound, keep=name)
        os.fsync(at)
    finally:
        os.close(at)


def write_new(at: int, name: str, data: bytes) -> None:
    """A file that was not there before, in an open folder, and on the disk. Raises OSError."""
    # O_EXCL: whatever is there under this name, a link too, is not written to
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
    fd = os.open(name, flags, 0o600, dir_fd=at)
    try:
        rest = memoryview(data)
        while rest:
            rest = rest[os.write(fd, rest[: 1 << 20]) :]
        os.fsync(fd)
    finally:
        os.close(fd)


def _remove_left_over(at: int, name: str) -> None:
    """What a killed child of this channel's left behind, or somebody put there."""
    mine = "." + name[: name.rindex("-", 0, name.rindex("-")) + 1]
    for left in os.listdir(at):
        if left.startswith(mine) and left.endswith(".part"):
            with suppress(OSError):
                os.unlink(left, dir_fd=at)


def _prune(at: int, bound: Bound, keep: str = "") -> None:
    """Remove the oldest dumps until the rest fits. Only regular files of dumps' names count."""
    found: dict[str, list[os.stat_result]] = {}
    for file in os.listdir(at):
        if match := _NAME.fullmatch(file):
            with suppress(FileNotFoundError):
                status = os.stat(file, dir_fd=at, follow_symlinks=False)
                if stat.S_ISREG(status.st_mode):
                    found.setdefault(match[1], []).append(status)
    # those of an ordinary end before those of a trouble: a daemon that ends again and again must not push these out
    oldest_first = sorted(
        found,
        key=lambda name: (name == keep, not name.endswith("-exit"), min(s.st_mtime_ns for s in found[name]), name),
    )
    count, size = len(found), sum(s.st_size for group in found.values() for s in group)
    for name in oldest_first:
        if (count <= bound.dumps and size <= bound.size) or name == keep:
            break
        for suffix in (LOG, STATE, EVENTS):  # no log without its state
            with suppress(FileNotFoundError):
                os.unlink(name + suffix, dir_fd=at)
        count, size = count - 1, size - sum(s.st_size for s in found[name])
