"""What a core, or a part of it, has become: two that went through the same must be alike to the last bit."""

from collections import deque
from typing import Any

import numpy as np

from wrcd.core.estimator import Estimator

PACKAGES = ("wrcd.bus.", "wrcd.core.")
# What nothing later hangs on, by class: caches, results made anew, what borrows from the rest.
PASSING = {
    "Core": {"explains", "_lane", "_reports", "_tick", "_begin_us", "_end_us"},
    "Events": {"total", "_kept"},
    "Inputs": {"_shares_known", "_shares_ok"},
    "JumpCheck": {"jumped"},
    "Writer": {"_start"},
}


def state(thing: Any) -> Any:
    """As plain values. The estimator's is C's own; what is frozen or not ours is left out."""
    if isinstance(thing, Estimator):
        return thing.state
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.shape, thing.tobytes()
    if isinstance(thing, dict):
        return {str(key): state(value) for key, value in thing.items()}
    if isinstance(thing, (list, tuple, deque)):
        return [state(value) for value in thing]
    if thing is None or isinstance(thing, (bool, int, float, str, bytes)):
        return repr(thing)
    return {name: state(value) for name, value in parts(thing).items()}


def parts(thing: Any) -> dict[str, Any]:
    """The attributes of one of our objects that are its state; of others none."""
    kind = type(thing)
    frozen = getattr(getattr(kind, "__dataclass_params__", None), "frozen", False)
    if frozen or not f"{kind.__module__}.".startswith(PACKAGES):
        return {}
    slots = [name for c in kind.__mro__ for name in getattr(c, "__slots__", ())]
    names = {*getattr(thing, "__dict__", ()), *slots} - PASSING.get(kind.__name__, set())
    return {name: getattr(thing, name) for name in sorted(names)}
