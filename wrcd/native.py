"""The library in C: built with the package by a C compiler, and loaded when it is first used."""

import ctypes
import math
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from wrcd.errors import InputError

_FOLDER = Path(__file__).parent
_HINT = "install wrcd anew: it needs a C compiler, such as gcc"


class _Field(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("offset", ctypes.c_size_t), ("bytes", ctypes.c_size_t)]


_pointer, _int, _long, _double = ctypes.c_void_p, ctypes.c_int, ctypes.c_int64, ctypes.c_double
_SIGNATURES: tuple[tuple[str, Any, *tuple[Any, ...]], ...] = (
    ("wrcd_sources", ctypes.c_char_p),
    ("wrcd_compiler", ctypes.c_char_p),
    ("wrcd_constant", _double, ctypes.c_char_p),
    ("wrcd_fields", ctypes.POINTER(_Field), _int),
    ("wrcd_size", ctypes.c_size_t, _pointer, _int),
    ("wrcd_begin", None, _pointer, _pointer, _int),
    ("wrcd_reset", None, _pointer, _pointer, _int),
    ("wrcd_step", _int, _pointer, _pointer, _pointer, _pointer),
    ("wrcd_run", None, _pointer, _pointer, _long, _long, _pointer, _pointer, _pointer, _pointer, _int),
    ("wrcd_estimate", None, _pointer, _pointer, _pointer),
    ("wrcd_gate_why", None, _pointer, _int, _pointer, _double, _pointer),
    ("wrcd_pair_state", _int, _pointer, _int),
    ("wrcd_health_figures", None, _pointer, _int, _pointer, _pointer),
    ("wrcd_torque_now", None, _pointer, _pointer, _pointer),
    ("wrcd_inputs_of", None, _pointer, _pointer, _int, _pointer, _pointer, _pointer),
    ("wrcd_steps", None, _pointer, _pointer, _pointer),
    ("wrcd_features", None, _pointer, _pointer, _pointer),
    ("wrcd_evidence", None, _pointer, _int, _pointer, _pointer),
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


def load(file: Path) -> ctypes.CDLL:
    """A library. Raises InputError where it does not load, or is of other sources than these."""
    try:
        c = ctypes.CDLL(str(file))
        for name, result, *arguments in _SIGNATURES:
            function = getattr(c, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as e:
        raise InputError(f"cannot be used: {e}", file=file, hint=_HINT) from None
    if c.wrcd_sources().decode() != sources():
        raise InputError("was built from other C sources than those beside it", file=file, hint=_HINT)
    return c


@cache
def _found() -> tuple[ctypes.CDLL | None, str]:
    if os.environ.get("WRCD_ENGINE") == "reference":
        return None, "WRCD_ENGINE asks for the reference"
    why = "none was built"
    for file in _FOLDER.glob("_native.so"):  # of any Python: it uses none
        c, why = load(file)
        if c is not None:
            return c, why
    return None, why


def compiler() -> str:
    """What built the library."""
    return str(library().wrcd_compiler().decode())


def constant(name: str) -> float:
    """A number that C defines, by its name there."""
    value = float(library().wrcd_constant(name.encode()))
    assert not math.isnan(value), name
    return value
