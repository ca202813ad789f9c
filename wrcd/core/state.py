"""A train in C: its tables, its state, and the buffers of what comes of it. Nothing here decides anything."""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from wrcd.core.layouts import layouts
from wrcd.core.tables import Tables

Records = np.ndarray[Any, Any]
TABLES = ("settings", "message", "input", "status", "condition", "number", "word", "rule", "sent", "told", "fit")
_STATE = {
    "core": None, "message_state": "messages", "input_state": "inputs", "status_state": "statuses", "axle": "axles",
    "bogie_state": "bogies",
}  # fmt: skip
OUT = ("made", "report", "event", "sample", "tick")  # in C's order


class _Train(ctypes.Structure):
    _fields_ = [("pointers", ctypes.c_void_p * 20)]


class _Out(ctypes.Structure):
    _fields_ = [
        ("counts", ctypes.c_int64 * len(OUT)), ("most", ctypes.c_int64 * len(OUT)),
        ("buffers", ctypes.c_void_p * len(OUT)),
    ]  # fmt: skip


class Train:
    """Tables and state as C has them; a table that is not given is empty. estimator: addresses of its state, its
    design's table and its newest result."""

    def __init__(self, tables: Tables, estimator: tuple[int, int, int]) -> None:
        nothing = {name: np.zeros(1, dtype=layouts()[name]) for name in TABLES if name in layouts()}
        self._tables = tables = {**nothing, **tables}
        settings = tables["settings"][0]
        self.state: Mapping[str, Records] = {
            name: np.zeros(1 if of is None else max(1, int(settings[of])), dtype=layouts()[name])
            for name, of in _STATE.items()
        }
        memory, design, result = estimator
        at = [tables[name].ctypes.data for name in TABLES]
        at += [design, *(array.ctypes.data for array in self.state.values()), memory, result]
        self._struct = _Train((ctypes.c_void_p * 20)(*at))
        self.pointer = ctypes.addressof(self._struct)

    def copy_from(self, other: "Train") -> None:
        """Become as another train of the same configuration."""
        for name, array in self.state.items():
            array[:] = other.state[name]


class Buffers:
    """What comes of frames and time, until it is taken."""

    def __init__(self, most: Mapping[str, int]) -> None:
        self._records = {name: np.zeros(most[name], dtype=layouts()[name]) for name in OUT}
        self._struct = _Out()
        self._struct.most[:] = [most[name] for name in OUT]
        self._struct.buffers[:] = [array.ctypes.data for array in self._records.values()]
        self.pointer = ctypes.addressof(self._struct)

    def take(self) -> dict[str, Records]:
        """Copies of what there is, by its kind; kinds without any are left out."""
        counts, found = self._struct.counts, dict[str, Records]()
        for k, name in enumerate(OUT):
            if count := counts[k]:
                counts[k], of = 0, self._records[name].dtype
                found[name] = np.frombuffer(ctypes.string_at(self._struct.buffers[k], count * of.itemsize), of)
        return found
