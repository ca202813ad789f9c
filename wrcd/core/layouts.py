"""The records of the core in C as numpy's."""

from functools import cache
from typing import Any

import numpy as np

from wrcd.native import library

_KINDS = {
    "double": "f8", "int64_t": "i8", "int32_t": "i4", "uint64_t": "u8", "uint32_t": "u4", "uint16_t": "u2",
    "uint8_t": "u1",
}  # fmt: skip


@cache
def layouts() -> dict[str, np.dtype[Any]]:
    """The records of C (wrcd/core/c/wrcd.h) by their names."""
    c, found = library(), dict[str, np.dtype[Any]]()
    for n in range(1 << 8):
        if (of := c.wrcd_record_name(n)) is None:
            break
        found[of.decode()] = _record(c.wrcd_record_fields(n), found)
    return found


def _record(listed: Any, known: dict[str, np.dtype[Any]]) -> np.dtype[Any]:
    names, formats, offsets = list[str](), list[Any](), list[int]()
    while (field := listed[len(names)]).name:
        kind = field.type.decode()
        one = known[kind] if kind in known else np.dtype(_KINDS[kind])
        count = field.bytes // one.itemsize
        names.append(field.name.decode())
        formats.append(one if count == 1 else (one, (count,)))
        offsets.append(field.offset)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": field.offset})


def as_struct(records: np.ndarray[Any, Any]) -> Any:
    """The first of some records, its members as attributes: they are read in a tenth of the time."""
    return np.ctypeslib.as_ctypes_type(records.dtype).from_buffer(records)


@cache
def told_names() -> tuple[str, ...]:
    """What a frame may tell, in C's order."""
    c, found = library(), list[str]()
    while (name := c.wrcd_told_name(len(found))) is not None:
        found.append(name.decode())
    return tuple(found)
