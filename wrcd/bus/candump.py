"""Lines of candump's log format, read and written."""

import re

from wrcd.bus.frame import Frame

# (1700000000.123456) can0 091#0011223344556677 — with -N nine decimals; an id of 3 or 8 digits; R for remote and the
# length asked for; ## and a flag digit for CAN FD; _ and a DLC above 8 behind 8 bytes; and perhaps a direction (-x)
_LINE = re.compile(
    rb"\((\d{1,11})\.(\d{6})(?:\d{3})?\)\s+(\S+)\s+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(?:#([0-9A-Fa-f]))?"
    rb"(?:([Rr])([0-8]?)|((?:[0-9A-Fa-f]{2})*))(?:_([9A-Fa-f]))?(?:\s+[RT])?\s*"
)
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
    seconds, us = divmod(frame.stamp_us, 1_000_000)
    if not (frame.remote or frame.error or frame.fd or frame.extra):  # almost always
        ident = f"{frame.can_id:08X}" if frame.extended else f"{frame.can_id:03X}"
        return f"({seconds:010d}.{us:06d}) {channel} {ident}#{frame.data.hex().upper()}"
    number = frame.can_id | (_ERROR_FLAG if frame.error else 0)
    ident = f"{number:08X}" if frame.extended or frame.error else f"{number:03X}"
    extra, tail = frame.extra, ""
    if frame.fd:
        mark = f"##{extra:X}"
    elif frame.remote:
        mark = f"#R8_{extra:X}" if extra > 8 else f"#R{extra}" if extra else "#R"
    else:
        mark, tail = "#", f"_{extra:X}" if extra > 8 else ""
    return f"({seconds:010d}.{us:06d}) {channel} {ident}{mark}{frame.data.hex().upper()}{tail}"
