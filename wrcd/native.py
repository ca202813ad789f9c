"""The compiled library, where there is one: built with the package by a C compiler, absent without.

WRCD_ENGINE=reference in the environment does without it.
"""

import ctypes
import os
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent


class _Field(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("offset", ctypes.c_size_t), ("bytes", ctypes.c_size_t)]


_pointer, _int, _long = ctypes.c_void_p, ctypes.c_int, ctypes.c_int64
_SIGNATURES: tuple[tuple[str, Any, *tuple[Any, ...]], ...] = (
    ("wrcd_sources", ctypes.c_char_p),
    ("wrcd_compiler", ctypes.c_char_p),
    ("wrcd_fields", ctypes.POINTER(_Field), _int),
    ("wrcd_size", ctypes.c_size_t, _pointer, _int),
    ("wrcd_begin", None, _pointer, _pointer, _int),
    ("wrcd_reset", None, _pointer, _pointer, _int),
    ("wrcd_step", _int, _pointer, _pointer, _pointer, _pointer),
    ("wrcd_run", None, _pointer, _pointer, _long, _long, _pointer, _pointer, _pointer, _pointer, _int),
    ("wrcd_estimate", None, _pointer, _pointer, _pointer),
    ("wrcd_pair_state", _int, _pointer, _int),
    ("wrcd_torque_now", None, _pointer, _pointer, _pointer),
    ("wrcd_inputs_of", None, _pointer, _pointer, _int, _pointer, _pointer, _pointer),
    ("wrcd_steps", None, _pointer, _pointer, _pointer),
    ("wrcd_features", None, _pointer, _pointer, _pointer),
    ("wrcd_receive", _int, _int, _pointer, _int, _long, _pointer, _int, _pointer),
    ("wrcd_send", _int, _int, _pointer, _int),
    ("wrcd_lane_run", _int, *(_pointer,) * 6, _long, _pointer),
    ("wrcd_lane_bytes", _int, _int),
)


def sources() -> str:
    """A digest of the C files in this package: setup.py compiles it in, and a library of others is not used."""
    digest = sha256()
    for file in sorted(_FOLDER.glob("*/c/*.[ch]")):
        digest.update(f"{file.relative_to(_FOLDER)}\0".encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def load(file: Path) -> tuple[ctypes.CDLL | None, str]:
    """A library, and the compiler that made it; None if it does not load or is of other sources, and that."""
    try:
        c = ctypes.CDLL(str(file))
        for name, result, *arguments in _SIGNATURES:
            function = getattr(c, name)
            function.restype, function.argtypes = result, arguments
        compiled_from, compiler = (of().decode() for of in (c.wrcd_sources, c.wrcd_compiler))
    except (OSError, AttributeError) as e:
        return None, f"{file.name} cannot be used: {e}"
    if compiled_from != sources():
        return None, f"{file.name} is of other sources: install anew"
    return c, compiler


@cache
def _found() -> tuple[ctypes.CDLL | None, str]:
    if os.environ.get("WRCD_ENGINE") == "reference":
        return None, "WRCD_ENGINE asks for the reference"
    why = "none was built"
    for file in sorted(_FOLDER.glob("_native*.so")):  # of any Python: it uses none
        c, why = load(file)
        if c is not None:
            return c, why
    return None, why


def library() -> ctypes.CDLL | None:
    """The library; None where it was not built, or of other sources than these, or is not wanted."""
    return _found()[0]


def engine() -> str:
    """Which estimator runs, and made by what."""
    c, by = _found()
    return "reference (numpy)" if c is None else f"C11, compiled by {by}"


def slow() -> str | None:
    """One line where the compiled estimator does not run, and why; None where it does."""
    c, why = _found()
    return None if c is not None else f"no compiled estimator ({why}): the reference in numpy runs, many times slower"
