"""A bounded folder of dumps, and what is kept beside them. What is there under its name is complete, and no link is
followed. python -m wrcd.recorder.dump_folder FILE TEXT, an open file, writes one that is kept; it imports little.
"""

import errno
import os
import re
import stat
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

LOG, EVENTS, STATE = ".log", ".events.csv", ".state.json"
_NAME = re.compile(r"(wrcd-.+-\d{8}T\d{6}Z-[a-z]+)\.(log|events\.csv|state\.json)")
_FULL = (errno.ENOSPC, errno.EDQUOT)
ERRNO = 100  # the exit status of a program that failed: an errno behind it


def dump_name(channel: str, now_us: int, trigger: str) -> str:
    """Without a suffix: wrcd-can0-20261121T172446Z-validity."""
    when = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now_us // 1_000_000))
    return f"wrcd-{safe_channel_name(channel)}-{when}-{trigger}"


def safe_channel_name(channel: str) -> str:
    """A channel as a word for file names and logs."""
    return re.sub(r"[^A-Za-z0-9_.]", "_", channel)[:40] or "can"


def write_dump(
    folder: Path, name: str, log: Iterable[bytes], events: bytes, state: bytes, max_dumps: int, max_bytes: int
) -> None:
    """Write name.log, name.events.csv and name.state.json, and remove the oldest dumps beyond so many and so many
    bytes. Raises OSError; then there is none of them."""
    make_folder(folder)
    # what a killed process of this channel's has left
    channel = name[: name.rindex("-", 0, name.rindex("-")) + 1]
    for left in folder.glob(f".{channel}*.part"):
        with suppress(OSError):
            left.unlink()
    made = {folder / (name + suffix): folder / f".{name}{suffix}.part" for suffix in (EVENTS, STATE, LOG)}
    events_file, state_file, log_file = made
    renamed: list[Path] = []
    try:
        size = _write(made[log_file], log, max_bytes)
        for file, data in ((events_file, events), (state_file, state)):
            size += _write(made[file], (data,), max_bytes - size)
        dumps = _dumps(folder)
        while dumps and (len(dumps) >= max_dumps or size + sum(map(_bytes, dumps)) > max_bytes):
            _remove(dumps.pop(0))
        for file, part in made.items():  # the log last: where it is, the others are
            part.replace(file)
            renamed.append(file)
        _sync(folder)
    except BaseException:
        for file in (*made.values(), *renamed):
            file.unlink(missing_ok=True)
        raise


def make_folder(folder: Path) -> None:
    """Where it is not there yet."""
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)


def write_whole(file: Path, data: bytes) -> None:
    """A file whose old content is there until the new one is. Raises OSError; then the old one is still there."""
    make_folder(file.parent)
    part = file.with_name(f".{file.name}.{os.getpid()}.part")
    part.unlink(missing_ok=True)
    try:
        _write(part, (data,), len(data))
        part.replace(file)
        _sync(file.parent)
    finally:
        part.unlink(missing_ok=True)


def _sync(folder: Path) -> None:
    folder_fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(folder_fd)
    finally:
        os.close(folder_fd)


def _write(path: Path, chunks: Iterable[bytes], max_bytes: int) -> int:
    """A file that was not there before, on the disk; its size. Where the disk is full the oldest dumps go. Raises
    OSError."""
    size = 0
    # O_EXCL: whatever is there under this name, a link too, is not written to
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        for chunk in chunks:
            size, rest = size + len(chunk), memoryview(chunk)
            if size > max_bytes:
                raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))
            while rest:
                try:
                    rest = rest[os.write(fd, rest) :]
                except OSError as e:
                    if e.errno not in _FULL or not (dumps := _dumps(path.parent)):
                        raise
                    _remove(dumps[0])
        os.fsync(fd)
    finally:
        os.close(fd)
    return size


_Dump = dict[Path, os.stat_result]


def _dumps(folder: Path) -> list[_Dump]:
    """The files of each dump that is there, the oldest first. Only regular files of dumps' names count."""
    found: dict[str, _Dump] = {}
    for file in folder.iterdir():
        with suppress(FileNotFoundError):  # somebody tidies up
            if (match := _NAME.fullmatch(file.name)) and stat.S_ISREG((status := file.lstat()).st_mode):
                found.setdefault(match[1], {})[file] = status
    return [found[name] for name in sorted(found, key=lambda n: (min(s.st_mtime_ns for s in found[n].values()), n))]


def _bytes(dump: _Dump) -> int:
    return sum(status.st_size for status in dump.values())


def _remove(dump: _Dump) -> None:
    for file in dump:
        file.unlink(missing_ok=True)


if __name__ == "__main__":
    try:
        write_whole(Path(sys.argv[1]), os.pread(int(sys.argv[2]), 4096, 0))
    except OSError as error:
        sys.exit(ERRNO + (error.errno or 0))
