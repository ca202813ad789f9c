"""When to begin to brake for a mark, and how hard: what a driver's assistant or ATO makes of AdhesionAdvice.

For the engineer of a train, to be read and copied; `wrcd kit` has the same in C. The rules:

1. Plan with KEPT of the lower end of the deceleration that the rail bears, as the newest Valid advice states it.
2. Never plan with more than the dry rate. Nothing that wrcd says lets a train brake later than without it.
3. Advice that is Degraded, not available or silent says nothing. The last Valid one holds for some seconds; then plan
   with the cautious rate. For a train that has not moved since, it holds for minutes: it is of the rail under it.
4. Brake as soon as the deceleration that the mark needs is as much as the plan. From then on the mark alone decides.

What was planned with is no promise: a film that begins behind the place where the train begins to brake is unknown to
everybody, and wheel-slide protection stays what it is.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class RateLimits:
    """Decelerations in m/s2. All are this project's own choice, of the size of a multiple unit's."""

    dry: float = 0.9  # what a train brakes with for a station where it thinks of nothing
    cautious: float = 0.35  # what it brakes with where it knows nothing, and the rail may be slippery
    least: float = 0.25  # less is not planned with: a train has to arrive
    kept: float = 0.85  # of the lower end: slip control does not use all that there is
    holds_s: float = 2.0  # how long the last Valid advice holds on the way,
    stands_s: float = 300.0  # and for a train within `same_m` of where it was given
    same_m: float = 30.0


RATES = RateLimits()


class AdvisedRate:
    """Keeps the newest Valid advice and says the rate to plan with."""

    def __init__(self, limits: RateLimits = RATES) -> None:
        self.limits = limits
        self._low_m_s2 = self._position_m = math.nan
        self._stamp_us = 0

    def take(self, now_us: int, position_m: float, low_m_s2: float) -> None:
        """Take a Valid advice's lower end of deceleration (m/s2); what is not Valid is not taken."""
        self._low_m_s2, self._position_m, self._stamp_us = low_m_s2, position_m, now_us

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the rate to plan with now, at this place."""
        c = self.limits
        moved = not abs(position_m - self._position_m) <= c.same_m
        if math.isnan(self._low_m_s2) or now_us - self._stamp_us > (c.holds_s if moved else c.stands_s) * 1e6:
            return c.cautious
        return min(max(c.kept * self._low_m_s2, c.least), c.dry)


def needed_m_s2(speed_m_s: float, rest_m: float) -> float:
    """Return the even deceleration that stops a train in what is left of its way; infinite where nothing is left."""
    return speed_m_s**2 / (2.0 * rest_m) if rest_m > 0.0 else math.inf
