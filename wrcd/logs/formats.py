"""Logs in the formats of python-can, by its own readers. What those do not notice is not noticed here."""

import io
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO, cast

import can
from can.io.generic import BinaryIOMessageReader, MessageReader, TextIOMessageReader

from wrcd.bus.frame import Frame
from wrcd.bus.pythoncan import from_message
from wrcd.errors import InputError

MAX_STAMP_US = 10**17  # the year 5138
BLF_HEADER, BLF_SIZE_AT = 16, 8  # bytes of an object's header; where in it the object's length stands


def read(path: Path, suffix: str, file: IO[bytes]) -> Iterator[tuple[Frame, str]]:
    """Frames and channels of a log, which is open as file. Raises what python-can raises, and ValueError for a frame
    that there cannot be."""
    with _reader(path, suffix, file) as reader:
        for message in reader:
            if isinstance(reader, can.ASCReader) and (reader.timestamps_format or "").lower() == "relative":
                raise InputError(
                    "each of its stamps counts from the line before (timestamps relative): python-can takes them for "
                    "times since its begin",
                    file=path,
                    hint="export it again with absolute timestamps",
                )
            yield _frame(message), str(message.channel if message.channel is not None else "can0")


class _BlfReader(can.BLFReader):
    """Ends at an object that is shorter than its header: python-can reads one of length 0 without an end."""

    def _parse_container(self, data: bytes) -> Iterator[can.Message]:
        whole = self._tail + data
        at = whole.find(b"LOBJ", 0, 8)  # as far as python-can looks
        while 0 <= at <= len(whole) - BLF_HEADER:
            (size,) = struct.unpack_from("<L", whole, at + BLF_SIZE_AT)
            if size < BLF_HEADER:
                yield from super()._parse_container(data[: max(at - len(self._tail), 0)])
                raise ValueError(f"an object of length {size}")
            at = whole.find(b"LOBJ", at + size, at + size + 8)
        yield from super()._parse_container(data)


def _reader(path: Path, suffix: str, file: IO[bytes]) -> MessageReader:
    kind = _BlfReader if suffix == ".blf" else can.io.MESSAGE_READERS.get(suffix)
    if kind is not None and issubclass(kind, TextIOMessageReader):
        # every byte is a character: only frames count, and they are ASCII
        return kind(io.TextIOWrapper(file, encoding="latin-1"))
    if kind is not None and issubclass(kind, BinaryIOMessageReader):
        return kind(cast(io.BufferedIOBase, file))
    return can.LogReader(path)  # a database has a path, and python-can's word stands for what it does not know


def _frame(m: can.Message) -> Frame:
    frame = from_message(m, round(m.timestamp * 1e6))
    if not frame.possible or abs(frame.stamp_us) > MAX_STAMP_US:
        raise ValueError("a frame's id, length or time is one that there is not")
    return frame
