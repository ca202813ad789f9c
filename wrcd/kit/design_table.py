"""A design as constants in C: the table that the estimator reads."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.core.design_members import IN_PLACE, Member, OverSpeed

_PER_LINE = 6


class DesignTable:
    """The definitions of a design's members; equal arrays are defined once."""

    def __init__(self, of: Mapping[str, Member]) -> None:
        self._names: dict[str, str] = {}  # of an array, by its type and numbers
        self._bytes = 0
        members = self._members("", of)
        arrays = [f"static const {body.replace('@', name)};" for body, name in self._names.items()]
        self.text = "\n".join([*arrays, "", f"const wrcd_design wrcd_the_design = {members};"])

    @property
    def array_bytes(self) -> int:
        """Of the numbers of all arrays."""
        return self._bytes

    def _members(self, of: str, members: Mapping[str, Member]) -> str:
        rows = [
            f"    .{name} = {self._value(of + name, value)}," for name, value in members.items() if value is not None
        ]
        return "\n".join(["{", *rows, "}"])

    def _value(self, name: str, value: Member) -> str:
        if isinstance(value, OverSpeed):
            v, rows = value
            return f"{{{len(v)}, {rows.shape[1]}, {self._array(f'{name}_speeds', v)}, {self._array(name, rows)}}}"
        if isinstance(value, tuple):
            return f"{{{', '.join(self._array(f'{name}_{k + 1}', a) for k, a in enumerate(value))}}}"
        if isinstance(value, np.ndarray):
            return f"{{{', '.join(_numbers(value))}}}" if name in IN_PLACE else self._array(name, value)
        if isinstance(value, Mapping):
            return f"&(const wrcd_{name}_table){self._members(f'{name}_', value)}"
        return repr(value)

    def _array(self, name: str, value: NDArray[Any]) -> str:
        kind = "int" if value.dtype == np.int32 else "double"
        said = _numbers(value)
        lines = [", ".join(said[k : k + _PER_LINE]) for k in range(0, len(said), _PER_LINE)]
        body = "".join([f"{kind} @[{value.size}] = {{\n", *(f"    {line},\n" for line in lines), "}"])
        if body not in self._names:
            self._names[body] = name.upper()
            self._bytes += value.nbytes
        return self._names[body]


def _numbers(value: NDArray[Any]) -> list[str]:
    """As C reads them back to the last bit."""
    return [repr(x) for x in value.ravel().tolist()]
