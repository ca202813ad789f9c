"""What a core, or a part of it, has become: two that went through the same must be alike to the last bit."""

from collections import deque
from typing import Any

import numpy as np

from wrcd.core.core import Core
from wrcd.core.estimator import Estimator

PACKAGES = ("wrcd.bus.", "wrcd.core.")


def state(thing: Any) -> Any:
    """As plain values; what is frozen or not ours is left out."""
    if isinstance(thing, Core):
        return of_core(thing)
    if isinstance(thing, Estimator):
        return thing._memory.tobytes()
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
    names = {*getattr(thing, "__dict__", ()), *slots}
    return {name: getattr(thing, name) for name in sorted(names)}


def of_core(core: Core) -> dict[str, Any]:
    """Every member of every record of a core's state, and its estimator."""
    found = {
        f"{name}.{member}": records[member].tolist()
        for name, records in core._train.state.items() for member in records.dtype.names or ()
    }  # fmt: skip
    return {name: repr(values) for name, values in found.items()} | {"estimator": state(core.estimator)}
