"""Reads a log of any format: its frames in the order of time, and what is odd about it."""

import codecs
import contextlib
import gzip
import io
import re
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any, Self, cast

from wrcd.bus.candump import parse_line
from wrcd.bus.frame import Frame
from wrcd.errors import InputError
from wrcd.logs.columns import Item, Stretch, parse_lines, stretches
from wrcd.logs.damage import Damage
from wrcd.logs.time_order import MonotonicTime, StrayStamps, TimeOrder, on_channel
from wrcd.progress import Progress

CHUNK_BYTES, READ_BYTES = 1 << 18, 1 << 13  # of a log, taken at once, and asked of the file at once
CANDUMP_SUFFIXES = {".log"}
# "  vcan0  123   [8]  11 22 33": with -t a stamp before it, with -c colours between
_SCREEN = re.compile(rb"[^#]*?\s[0-9A-Fa-f]{3,8}\b[^#]*?\[\d{1,2}\]")
FILE_ERRORS = (OSError, EOFError, zlib.error)  # of a file that may be packed
STANDARD_INPUT = Path("standard input")  # in messages
_DROPPED = re.compile(rb"DROPCOUNT: dropped (\d{1,9}) CAN frames? on .*")


class LogReader:
    """Reads the frames of one channel of a log; where none is named, it has to be the only one.

    A context manager: when its block has ended, damage, warnings and the clock's steps are those of what was read.
    Reading raises InputError for a log that is not there, that holds no frame, or several channels where none is named.
    """

    def __init__(self, path: Path, channel: str | None = None, *, shows: bool = False) -> None:
        """shows: on a terminal a line tells how far the log has come."""
        self.path, self.damage, self.clock = path, Damage(), MonotonicTime()
        self._channel, self._strays, self._order = channel, StrayStamps(path), TimeOrder(path)
        self._progress = Progress() if shows else None
        self._first_us: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.end()

    def written(self) -> Iterator[Item]:
        """Many frames at once where the log is regular, as written but for stray stamps."""
        items = on_channel(read_stretches(self.path, self.damage), self._channel, self.path)
        return self._shown(self._strays.put(items))

    def in_order(self) -> Iterator[Item]:
        """The same in the order of time: a log that is out of order by up to a second is sorted."""
        return self._order.put(self.written())

    def monotonic(self) -> Iterator[Item]:
        """The same with stamps of a time that goes on where the log's clock is set back."""
        return map(self.clock.moved, self.clock.items(self.in_order()))

    @property
    def whole(self) -> bool:
        """Whether all of the log could be read."""
        return self.damage.whole

    @property
    def warnings(self) -> list[str]:
        """Sentences on what is damaged or out of order; empty for a sound log."""
        return [*self.damage.warnings(self.path), *self._strays.warnings(), *self._order.warnings()]

    def _shown(self, items: Iterator[Item]) -> Iterator[Item]:
        if self._progress is None:
            yield from items
            return
        for number, item in enumerate(items):
            if isinstance(item, Stretch) or number % 1000 == 0:
                stamp_us = int(item.stamps_us[-1]) if isinstance(item, Stretch) else item[0].stamp_us
                self._first_us = stamp_us if self._first_us is None else self._first_us
                self._progress.at(f"{self.path.name}: {(stamp_us - self._first_us) * 1e-6:.0f} s of log")
            yield item


def log_suffix(path: Path) -> str:
    """What tells a log's format: its last suffix, without .gz."""
    return Path(path.name.removesuffix(".gz")).suffix.lower()


def read_log(path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of a log, oldest first as written. Raises InputError if there is no such log, or not one
    frame in it; damage is filled in on the way."""
    if log_suffix(path) in CANDUMP_SUFFIXES:
        with _errors(path, damage, *FILE_ERRORS):
            yield from _read_candump(path, damage)
        return
    from wrcd.logs import formats

    # every reader of python-can has its own way to fail
    with _errors(path, damage, Exception), _open(path) as file:
        for found in formats.read(path, log_suffix(path), file, damage):
            damage.read += 1
            yield found


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
def _errors(path: Path, damage: Damage, *kinds: type[Exception]) -> Iterator[None]:
    """What goes wrong with a log's file: an InputError, or damage where some of it was read."""
    try:
        yield
    except InputError:
        raise
    except (FileNotFoundError, IsADirectoryError):
        raise InputError("no such log", file=path, hint="check the path") from None
    except kinds as e:
        if isinstance(e, MemoryError):
            raise
        reason = str(e) or type(e).__name__
        if not damage.read:
            if isinstance(e, OSError) and e.errno:
                raise InputError(
                    f"cannot be read: {reason}", file=path, hint="check the path and your rights"
                ) from None
            raise InputError(f"cannot be read: {reason}", file=path, hint=_format_hint(path)) from None
        damage.stopped = reason
    if not damage.read:
        raise InputError("has not one readable frame", file=path, hint=_format_hint(path))


def _format_hint(path: Path) -> str:
    """What the suffix makes of a log."""
    from wrcd.logs.formats import NAMES

    suffix = log_suffix(path)
    if suffix in CANDUMP_SUFFIXES:
        return "a .log is read as candump -l or -L writes it: (1700000000.000000) can0 101#0011"
    known = ", ".join([*CANDUMP_SUFFIXES, *NAMES])
    what = NAMES.get(suffix)
    return (
        f"a {suffix} is read as {what}, by python-can; the suffix tells the format"
        if what
        else f"the suffix tells the format: {known}"
    )


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
    if number == 1:
        line = line.removeprefix(codecs.BOM_UTF8)
    found = parse_line(line.strip()) if len(line) < 400 else None
    if found is not None:
        damage.read += 1
    elif dropped := _DROPPED.fullmatch(line.strip()):
        damage.lost += int(dropped[1])
    elif line.strip():
        damage.note(number)
    return found


def read_stretches(path: Path, damage: Damage) -> Iterator[Item]:
    """The same log: where its lines or frames are regular, many at once; else frame by frame."""
    if log_suffix(path) not in CANDUMP_SUFFIXES:
        yield from stretches(read_log(path, damage))
        return
    with _errors(path, damage, *FILE_ERRORS):
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
        except FILE_ERRORS as e:
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


def _read_candump_stretches(path: Path, damage: Damage) -> Iterator[Item]:
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
