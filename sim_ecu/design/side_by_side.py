"""The train's estimator for more axles than a train has: recordings of many conditions are played to it at once."""

from dataclasses import fields

import numpy as np

from wrcd.core.design import Design, FloatArray, IntArray
from wrcd.core.estimator import Estimator
from wrcd.core.records import Estimate, Ticks
from wrcd.core.terms import MAX_AXLES


class SideBySide:
    """Any number of axles at one speed, in trains of up to MAX_AXLES: bogies stay together."""

    def __init__(self, design: Design, axles: int) -> None:
        self._places = [slice(k, min(k + MAX_AXLES, axles)) for k in range(0, axles, MAX_AXLES)]
        self._trains = [Estimator(design, at.stop - at.start) for at in self._places]

    def run(self, ticks: Ticks, first: int, end: int, resets: bool) -> None:
        """Step ticks first … end - 1 of them; resets: whether axles are reset that need it."""
        for at, train in zip(self._places, self._trains, strict=True):
            z, present, ratio = ticks.z[..., at], ticks.present[..., at], ticks.torque_ratio[:, at]
            train.run(Ticks(ticks.number, z, present, ratio, ticks.speeds_m_s), first, end, resets)

    def estimate(self, axles: int | None = None) -> Estimate:
        """The adhesion of every axle, or at least of the first so many."""
        trains = zip(self._places, self._trains, strict=True)
        found = [train.estimate() for at, train in trains if axles is None or at.start < axles]
        return Estimate(*(np.concatenate([getattr(e, f.name) for e in found]) for f in fields(Estimate)))

    def torque_now(self) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known."""
        return np.concatenate([train.torque_now() for train in self._trains])

    def inputs_of(self, blocks: IntArray, now: FloatArray) -> FloatArray:
        """What the rules are given (n, COLUMNS) of windows of so many blocks (n,). now (n,): torque ratio of the
        moment."""
        trains = zip(self._places, self._trains, strict=True)
        return np.concatenate([train.inputs_of(blocks[at], now[at]) for at, train in trains])

    def steps(self) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above those of the rest of the usual window."""
        return np.concatenate([train.steps() for train in self._trains])

    def features(self) -> FloatArray:
        """(n, PAIR_FEATURES) that pairs of sensors are judged by, after a look."""
        return np.concatenate([train.features() for train in self._trains])
