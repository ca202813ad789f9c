"""Tables of the core as constants in C."""

from typing import Any

import numpy as np

from wrcd.core.tables import QUANTITIES, Records

# by the name in wrcd.h of what points to them: the type
TYPES = {
    "settings": "wrcd_settings", "message": "wrcd_message", "input": "wrcd_input", "status": "wrcd_status_rule",
    "condition": "wrcd_condition", "number": "int64_t", "word": "int64_t", "rule": "int32_t", "sent": "wrcd_sent",
    "told": "wrcd_told_field", "fit": "wrcd_fit_table",
}  # fmt: skip
_BY_AXLE = {"input_cycle_us": 1, "input_of": len(QUANTITIES)}  # rows of so many axles as there is room for


def definition(name: str, records: Records, axles: int) -> str:
    """A table's definition, with room for so many axles."""
    rows = [_record(r, axles) if records.dtype.names else number(r) for r in records]
    body = ",\n".join(f"    {row}" for row in rows)
    return f"static const {TYPES[name]} {name.upper()}[{len(records)}] = {{\n{body},\n}};"


def number(x: Any) -> str:
    """A number as C reads it back to the last bit."""
    value = x.item()
    if isinstance(value, float):
        return repr(value).replace("nan", "NAN").replace("inf", "INFINITY")
    if value == -(1 << 63):
        return f"(-{(1 << 63) - 1} - 1)"
    return f"{value}U" if x.dtype.kind == "u" else str(value)


def _record(record: Any, axles: int) -> str:
    """Members that are zero are left out."""
    members = []
    for name in record.dtype.names:
        value = record[name]
        if name in _BY_AXLE:
            rows = value.reshape(_BY_AXLE[name], -1)[:, :axles]
            text = _row(rows[0]) if len(rows) == 1 else f"{{{', '.join(map(_row, rows))}}}"
        elif not np.any(value):
            continue
        else:
            text = _row(value) if np.ndim(value) else number(value)
        members.append(f".{name} = {text}")
    return f"{{{', '.join(members) or '0'}}}"


def _row(values: Records) -> str:
    """An array's numbers; zeros at its end are left out."""
    count = int(np.flatnonzero(values)[-1]) + 1 if np.any(values) else 1
    return f"{{{', '.join(map(number, values[:count]))}}}"
