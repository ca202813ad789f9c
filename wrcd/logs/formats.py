"""Logs in the formats of python-can, by its own readers. What those do not notice is not noticed here."""

import codecs
import contextlib
import io
import logging
import re
import struct
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import IO, Any, cast

import can
from can.io.generic import BinaryIOMessageReader, MessageReader, TextIOMessageReader

from wrcd.bus.frame import Frame
from wrcd.bus.pythoncan import from_message
from wrcd.errors import InputError
from wrcd.logs.damage import Damage

NAMES = {
    ".asc": "Vector's text", ".blf": "Vector's binary", ".trc": "PEAK's text", ".csv": "python-can's own text",
    ".db": "python-can's own database", ".mf4": "ASAM MDF with CAN frames",
}  # fmt: skip

MAX_STAMP_US = 10**17  # the year 5138
BLF_WRAP_S = 2**64 * 1e-9  # a stamp before the begin, as of a pre-trigger: python-can reads it without its sign
MF4_LOCAL_TIME = 1  # a flag of the header
MIN_LONG_ID = 0x800
CSV_BEGIN, HEAD_BYTES = b"timestamp,arbitration_id,", 100
BLF_HEADER, BLF_SIZE_AT = 16, 8  # bytes of an object's header; where in it the object's length and kind stand
BLF_UNREAD = (2, 3, 104)  # CAN_ERROR, CAN_OVERLOAD, CAN_FD_ERROR_64


def read(path: Path, suffix: str, file: IO[bytes], damage: Damage) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of a log, which is open as file. Raises what python-can raises, and ValueError for a frame
    that there cannot be. Lines that python-can gives up are damaged ones."""
    with _reader(path, suffix, file, damage) as reader, _given_up(damage):
        for message in reader:
            if isinstance(reader, can.ASCReader) and (reader.timestamps_format or "").lower() == "relative":
                raise InputError(
                    "each of its stamps counts from the line before (timestamps relative): python-can takes them for "
                    "times since its begin",
                    file=path,
                    hint="export it again with absolute timestamps",
                )
            if isinstance(reader, can.BLFReader) and message.timestamp - reader.start_timestamp > BLF_WRAP_S / 2:
                message.timestamp -= BLF_WRAP_S
            yield _frame(message), str(message.channel if message.channel is not None else "can0")
        if isinstance(reader, _BlfReader) and reader.unread:
            damage.left_out.append(f"{reader.unread} error or overload frames of kinds that python-can does not read")


@contextlib.contextmanager
def _given_up(damage: Damage) -> Iterator[None]:
    """python-can logs a .trc's lines that it cannot read, and goes on."""

    class Count(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if "".join(map(str, record.args or ())).strip():  # a blank line is none
                damage.note()

    logger, handler = logging.getLogger("can.io.trc"), Count(logging.WARNING)
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)


class _BlfReader(can.BLFReader):
    """Ends at an object that is shorter than its header: python-can reads one of length 0 without an end. Counts
    objects that are frames and that it leaves out."""

    unread = 0

    def _parse_container(self, data: bytes) -> Iterator[can.Message]:
        whole = self._tail + data
        at = whole.find(b"LOBJ", 0, 8)  # as far as python-can looks
        while 0 <= at <= len(whole) - BLF_HEADER:
            size, kind = struct.unpack_from("<LL", whole, at + BLF_SIZE_AT)
            if size < BLF_HEADER:
                yield from super()._parse_container(data[: max(at - len(self._tail), 0)])
                raise ValueError(f"an object of length {size}")
            self.unread += kind in BLF_UNREAD and at + size <= len(whole)
            at = whole.find(b"LOBJ", at + size, at + size + 8)
        yield from super()._parse_container(data)


class _AscLines:
    """Lines of an .asc, for a reader that loses the line with which it finds the header to be over, which may be a
    frame, takes "CANFD Start of measurement" for one, and a blank line for the header's end."""

    _NO_FRAME = re.compile(r"\s*(;.*)?$|\s*\d+\.\d+\s+CANFD\s+[A-Z][a-z]+\s")
    _BASE = re.compile(r"\s*base\s", re.IGNORECASE)

    def __init__(self, file: Any) -> None:
        self._file, self._again = file, ""

    def __iter__(self) -> Iterator[str]:
        while line := self._again or self._file.readline():
            self._again = line  # who breaks off here and begins anew gets it again
            if not self._NO_FRAME.match(line):
                yield line.lower() if self._BASE.match(line) else line
            self._again = ""

    def close(self) -> None:
        """Of the file."""
        self._file.close()


class _LongIds:
    """Of an iterator over a group of frames, whose chunks it sees."""

    def _get_data(self, offset: int) -> Any:
        data = super()._get_data(offset)  # type: ignore[misc]  # of the iterator beside it
        name = vars(self)["_name"]
        has_ide = f"{name}.IDE" in data.samples[0].dtype.names
        self._ids = None if has_ide else iter(data[f"{name}.ID"].tolist())
        return data

    def __iter__(self) -> Iterator[can.Message]:
        for message in super().__iter__():  # type: ignore[misc]
            if self._ids is not None:
                message.is_extended_id = next(self._ids) >= MIN_LONG_ID
            yield message


def _mf4_reader(damage: Damage) -> type[BinaryIOMessageReader]:
    """python-can's reader. Error frames that it may not understand are left out, with a warning. Where no member IDE
    tells ids of 29 bits, bit 31 does, which python-can drops, or their size. A begin in local time is
    somebody's, and a warning names it."""

    class Mf4Reader(can.MF4Reader):
        class _CANDataFrameIterator(_LongIds, can.MF4Reader._CANDataFrameIterator):  # type: ignore[misc]
            pass

        class _CANRemoteFrameIterator(_LongIds, can.MF4Reader._CANRemoteFrameIterator):  # type: ignore[misc]
            pass

        class _CANErrorFrameIterator(can.MF4Reader._CANErrorFrameIterator):
            def __iter__(self) -> Generator[can.Message, None, None]:
                try:
                    yield from super().__iter__()
                except (LookupError, ValueError, TypeError, AttributeError) as e:
                    damage.left_out.append(f"a group of error frames, which python-can cannot read: {e!r}")

        def __init__(self, file: Any) -> None:
            super().__init__(file)
            if getattr(self._mdf.header, "time_flags", 0) & MF4_LOCAL_TIME:  # what is no MDF 4 has other words for it
                damage.remarks.append("its begin is in local time, which is taken for this computer's")

    return Mf4Reader


def _reader(path: Path, suffix: str, file: IO[bytes], damage: Damage) -> MessageReader:
    kind: Any = _BlfReader if suffix == ".blf" else can.io.MESSAGE_READERS.get(suffix)
    kind = _mf4_reader(damage) if suffix == ".mf4" else kind
    if kind is not None and issubclass(kind, TextIOMessageReader):
        if cast(io.BufferedReader, file).peek(3).startswith(codecs.BOM_UTF8):
            file.read(len(codecs.BOM_UTF8))
        # every byte is a character: only frames count, and they are ASCII
        if suffix == ".csv":
            _check_csv(path, cast(io.BufferedReader, file).peek(HEAD_BYTES))
        reader: MessageReader = kind(io.TextIOWrapper(file, encoding="latin-1"))
        if suffix == ".asc":
            vars(reader)["file"] = _AscLines(vars(reader)["file"])
        return reader
    if kind is not None and issubclass(kind, BinaryIOMessageReader):
        return cast(MessageReader, kind(file))
    return can.LogReader(path)  # a database has a path, and python-can's word stands for what it does not know


def _check_csv(path: Path, begin: bytes) -> None:
    """python-can skips the first line unread. Raises InputError for one that may be a frame, or of another tool."""
    head = re.sub(rb'[\s"]', b"", begin).lower()[: len(CSV_BEGIN)]
    if not CSV_BEGIN.startswith(head):  # it may be short: of a packed file as much as is unpacked
        raise InputError(
            f"is none of python-can's, whose first line is {CSV_BEGIN.decode()}…", file=path,
            hint="export it as a candump log (SavvyCAN: Save Log File, *.log)",
        )  # fmt: skip


def _frame(m: can.Message) -> Frame:
    frame = from_message(m, round(m.timestamp * 1e6))
    if not frame.possible or abs(frame.stamp_us) > MAX_STAMP_US:
        raise ValueError("a frame's id, length or time is one that there is not")
    return frame
