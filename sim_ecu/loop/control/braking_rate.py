"""When to begin to brake for a mark, and how hard: what a driver's assistant or ATO makes of AdhesionAdvice.

For the engineer of a train, to be read and copied; `wrcd kit` has the same in C. The rules:

1. Plan with KEPT of the lower end of the deceleration that the rail bears, as the newest Valid advice states it.
2. Never plan with more than the dry rate: advice lets no train brake later than one that thinks of dry rail.
3. Advice that is Degraded, not available or silent says nothing. The last Valid one holds for some seconds, then the
   cautious rate is planned with. For a train that has not moved since, it holds for minutes: the rail is the same.
4. Brake as soon as the mark needs the deceleration that is planned with. From then on the mark alone decides.
5. A coasting wheel tells little of its rail. Where rule 4 would begin at less than the dry rate by what a coasting
   train's advice says, brake for a moment first, as hard as a rail may have to bear, and plan with what the advice says
   at its end. If that is enough for later, coast on. It holds for a minute, or until the advice falls to a fraction of
   what it was before.

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
    tests: float = 0.7  # the brake of a moment,
    test_s: float = 1.6  # which lasts so long, of which the advice needs a second
    found_s: float = 60.0  # how long what it has found holds: for this mark, not for the next
    falls_to: float = 0.6  # of the estimate before the test: what is less is another rail


RATES = RateLimits()


class AdvisedRate:
    """Keeps the newest Valid advice and what a test has found, and says the rate to plan with."""

    def __init__(self, limits: RateLimits = RATES) -> None:
        self.limits = limits
        self._low_m_s2 = self._middle_m_s2 = self._position_m = math.nan
        self._stamp_us = 0
        self._tested_m_s2: float | None = None
        self._tested_us = 0
        self._before_m_s2 = math.nan  # the estimate as the test began

    def take(self, now_us: int, position_m: float, low_m_s2: float, middle_m_s2: float) -> None:
        """Take a Valid advice: the lower end of deceleration and the deceleration (m/s2). What is not Valid is not
        taken."""
        self._low_m_s2, self._middle_m_s2 = low_m_s2, middle_m_s2
        self._position_m, self._stamp_us = position_m, now_us
        if self._tested_m_s2 is not None and middle_m_s2 < self.limits.falls_to * self._before_m_s2:
            self._tested_m_s2 = None

    def holds(self, now_us: int, position_m: float) -> bool:
        """Return whether the last Valid advice still says something."""
        moved = not abs(position_m - self._position_m) <= self.limits.same_m
        age_us = now_us - self._stamp_us
        return not math.isnan(self._low_m_s2) and age_us <= 1e6 * (
            self.limits.holds_s if moved else self.limits.stands_s
        )

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the rate to plan with now, at this place."""
        if not self.holds(now_us, position_m):
            return self.limits.cautious
        now = self._planned(self._low_m_s2)
        found = self._found_m_s2(now_us)
        return now if found is None else max(now, found)

    def tests(self, now_us: int, position_m: float) -> bool:
        """Return whether a test may find more than is known: begin one, or brake for the mark."""
        if self._found_m_s2(now_us) is not None or not self.holds(now_us, position_m):
            return False
        if self._planned(self._low_m_s2) >= self.limits.dry:
            return False
        self._before_m_s2 = self._middle_m_s2
        return True

    def tested(self, now_us: int, position_m: float) -> None:
        """End a test: what the advice says now is what it has found."""
        self._tested_us = now_us
        self._tested_m_s2 = self._planned(self._low_m_s2) if self.holds(now_us, position_m) else self.limits.cautious

    def _found_m_s2(self, now_us: int) -> float | None:
        """What the last test has found; None where it does not hold any more."""
        return self._tested_m_s2 if now_us - self._tested_us <= self.limits.found_s * 1e6 else None

    def _planned(self, low_m_s2: float) -> float:
        return min(max(self.limits.kept * low_m_s2, self.limits.least), self.limits.dry)


def needed_m_s2(speed_m_s: float, rest_m: float) -> float:
    """Return the even deceleration that stops a train in what is left of its way; infinite where nothing is left."""
    return speed_m_s**2 / (2.0 * rest_m) if rest_m > 0.0 else math.inf
