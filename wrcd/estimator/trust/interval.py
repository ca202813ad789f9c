"""How wide the interval must be, by what goes on: as the design found it on recordings that its rules had not seen."""

from enum import IntEnum

import numpy as np

from wrcd.estimator.design import REGIMES, FloatArray, IntArray, IntervalModel
from wrcd.estimator.paper.bank import BoolArray

MOVED = 0.1  # decades, above and below together, by which the torque has moved within half a second
COASTS = 0.1  # of what is available: less in use tells hardly anything


class Regime(IntEnum):
    """What goes on. The last that applies counts."""

    STEADY = 0
    MOVING = 1  # the torque
    COASTING = 2
    CHANGED = 3  # the window was cut just now
    SATURATED = 4

    @property
    def words(self) -> str:
        """The same in words."""
        return REGIMES[self]


def regime(swing: FloatArray, share: FloatArray, cut: BoolArray, saturated: BoolArray) -> IntArray:
    """(n,): of the torque's swing (n, 2), the share (n,) of what is available that is in use, and whether the window
    was cut, and the contact is saturated (n,)."""
    applies = np.array([swing.sum(axis=1) > MOVED, share < COASTS, cut, saturated])
    last = len(applies) - applies[::-1].argmax(axis=0)
    return np.where(applies.any(axis=0), last, Regime.STEADY)


def widening(model: IntervalModel, of: IntArray, speed_m_s: FloatArray) -> FloatArray:
    """(n,): what the half-width is multiplied by, in regimes at speeds (n,); beyond the model's, those at its ends."""
    held = np.fmin(np.fmax(speed_m_s, model.speeds_m_s[0]), model.speeds_m_s[-1])
    at = np.interp(np.log(held), np.log(model.speeds_m_s), np.arange(len(model.speeds_m_s)))
    low = np.minimum(at.astype(np.int64), len(model.speeds_m_s) - 2)
    share = at - low
    return np.asarray((1.0 - share) * model.factors[of, low] + share * model.factors[of, low + 1])
