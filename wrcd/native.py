"""The library in C: built with the package by a C compiler, and loaded when it is first used."""

import ctypes
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from wrcd.errors import InputError

_FOLDER = Path(__file__).parent
_HINT = "install wrcd anew: it needs a C compiler, such as gcc"
_pointer, _text, _size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
_int, _long, _double = ctypes.c_int, ctypes.c_int64, ctypes.c_double


class _Field(ctypes.Structure):
    _fields_ = [("name", _text), ("type", _text), ("offset", _size), ("bytes", _size)]


_SIGNATURES: tuple[tuple[str, Any, *tuple[Any, ...]], ...] = (
    ("wrcd_sources", _text),
    ("wrcd_compiler", _text),
    ("wrcd_constant", _double, _text),
    ("wrcd_size", _size, _pointer, _int),
    ("wrcd_begin", None, _pointer, _pointer, _int),
    ("wrcd_reset", None, _pointer, _pointer, _int),
    ("wrcd_step", _int, _pointer, _pointer, _pointer, _pointer),
    ("wrcd_run", None, _pointer, _pointer, _long, _long, _pointer, _pointer, _pointer, _pointer, _int),
    ("wrcd_estimate", None, _pointer, _pointer, _pointer),
    ("wrcd_gate_why", None, _pointer, _int, _pointer, _double, _pointer),
    ("wrcd_pair_state", _int, _pointer, _int),
    ("wrcd_health_figures", None, _pointer, _int, _pointer, _pointer),
    ("wrcd_slides_take", None, _pointer, _pointer),
    ("wrcd_torque_now", None, _pointer, _pointer, _pointer),
    ("wrcd_inputs_of", None, _pointer, _pointer, _int, _pointer, _pointer, _pointer),
    ("wrcd_steps", None, _pointer, _pointer, _pointer),
    ("wrcd_features", None, _pointer, _pointer, _pointer),
    ("wrcd_evidence", None, _pointer, _int, _pointer, _pointer),
    ("wrcd_record_name", _text, _int),
    ("wrcd_record_fields", ctypes.POINTER(_Field), _int),
    ("wrcd_told_name", _text, _int),
    ("wrcd_core_begin", None, _pointer),
    ("wrcd_feed", _long, _pointer, _pointer, _text, _long, _long, _long),
    ("wrcd_advance", _int, _pointer, _pointer, _long),
    ("wrcd_shutdown", _int, _pointer, _pointer, _long),
    ("wrcd_next_slot_us", _long, _pointer),
    ("wrcd_read", _long, _pointer, _text, _long, _long, _int, _pointer, _pointer),
    ("wrcd_forget_senders", None, _pointer),
    ("wrcd_e2e_check", _int, _pointer, _int, _text, _int, _long),
    ("wrcd_repeats_doubted", _int, _double),
    ("wrcd_receive", _int, _int, _pointer, _long, _int, _long, _pointer, _int, _pointer, _pointer),
    ("wrcd_send", _int, _int, _pointer, _long, _int),
    ("wrcd_read_lines", None, _text, _long, _pointer, _long, _long, _pointer, _pointer),
    ("wrcd_write_lines", _long, _pointer, _long, _long, _text, _long, _pointer),
)


def sources() -> str:
    """A digest of the C files in this package: setup.py compiles it in, and a library of others is not used."""
    files = sorted(_FOLDER.glob("*/c/*.[ch]"))
    return sha256(b"".join(f"{f.relative_to(_FOLDER)}\0".encode() + f.read_bytes() for f in files)).hexdigest()[:16]


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
def library() -> ctypes.CDLL:
    """The library that was built with the package. Raises InputError where there is none that fits."""
    file = _FOLDER / "_native.so"
    if not file.exists():
        raise InputError("the library in C was not built", file=_FOLDER, hint=_HINT)
    return load(file)


def compiler() -> str:
    """What built the library."""
    return str(library().wrcd_compiler().decode())


def constant(name: str) -> float:
    """A number that C defines, by its name there."""
    value = float(library().wrcd_constant(name.encode()))
    assert value == value, name  # not NaN
    return value
