"""When the available adhesion fell or rose for good."""

import numpy as np

from wrcd.tools.story.records import Adhesion, Fall

STEP_US = 100_000
SIDE = 10  # steps on either side that are compared: a second
MIN_CHANGE_PP, MIN_SHARE = 3.0, 0.25  # of adhesion before, for a fall; of that after, for a rise


def falls(axle: int, adhesion: Adhesion) -> tuple[Fall, ...]:
    """Changes of MuAvailable between the second before and the second after, the largest of each stretch of them."""
    times, values = adhesion.time_us, adhesion.available_pct
    known = np.isfinite(values)
    times, values = times[known], values[known].astype(np.float64)
    if len(times) < 2:
        return ()
    # a silence, however long, takes a few steps
    steps = np.concatenate(([0], np.cumsum(np.minimum(np.diff(times // STEP_US), 3 * SIDE))))
    n = int(steps[-1]) + 1
    counts = np.bincount(steps, minlength=n)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(steps, weights=values, minlength=n) / counts
    sums = np.concatenate(([0.0], np.cumsum(np.nan_to_num(mean))))
    there = np.concatenate(([0], np.cumsum(counts > 0)))
    at = np.arange(1, n)
    low, high = np.maximum(at - SIDE, 0), np.minimum(at + SIDE, n)
    before_n, after_n = there[at] - there[low], there[high] - there[at]
    good = (before_n >= SIDE // 2) & (after_n >= SIDE // 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        before, after = (sums[at] - sums[low]) / before_n, (sums[high] - sums[at]) / after_n
    change = np.where(good, after - before, 0.0)
    large = np.abs(change) >= np.maximum(MIN_CHANGE_PP, MIN_SHARE * np.maximum(before, after))
    large &= good
    out = []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (large * np.sign(change)).astype(np.int8), [0]))))
    for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if not large[first]:
            continue
        k = first + int(np.argmax(np.abs(change[first:end])))
        row = int(np.searchsorted(steps, at[k]))
        begin_us, end_us = int(times[max(row - 1, 0)]), int(times[row])
        out.append(Fall(axle, begin_us, end_us, float(before[k]), float(after[k])))
    return tuple(out)
