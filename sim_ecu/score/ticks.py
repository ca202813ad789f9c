"""What every estimator of a comparison is given."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Ticks:
    """t ticks of n axles of one run, which share the speed. z and torque_ratio are NaN where unknown.

    z and present (t, 2, n): yaw rate (rad/s), lateral acceleration (m/s2), and whether the tick brought them.
    torque_ratio (t, n): |torque| / (2 N r_0).
    """

    z: FloatArray
    present: BoolArray
    torque_ratio: FloatArray
    speed_m_s: FloatArray  # (t,)
    tick_s: float
    number: NDArray[np.int64]  # (t,) of each tick on the bus; they are in order, and some may be missing
    seen: FloatArray | None = None  # (t, n, inputs) what the estimator's rules saw last, NaN before they saw anything


def running_mean(values: FloatArray, window: int) -> FloatArray:
    """Means (t, …) over the newest `window` ticks, or as many as there are yet."""
    total = np.cumsum(np.concatenate((np.zeros_like(values[:1]), values)), axis=0)
    newest = np.arange(1, len(total))
    oldest = np.maximum(newest - window, 0)
    count = (newest - oldest).reshape(-1, *[1] * (values.ndim - 1))
    mean: FloatArray = (total[newest] - total[oldest]) / count
    return mean
