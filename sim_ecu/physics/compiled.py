"""One place for the compiler: plain numeric Python in, machine code out, cached beside the source."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """Compile a numeric function. It drops the interpreter's lock while it runs, so batches use all cores.

    Strict floating point (no fast-math): a log must come out the same today and tomorrow.
    """
    return cast(F, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
