"""Runs of an estimator over what the sensors of a steady wheelset measure."""

from collections.abc import Iterator

import numpy as np

from tests.support.signals import measured
from tests.support.stepped import SteppedEstimator, Tick
from wrcd.core.design import FloatArray
from wrcd.core.records import Estimate

RATIO = 0.136  # of the torque that `measured` has by default
EVERY = 4  # ticks between two estimates, as on the bus
PER_S = 200


def tick(k: int, z: FloatArray, ratio: float | FloatArray = RATIO, speed: float = 25.0) -> Tick:
    n = z.shape[1]
    return Tick(k, z, np.isfinite(z), np.broadcast_to(np.asarray(ratio, np.float64), n).copy(), speed)


def track(seconds: float, seed: int = 1, curve: str = "B", torque_Nm: float = 10_000.0) -> FloatArray:
    """z (ticks, 2, 1)."""
    return measured(curve, torque_Nm, seconds=seconds, seed=seed)[..., None]


def estimates(
    e: SteppedEstimator, z: FloatArray, ratio: FloatArray | float = RATIO, first: int = 0
) -> Iterator[Estimate]:
    """Every EVERY ticks over z (ticks, 2, n) from a tick on."""
    ratios = np.broadcast_to(ratio, len(z))
    for k, row in enumerate(z):
        e.step(tick(first + k, row, float(ratios[k])))
        if (k + 1) % EVERY == 0:
            yield e.estimate()
