"""Whether the rail or the torque has changed within the window: what came before is then dropped."""

import numpy as np

from wrcd.estimator.design import Design, FloatArray
from wrcd.estimator.paper.bank import BoolArray, SpeedTable
from wrcd.estimator.paper.window import Lengths, Window, mean_ratio, raw_power

# A torque of the moment that differs by this share and this ratio from what it was is a change, of the drive or of the
# rail: the window from before is dropped. The first is against the STEP_S before, the second against all of the rest: a
# driver's slow turning of the torque leaves the window longer than a slide does.
TORQUE_STEP, TORQUE_STEP_RATIO = 0.15, 0.004
TORQUE_TURN, TORQUE_TURN_RATIO = 0.15, 0.01
_TORQUE_SHARES, _TORQUE_RATIOS = (
    np.array([[TORQUE_STEP], [TORQUE_TURN]]),
    np.array([[TORQUE_STEP_RATIO], [TORQUE_TURN_RATIO]]),
)


class ChangeDetector:
    """Compares the newest part of a window with the rest: residuals and torque."""

    def __init__(self, design: Design) -> None:
        self._lengths = Lengths(design)
        self._limits = SpeedTable(design.changes, design.change_speeds_m_s)

    @property
    def recent_blocks(self) -> int:
        """The newest part's."""
        return self._lengths.recent

    def limits(self, speed_m_s: float) -> FloatArray:
        """(4,) decades at a speed."""
        return self._limits.at(speed_m_s)

    def steps(self, window: Window) -> FloatArray:
        """Decades (n, 4) by which the newest part's residuals lie above the rest's, NaN where either holds too
        little."""
        k = self._lengths
        return decades(window.plain(0, k.recent), window.plain(k.recent, k.usual), k.min_ticks)

    def changed(self, window: Window, speed_m_s: float) -> BoolArray:
        """(n,): which axles' rail or torque has changed."""
        k = self._lengths
        recent, rest = window.plain(0, k.recent), window.plain(k.recent, k.usual)
        apart = decades(recent, rest, k.min_ticks)
        out: BoolArray = np.logical_or.reduce(np.abs(apart) > self.limits(speed_m_s), axis=1)
        now = mean_ratio(window.plain(0, k.now))
        before = np.array((mean_ratio(window.plain(k.now, k.now + k.step)), mean_ratio(rest)))
        torque = np.abs(now - before) > _TORQUE_SHARES * np.maximum(now, before) + _TORQUE_RATIOS
        torque &= np.isfinite(apart[:, 0])
        out |= torque[0]
        out |= torque[1]
        return out


def decades(new: FloatArray, rest: FloatArray, min_ticks: float) -> FloatArray:
    """(n, 4) between the residuals of plain sums; NaN where either holds too little. Within quiet()."""
    powers = raw_power(np.concatenate((new, rest), axis=1), min_ticks)
    n = len(powers) // 2
    out: FloatArray = 0.5 * np.log10(powers[:n] / powers[n:])
    return out
