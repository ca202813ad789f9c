"""Logs in the formats of python-can: its readers, watched, so that what they skip, lose or stumble over is reported."""

import io
import logging
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, TextIO, cast

import can

from wrcd.bus.frame import Frame
from wrcd.bus.pythoncan import from_message
from wrcd.errors import InputError
from wrcd.logs.damage import Damage

# What its readers cannot take is reported as damage; raw lines of theirs on the terminal say nothing more.
logging.getLogger("can.io").addHandler(logging.NullHandler())

# A reader of text begins anew behind a damaged line. It takes the line given here for the last one of the header.
_READERS: dict[str, tuple[Any, str]] = {
    ".asc": (can.ASCReader, "internal events logged\n"),
    ".csv": (can.CSVReader, "\n"),
    ".trc": (can.TRCReader, ""),
}
TEXT = frozenset(_READERS)
FROM_FILE = TEXT | {".blf", ".mf4"}
# What a line that is no frame may be. Whatever else a reader skips is damaged.
_NO_FRAME = {
    # a header, a comment, a trigger, or an event whose third word is no id
    ".asc": re.compile(
        r"\s*(?:$|//|;|date\b|base\b|begin\b|end\b|(?:no\s+)?internal events|previous log file|"
        r"\d+\.\d+\s+(?:start of measurement|log\b|[a-z][\w:]*\b|\d+\s+(?![\da-f]+x?\s)\w+:?(?:\s|$)))",
        re.IGNORECASE | re.ASCII,
    ),
    ".csv": re.compile(r"\s*$"),
    # a comment, or a line of one of the kinds that carry no data: status, error counters, hardware, events
    ".trc": re.compile(
        r"\s*(?:$|;|\d+\)?\s+\d+(?:\.\d+)?\s+(?:\d+\s+)?(?:ST|EC|ER|EV|SG|Error|Warng|Event|FFFFFFFF)\b)", re.ASCII
    ),
}
# stamps that count from the line before, whatever it is
_DELTA = re.compile(r"\s*base\s+(?:hex|dec)\s+timestamps\s+relative\b", re.IGNORECASE)
_BEGIN, _END = re.compile(r"\s*begin\s+trigger", re.IGNORECASE), re.compile(r"\s*end\s+trigger", re.IGNORECASE)
MAX_STAMP_US = 10**17  # the year 5138: a later stamp is damage
_HEADER_BYTES, _PADDING_BYTES = 16, 3  # of an object in a .blf


class Lines:
    """A log's lines one by one, as a reader of python-can asks for them. A last line without its end is left out."""

    def __init__(self, file: IO[bytes], suffix: str, damage: Damage) -> None:
        self._file, self._no_frame, self._damage = file, _NO_FRAME[suffix], damage
        self._is_table = suffix == ".csv"
        self._again: list[str] = []
        self._line, self._used = "", True
        self._is_asc = suffix == ".asc"
        self.number = 0
        self.open_trigger = self.has_deltas = False

    def push(self, line: str) -> None:
        """Give this line next."""
        if line:
            self._again.append(line)

    def used(self) -> None:
        """The line was a frame."""
        self._used = True

    def damaged(self) -> None:
        """The line was to be a frame, and is none."""
        self._damage.note(self.number)
        self._used = True

    def end_line(self) -> None:
        """Judge the line of which nothing came."""
        if not self._used and not self._no_frame.match(self._line):
            self.damaged()
        self._used = True

    def __iter__(self) -> "Lines":
        return self

    def __next__(self) -> str:
        self.end_line()
        if self._again:
            return self._again.pop()
        # every byte is a character: only frames count, and they are ASCII
        try:
            line = self._file.readline().decode("latin-1")
        except (OSError, EOFError, zlib.error) as e:
            self._damage.stopped = f"damaged there ({e})"
            raise StopIteration from None
        if not line:
            raise StopIteration
        self.number += 1
        if not line.endswith("\n"):
            if self._no_frame.match(line) and _END.match(line):
                self.open_trigger = False
            else:
                self._damage.cut_line = self.number
            raise StopIteration
        self.open_trigger = not _END.match(line) and (self.open_trigger or bool(_BEGIN.match(line)))
        self.has_deltas = self.has_deltas or (self._is_asc and bool(_DELTA.match(line)))
        # the head of a table is whatever its writer calls it
        self._line, self._used = line, self._is_table and self.number == 1
        return line

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class Objects(io.RawIOBase):
    """A .blf as python-can's reader reads it: an object's header, its data, its padding. Notes data that end early."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._data_next, self.cut = file, False, False
        self.reads = 0

    def read(self, size: int = -1) -> bytes:
        """As the file's."""
        data = self._file.read(size)
        self.reads += 1
        if self._data_next:
            self.cut, self._data_next = self.cut or len(data) < size, False
        else:
            self._data_next = size == _HEADER_BYTES and data.startswith(b"LOBJ")
        return data

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_text(file: IO[bytes], suffix: str, path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of an .asc, .csv or .trc. Damaged lines are left out and noted."""
    kind, header_end = _READERS[suffix]
    lines = Lines(file, suffix, damage)
    reader = kind(cast(TextIO, lines))
    messages, first_error, began_at = iter(reader), "", 0
    while True:
        try:
            message = next(messages, None)
            if message is None:
                break
            found = _frame(message)
        except Exception as e:  # every reader has its own way to fail on a damaged line
            first_error = first_error or str(e)
            if lines.number == began_at:  # not for a line: there is none left
                break
            found, began_at = None, lines.number
            lines.damaged()
            lines.push(header_end)
            messages = iter(reader)
        else:
            lines.used()
            if found is None:
                lines.damaged()
        if lines.has_deltas:
            raise _has_deltas(path)
        if found is not None:
            damage.read += 1
            yield found
    if lines.has_deltas:
        raise _has_deltas(path)
    lines.end_line()
    if not damage.read and first_error:
        raise _unreadable(suffix, first_error, path)
    if lines.open_trigger and damage.cut_line is None and damage.stopped is None:
        damage.stopped = "its trigger block has no end: cut off"


def read_binary(file: IO[bytes] | None, suffix: str, path: Path, damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of any other format; file is None for those that take a path."""
    objects = Objects(file) if file is not None and suffix == ".blf" else None
    reader: Any = None
    try:
        if objects is not None:
            reader = can.BLFReader(cast(Any, objects))
        elif suffix == ".mf4" and file is not None:
            reader = can.MF4Reader(cast(Any, file))
        else:
            reader = can.LogReader(path)
        at = None
        for number, message in enumerate(reader, 1):
            if objects is not None:
                before, at = at, (objects.reads, reader._pos)
                if at == before:  # an object without a length: the reader would give it for ever
                    raise ValueError("an object has no length")
            found = _frame(message)
            if found is None:
                damage.note(number)
                continue
            damage.read += 1
            yield found
        if objects is not None and objects.cut:
            damage.stopped = "cut off in the middle of an object"
        elif left := len(getattr(reader, "_tail", b"")) - _PADDING_BYTES:
            damage.stopped = f"{left + _PADDING_BYTES} bytes behind it are no objects" if left > 0 else None
    except GeneratorExit:
        raise
    except Exception as e:  # every reader has its own way to fail on a damaged file
        if not damage.read:
            raise _unreadable(suffix, str(e), path) from None
        damage.stopped = f"damaged there ({str(e) or type(e).__name__})"
    finally:
        if reader is not None:
            reader.stop()


def _has_deltas(path: Path) -> InputError:
    return InputError(
        "each of its stamps counts from the line before (timestamps relative): their roundings and any line that is "
        "missing would add up",
        file=path,
        hint="export it again with absolute timestamps",
    )


def _unreadable(suffix: str, reason: str, path: Path) -> InputError:
    hint = "the suffix tells the format; candump logs end in .log"
    return InputError(f"cannot be read as {suffix or 'a log'}: {reason}", file=path, hint=hint)


def _frame(m: can.Message) -> tuple[Frame, str] | None:
    """A message as frame and channel; None if no bus can carry it, if its data is not as long as it says,
    or if its time is none."""
    frame = from_message(m, round(m.timestamp * 1e6))
    if not frame.possible or abs(frame.stamp_us) > MAX_STAMP_US:
        return None
    if not (frame.remote or frame.error or len(frame.data) == m.dlc):
        return None
    return frame, str(m.channel if m.channel is not None else "can0")
