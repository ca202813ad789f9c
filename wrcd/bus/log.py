"""Logs: candump's own format read line by line, so that damage is survived and named; the rest by python-can."""

import contextlib
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, cast

from wrcd.bus.damage import Damage
from wrcd.bus.frame import Frame
from wrcd.bus.log_kind import check_log, log_suffix
from wrcd.errors import InputError

if TYPE_CHECKING:
    from wrcd.bus.columns import Stretch

__all__ = ["Damage", "format_line", "log_suffix", "parse_line", "read_lines", "read_log", "read_stretches"]
CHUNK_BYTES, READ_BYTES = 1 << 18, 1 << 13  # of a log, taken at once, and asked of the file at once
CANDUMP_SUFFIXES = {".log"}
# (1700000000.123456) can0 091#0011223344556677 — with -N nine decimals; an id of 3 or 8 digits; R for remote and the
# length asked for; ## and a flag digit for CAN FD; _ and a DLC above 8 behind 8 bytes; and perhaps a direction (-x)
_LINE = re.compile(
    rb"\((\d{1,11})\.(\d{6})(?:\d{3})?\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#([0-9A-Fa-f]))?"
    rb"(?:([Rr])([0-8]?)|((?:[0-9A-Fa-f]{2})*))(?:_([9A-Fa-f]))?(?:\s+[RT])?\s*"
)
# "  vcan0  123   [8]  11 22 33": with -t a stamp before it, with -c colours between
_SCREEN = re.compile(rb"[^#]*?\s[0-9A-Fa-f]{3,8}\b[^#]*?\[\d{1,2}\]")
STANDARD_INPUT = Path("standard input")  # in messages
_DROPPED = re.compile(rb"DROPCOUNT: dropped (\d{1,9}) CAN frames? on .*")
_ERROR_FLAG = 0x20000000


def parse_line(line: bytes) -> tuple[Frame, str] | None:
    """A candump line as (frame, channel), or None if it is not one."""
    m = _LINE.fullmatch(line)
    if m is None:
        return None
    number = int(m[4], 16)
    extended = len(m[4]) == 8
    error = extended and bool(number & _ERROR_FLAG)
    data = bytes.fromhex(m[8].decode()) if m[8] else b""
    remote, fd = m[6] is not None, m[5] is not None
    if m[9] is not None and (fd or (len(data) if not remote else int(m[7] or b"0")) != 8):
        return None
    extra = int(m[9] or m[5] or m[7] or b"0", 16)
    frame = Frame(
        int(m[1]) * 1_000_000 + int(m[2]), number & 0x1FFFFFFF if extended else number, data,
        extended and not error, remote, error, fd, extra,
    )  # fmt: skip
    return (frame, m[3].decode(errors="replace")) if frame.possible and not (remote and fd) else None


def format_line(frame: Frame, channel: str) -> str:
    """A frame as candump writes it."""
    number = frame.can_id | (_ERROR_FLAG if frame.error else 0)
    ident = f"{number:08X}" if frame.extended or frame.error else f"{number:03X}"
    extra, tail = frame.extra, ""
    if frame.fd:
        mark = f"##{extra:X}"
    elif frame.remote:
        mark = f"#R8_{extra:X}" if extra > 8 else f"#R{extra}" if extra else "#R"
    else:
        mark, tail = "#", f"_{extra:X}" if extra > 8 else ""
    stamp = f"({frame.stamp_us // 1_000_000:010d}.{frame.stamp_us % 1_000_000:06d})"
    return f"{stamp} {channel} {ident}{mark}{frame.data.hex().upper()}{tail}"


def read_log(path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of a log, oldest first as written. Raises InputError if there is no such log, or not one
    frame in it; damage is filled in on the way."""
    with _errors(path, damage):
        if log_suffix(path) in CANDUMP_SUFFIXES:
            yield from _read_candump(path, damage)
        else:
            yield from _read_other(path, damage)


def read_lines(lines: Iterable[bytes], damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of the lines of a candump log as they come, each before the next is asked for.

    Raises InputError for what candump shows on a screen, which has no stamps that could be relied on, and if there is
    not one frame; damage is filled in on the way.
    """
    for number, line in enumerate(lines, 1):
        found = _read_line(line, number, damage)
        if found is not None:
            yield found
        elif not damage.read and _SCREEN.match(line[:200]):
            raise InputError("is what candump shows on a screen", file=STANDARD_INPUT, line=number, hint="candump -L")
    if not damage.read:
        raise InputError("has not one readable frame", file=STANDARD_INPUT, hint="candump -L vcan0 | wrcd dump -")


@contextlib.contextmanager
def _errors(path: Path, damage: Damage) -> Iterator[None]:
    """What goes wrong with a log's file: an InputError, or damage where some of it was read."""
    check_log(path)
    try:
        yield
    except (OSError, EOFError, zlib.error) as e:
        if isinstance(e, FileNotFoundError):
            raise InputError("no such log", file=path, hint="check the path") from None
        if not damage.read:
            raise InputError(f"cannot be read: {e}", file=path) from None
        damage.stopped = f"damaged there ({e})"
    if not damage.read:
        raise InputError("has not one readable frame", file=path, hint="a candump log (candump -l or -L) ends in .log")


def _open(path: Path) -> IO[bytes]:
    return cast(IO[bytes], gzip.open(path, "rb")) if path.suffix == ".gz" else path.open("rb")


def _read_candump(path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    with _open(path) as f:
        for number, line in enumerate(f, 1):
            found = _read_line(line, number, damage)
            if found is not None:
                yield found


def _read_line(line: bytes, number: int, damage: Damage) -> tuple[Frame, str] | None:
    """A line of a candump log; what is no frame is noted."""
    if not line.endswith(b"\n"):
        # a killed candump leaves half a line, and half a line may look like a shorter frame
        damage.cut_line = number
        return None
    found = parse_line(line.strip()) if len(line) < 400 else None
    if found is not None:
        damage.read += 1
    elif dropped := _DROPPED.fullmatch(line.strip()):
        damage.lost += int(dropped[1])
    elif line.strip():
        damage.note(number)
    return found


def read_stretches(path: Path, damage: Damage) -> Iterator["Stretch | tuple[Frame, str]"]:
    """The same log: where its lines or frames are regular, many at once; else frame by frame."""
    if log_suffix(path) not in CANDUMP_SUFFIXES:
        from wrcd.bus.columns import stretches

        yield from stretches(read_log(path, damage))
        return
    with _errors(path, damage):
        yield from _read_candump_stretches(path, damage)


def _whole_lines(file: Any) -> Iterator[bytes]:
    """A file by chunks of whole lines; the last may lack its end. What has been read when the file turns out to be
    damaged comes before the error."""
    rest = b""
    while True:
        parts, wanted, failed = [rest], CHUNK_BYTES, None
        try:
            # never more at once than the file's own buffer: an error loses what its call has read
            while wanted > 0 and (part := file.read1(READ_BYTES)):
                parts.append(part)
                wanted -= len(part)
        except (OSError, EOFError, zlib.error) as e:
            failed = e
        text = b"".join(parts)
        end = text.rfind(b"\n") + 1
        if end:
            yield text[:end]
        rest = text[end:]
        if failed is not None:
            raise failed
        if wanted > 0:  # the end of the file
            if rest:
                yield rest
            return


def _read_candump_stretches(path: Path, damage: Damage) -> Iterator["Stretch | tuple[Frame, str]"]:
    from wrcd.bus.columns import parse_lines

    number = 0  # of the newest line
    with _open(path) as f:
        for text in _whole_lines(f):
            parsed = parse_lines(text) if text.endswith(b"\n") else None
            if parsed is None:
                for line in io.BytesIO(text):
                    number += 1
                    if (found := _read_line(line, number, damage)) is not None:
                        yield found
                continue
            whole, regular, starts, ends = parsed
            for first, end in whole.runs(regular):
                if regular[first]:
                    damage.read += end - first
                    yield whole.part(first, end)
                    continue
                for k in range(first, end):
                    found = _read_line(text[starts[k] : ends[k] + 1], number + k + 1, damage)
                    if found is not None:
                        yield found
            number += len(regular)


def _read_other(path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    from wrcd.bus import log_formats

    suffix = log_suffix(path)
    takes_a_path = suffix == ".db" or (suffix not in log_formats.FROM_FILE and path.suffix != ".gz")
    if takes_a_path and not path.exists():
        raise FileNotFoundError(path)
    if takes_a_path:
        yield from log_formats.read_binary(None, suffix, path, damage)
        return
    with _open(path) as file:
        read = log_formats.read_text if suffix in log_formats.TEXT else log_formats.read_binary
        yield from read(file, suffix, path, damage)
