"""The vehicle's speed as the bank needs it: at every tick, without the steps and the noise of its signal."""

import math

MEMORY_S = 0.3  # time constant: long against a cycle of the speed signal, short against a braking
RATE_AFTER_TICKS = 20  # before, the rate of change is not known from the noise
MAX_ERROR_M_S = 1.5  # a signal further away than this is another one: start with it


class SpeedFilter:
    """Alpha-beta filter: tracks the speed and its rate, so that a steady acceleration leaves no lag.

    The signal comes every few ticks, with noise and in steps. Gains and noise tables that followed it would toggle.
    """

    STATE = {"speed": "_speed", "rate": "_rate", "ticks": "_ticks"}

    def __init__(self, tick_s: float) -> None:
        self._alpha = 1.0 - math.exp(-tick_s / MEMORY_S)
        self._beta = 0.5 * self._alpha**2
        self._max_ticks = max(RATE_AFTER_TICKS + 1, math.ceil(1.0 / self._alpha))
        self._speed = math.nan
        self._rate = 0.0  # per tick
        self._ticks = 0  # of this signal, as far as they count

    def checkpoint(self) -> tuple[float, float, int]:
        """The state, for rollback()."""
        return self._speed, self._rate, self._ticks

    def rollback(self, to: tuple[float, float, int]) -> None:
        """Undo everything since a checkpoint."""
        self._speed, self._rate, self._ticks = to

    def reset(self) -> None:
        """Start with the next signal."""
        self._speed, self._rate, self._ticks = math.nan, 0.0, 0

    def step(self, speed_m_s: float) -> float:
        """The filtered speed (m/s) at a tick whose newest signal is speed_m_s; NaN if that is not finite."""
        if not math.isfinite(speed_m_s):
            self.reset()
            return math.nan
        if not self._ticks or abs(speed_m_s - self._speed) > MAX_ERROR_M_S:
            self._speed, self._rate, self._ticks = speed_m_s, 0.0, 1
            return speed_m_s
        predicted = self._speed + self._rate
        error = speed_m_s - predicted
        self._ticks = min(self._ticks + 1, self._max_ticks)
        self._speed = predicted + max(self._alpha, 1.0 / self._ticks) * error
        if self._ticks > RATE_AFTER_TICKS:
            self._rate += self._beta * error
        return self._speed
