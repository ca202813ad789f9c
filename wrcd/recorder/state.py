"""The state of a core as plain values: copied from a running one, written to a file, put back into a fresh one.

An object's state is the fields of its dataclass, but for those that take no part in a comparison. What else it changes
on the way (caches, results made anew) is no field: tests/unit/recorder/test_state.py names these, and finds what is
forgotten. The compiled estimator's state is kept as the reference's. A class whose arrays may hold only some values
says in is_possible whether they do.
"""

import base64
import binascii
import math
from collections import Counter, deque
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from wrcd.estimator.native_estimator import CompiledEstimator

MAX_ITEMS = 10_000  # of a list whose length the configuration does not settle
MAX_WORD = 200  # characters or bytes


_STATES: dict[type, dict[str, str]] = {}  # by class, as far as they have been looked up


def state_of(kind: type) -> dict[str, str]:
    """The attributes that are the state of a class, by their keys in a file; none: it has no state."""
    found = _STATES.get(kind)
    if found is None:
        own = fields(kind) if is_dataclass(kind) else ()
        found = _STATES[kind] = {f.name.lstrip("_"): f.name for f in own if f.compare}
    return found


def capture(thing: Any) -> dict[str, Any]:
    """A copy of the state of an object and of all that it is made of. Raises TypeError for what cannot be copied."""
    if isinstance(thing, CompiledEstimator):
        return capture(thing.reference())
    return {key: _copy(getattr(thing, name)) for key, name in state_of(type(thing)).items()}


def _copy(value: Any) -> Any:
    if value is None or isinstance(value, (bool, int, float, str, bytes)):
        return value
    if isinstance(value, np.ndarray):
        return value.copy()
    if state_of(type(value)) or isinstance(value, CompiledEstimator):
        return capture(value)
    if isinstance(value, dict):
        return {str(key): _copy(v) for key, v in value.items()}
    if isinstance(value, (list, tuple, deque)):
        return [_copy(v) for v in value]
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} cannot be part of a state")


def encode(copied: Any) -> Any:
    """What capture gave, as JSON has it."""
    if isinstance(copied, np.ndarray):
        data = base64.b64encode(np.ascontiguousarray(copied).tobytes()).decode()
        return {"dtype": copied.dtype.str, "shape": list(copied.shape), "base64": data}
    if isinstance(copied, bytes):
        return {"hex": copied.hex()}
    if isinstance(copied, dict):
        return {key: encode(v) for key, v in copied.items()}
    if isinstance(copied, list):
        return [encode(v) for v in copied]
    if isinstance(copied, float) and not math.isfinite(copied):
        return {"float": str(copied)}
    return copied


class StateMismatch(Exception):
    """A value that the object to be restored cannot have."""


def restore(thing: Any, node: Any, where: str = "core") -> None:
    """Put an encoded state into an object made with the same configuration. Types, shapes and lengths are those that
    it has: nothing in the file can ask for more. Raises StateMismatch; the object is then not to be used."""
    if isinstance(thing, CompiledEstimator):
        reference = thing.reference()
        restore(reference, node, where)
        thing.take(reference)
        return
    if not isinstance(node, dict) or set(node) != set(state_of(type(thing))):
        raise StateMismatch(f"{where} is not what this version keeps of it")
    for key, name in state_of(type(thing)).items():
        setattr(thing, name, _restored(getattr(thing, name), node[key], f"{where}.{key}"))
    if not getattr(thing, "is_possible", True):
        raise StateMismatch(f"{where} holds what cannot be")


def _restored(now: Any, node: Any, where: str) -> Any:
    if state_of(type(now)) or isinstance(now, CompiledEstimator):
        restore(now, node, where)
        return now
    if isinstance(now, np.ndarray):
        return _array(now, node, where)
    if isinstance(now, Counter):
        return Counter({_word(key, where): whole(n, where) for key, n in _table(node, where).items()})
    if isinstance(now, dict):
        keys = {str(key): key for key in now}
        if set(_table(node, where)) != set(keys):
            raise StateMismatch(f"{where} has other keys")
        return {key: _restored(now[key], node[text], f"{where}[{text}]") for text, key in keys.items()}
    if isinstance(now, deque):
        most = MAX_ITEMS if now.maxlen is None else now.maxlen
        return deque((_plain(v, where) for v in as_list(node, where, most)), now.maxlen)
    if isinstance(now, (list, tuple)):
        items = as_list(node, where, MAX_ITEMS)
        if len(items) == len(now):
            return type(now)(_restored(a, b, f"{where}[{i}]") for i, (a, b) in enumerate(zip(now, items, strict=True)))
        if now:
            raise StateMismatch(f"{where} has {len(items)} items, not {len(now)}")
        return type(now)(_plain(v, where) for v in items)
    return _scalar(now, node, where)


def _array(now: np.ndarray[Any, Any], node: Any, where: str) -> np.ndarray[Any, Any]:
    if not isinstance(node, dict) or node.get("dtype") != now.dtype.str or node.get("shape") != list(now.shape):
        raise StateMismatch(f"{where} is not an array {now.dtype.str} of shape {list(now.shape)}")
    try:
        data = base64.b64decode(node.get("base64", ""), validate=True)
    except (TypeError, ValueError, binascii.Error):
        raise StateMismatch(f"{where} is not base64") from None
    if len(data) != now.nbytes or (now.dtype == bool and not set(data) <= {0, 1}):
        raise StateMismatch(f"{where} does not hold {now.size} values")
    return np.frombuffer(data, dtype=now.dtype).reshape(now.shape).copy()


def _scalar(now: Any, node: Any, where: str) -> Any:
    """A value of the type that is there; where nothing is there yet, any plain value."""
    value = _plain(node, where)
    if now is None:
        return value
    if isinstance(now, Enum):
        try:
            return type(now)(value)
        except ValueError:
            raise StateMismatch(f"{where} cannot be {value!r}") from None
    if type(value) is not type(now):
        raise StateMismatch(f"{where} is not a {type(now).__name__}")
    return value


def _plain(node: Any, where: str) -> Any:
    """A number, a word, bytes, or a tuple of them."""
    if node is None or isinstance(node, (bool, float)):
        return node
    if isinstance(node, int):
        return whole(node, where)
    if isinstance(node, str):
        return _word(node, where)
    if isinstance(node, list):
        return tuple(_plain(v, where) for v in as_list(node, where, MAX_WORD))
    if isinstance(node, dict) and set(node) == {"float"} and node["float"] in ("nan", "inf", "-inf"):
        return float(node["float"])
    if isinstance(node, dict) and set(node) == {"hex"}:
        try:
            return bytes.fromhex(_word(node["hex"], where))
        except ValueError:
            pass
    raise StateMismatch(f"{where} is not a plain value")


def whole(node: Any, where: str) -> int:
    """A whole number from a file."""
    if type(node) is not int or abs(node) >= 1 << 62:
        raise StateMismatch(f"{where} is not a whole number of up to 62 bits")
    return node


def _word(node: Any, where: str) -> str:
    if not isinstance(node, str) or len(node) > MAX_WORD:
        raise StateMismatch(f"{where} is not a short text")
    return str(node)


def _table(node: Any, where: str) -> dict[str, Any]:
    if not isinstance(node, dict) or len(node) > MAX_ITEMS:
        raise StateMismatch(f"{where} is not a table")
    return node


def as_list(node: Any, where: str, most: int) -> list[Any]:
    """A list from a file."""
    if not isinstance(node, list) or len(node) > most:
        raise StateMismatch(f"{where} is not a list of up to {most}")
    return node
