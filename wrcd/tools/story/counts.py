"""Counts of the daemon that wrap round: by how much each grew, over a restart of the daemon too."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.core.vocabulary import MESSAGES, Numeric
from wrcd.tools.counts import growth, restarted
from wrcd.tools.story.records import Series

NO_COUNTS = frozenset({"DesignChecksum"})


def moduli(key: str) -> dict[str, float]:
    """The counts of a message (its key in the configuration) that go on from frame to frame, and where they wrap.
    Those of WrcdRejects begin anew with each frame."""
    if key == "rejects_message":
        return {}
    named = {n: k for n, k in MESSAGES[key].items() if isinstance(k, Numeric) and n not in NO_COUNTS}
    return {name: kind.high + 1.0 for name, kind in named.items()}


def restarts(series: Series, key: str) -> NDArray[np.bool_]:
    """Frames before which the daemon was restarted, (n,): a count went back so far that it cannot have wrapped."""
    out = np.zeros(len(series.time_us), dtype=bool)
    for name, modulo in moduli(key).items():
        values = series.values.get(name)
        if values is not None:
            out[1:] |= restarted(values, modulo)
    return out


def added(series: Series, key: str) -> Mapping[str, NDArray[np.float64]]:
    """What was added to each count since the frame before, (n,); after a restart all that was counted since it."""
    anew = restarts(series, key)
    out = {}
    for name, modulo in moduli(key).items():
        values = series.values.get(name)
        if values is not None:
            out[name] = np.concatenate((np.zeros(1), growth(values, modulo, anew[1:])))
    return out
