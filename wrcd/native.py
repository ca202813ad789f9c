"""The compiled library, where there is one: built with the package by a C compiler, absent without.

WRCD_ENGINE=reference in the environment does without it.
"""

import ctypes
import os
import sysconfig
from functools import cache
from pathlib import Path
from typing import Any

ABI = 1  # WRCD_ABI of wrcd/estimator/c/wrcd_estimator.h
_FILE = Path(__file__).with_name(f"_native{sysconfig.get_config_var('EXT_SUFFIX')}")


class _Field(ctypes.Structure):
    _fields_ = [("name", ctypes.c_char_p), ("offset", ctypes.c_size_t), ("bytes", ctypes.c_size_t)]


_pointer, _int, _long = ctypes.c_void_p, ctypes.c_int, ctypes.c_int64
_SIGNATURES: tuple[tuple[str, Any, *tuple[Any, ...]], ...] = (
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
    ("wrcd_lane_run", _int, *(_pointer,) * 6, _long, _pointer),
    ("wrcd_lane_bytes", _int, _int),
)


@cache
def library() -> ctypes.CDLL | None:
    """The library; None where it was not built, or from other sources than these, or is not wanted."""
    try:
        c = ctypes.CDLL(str(_FILE))
    except OSError:
        return None
    if c.wrcd_abi() != ABI or os.environ.get("WRCD_ENGINE") == "reference":
        return None
    for name, result, *arguments in _SIGNATURES:
        function = getattr(c, name)
        function.restype, function.argtypes = result, arguments
    return c
