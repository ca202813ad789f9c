"""Packs columns of numbers for a page: whole steps, differences, byte planes, gzip, base64. data.js unpacks them."""

import base64
import gzip
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

TIME, NUMBER, CODE = "time", "number", "code"  # float64, float32 and int16 in the browser
LEVEL = 6  # of gzip: 9 takes three times as long for 2 % less
MAX_STEPS = 30_000  # of a column whose step is chosen by its values


@dataclass(frozen=True, slots=True)
class Column:
    """Values (n,) that are kept to the nearest step. NaN, and a code below 0, is: there is none.

    base and sign: the page holds base + sign * values, base another column of the table.
    """

    values: NDArray[Any]
    step: float
    kind: str = NUMBER
    base: str = ""
    sign: int = 1


@dataclass(frozen=True, slots=True)
class Packed:
    """A table for the page: what the browser must know of it, as JSON, and its bytes in base64."""

    head: dict[str, Any]
    text: str


def step_of(values: NDArray[Any]) -> float:
    """1, 2 or 5 times a power of ten, such that values take at most MAX_STEPS of them."""
    finite = values[np.isfinite(values)]
    widest = float(np.abs(finite).max(initial=0.0))
    if widest == 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(widest / MAX_STEPS))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m * MAX_STEPS >= widest))


def pack(table: Mapping[str, Column]) -> Packed:
    """Pack columns of one length."""
    heads, parts, count = [], [], 0
    for name, column in table.items():
        count = len(column.values)
        head, part = _packed(column)
        heads.append({"name": name, **head})
        parts.append(part)
    data = gzip.compress(b"".join(parts), LEVEL, mtime=0)
    return Packed({"rows": count, "columns": heads}, base64.b64encode(data).decode("ascii"))


def _packed(column: Column) -> tuple[dict[str, Any], bytes]:
    values = np.asarray(column.values, dtype=np.float64)
    there = np.isfinite(values)
    if column.kind == CODE:
        there &= values >= 0
    step = column.step
    while True:
        whole = np.rint(values / step)
        low = float(whole[there].min()) if there.any() else 0.0
        high = float(whole[there].max()) - low + 1.0 if there.any() else 0.0
        if high < 2.0**32:
            break
        step *= 10.0  # of times: hours of whole microseconds do not fit
    width = 1 if high < 2**8 else 2 if high < 2**16 else 4
    steps = np.where(there, whole - low + 1.0, 0.0).astype(f"<u{width}")
    order = 2 if column.kind == TIME else 1
    for _ in range(order):
        steps = np.diff(steps, prepend=steps.dtype.type(0))
    planes = steps.view(np.uint8).reshape(len(steps), width).T
    head: dict[str, Any] = {
        "kind": column.kind, "width": width, "order": order, "step": step, "low": low,
    }  # fmt: skip
    if column.base:
        head |= {"base": column.base, "sign": column.sign}
    return head, planes.tobytes()
