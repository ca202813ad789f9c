"""Lines of candump's log format, read and written."""

import re
from ctypes import create_string_buffer
from typing import Any

from wrcd.bus.frame import ERROR, ID_BITS, Frame
from wrcd.native import library

# (1700000000.123456) can0 091#0011223344556677 — with -N nine decimals; before 1970 with a sign; an id of 3 or 8
# digits; R for remote and the length asked for; ## and a flag digit for CAN FD; _ and a DLC above 8 behind 8 bytes; and
# perhaps a direction (-x)
_LINE = re.compile(
    rb"\((-?\d{1,11})\.(\d{6})(?:\d{3})?\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#([0-9A-Fa-f]))?"
    rb"(?:([Rr])([0-8]?)|((?:[0-9A-Fa-f]{2})*))(?:_([9A-Fa-f]))?(?:\s+[RT])?\s*"
)


def parse_line(line: bytes) -> tuple[Frame, str] | None:
    """A candump line as (frame, channel), or None if it is not one."""
    m = _LINE.fullmatch(line)
    if m is None:
        return None
    number = int(m[4], 16)
    extended = len(m[4]) == 8
    error = extended and bool(number & ERROR)
    data = bytes.fromhex(m[8].decode()) if m[8] else b""
    remote, fd = m[6] is not None, m[5] is not None
    if m[9] is not None and (fd or (len(data) if not remote else int(m[7] or b"0")) != 8):
        return None
    extra = int(m[9] or m[5] or m[7] or b"0", 16)
    us = int(m[2])
    frame = Frame(
        int(m[1]) * 1_000_000 + (-us if m[1].startswith(b"-") else us), number & ID_BITS if extended else number, data,
        extended and not error, remote, error, fd, extra,
    )  # fmt: skip
    return (frame, m[3].decode(errors="replace")) if frame.possible and not (remote and fd) else None


def stamp_text(stamp_us: int) -> str:
    """A stamp as candump writes it; with a sign before 1970, which candump never is and a log's first second may be."""
    seconds, us = divmod(abs(stamp_us), 1_000_000)
    return f"-{seconds:010d}.{us:06d}" if stamp_us < 0 else f"{seconds:010d}.{us:06d}"


def format_line(frame: Frame, channel: str) -> str:
    """A frame as candump writes it."""
    stamp = stamp_text(frame.stamp_us)
    if not (frame.remote or frame.error or frame.fd or frame.extra):  # almost always
        ident = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        return f"({stamp}) {channel} {ident}#{frame.data.hex().upper()}"
    number = frame.can_id | (ERROR if frame.error else 0)
    ident = f"{number:08X}" if frame.extended or frame.error else f"{number:03X}"
    extra, tail = frame.extra, ""
    if frame.fd:
        mark = f"##{extra:X}"
    elif frame.remote:
        mark = f"#R8_{extra:X}" if extra > 8 else f"#R{extra}" if extra else "#R"
    else:
        mark, tail = "#", f"_{extra:X}" if extra > 8 else ""
    return f"({stamp}) {channel} {ident}{mark}{frame.data.hex().upper()}{tail}"


def format_lines(frames: Any, channel: str) -> str:
    """The same of classical data frames, an array of records that begin as wrcd_frame.h's, each with its line's end."""
    between = f") {channel} ".encode()
    text = create_string_buffer(len(frames) * (64 + len(between)))
    size = library().wrcd_write_lines(frames.ctypes.data, frames.strides[0], len(frames), between, len(between), text)
    return text.raw[:size].decode()
