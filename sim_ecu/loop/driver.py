"""Who decides when to begin to brake: the protocol of a driver beside the controllers, and one who stops at a mark."""

from typing import Protocol

from sim_ecu.loop.control.braking_rate import needed_m_s2

LEVER_US = 50_000  # how often a driver moves the lever
REACTION_S = 0.8  # from the decision until the brake is applied: hand and brake together; our choice
NEAR_M = 0.3  # the rest of the way in which nothing is chosen any more
STANDS_M_S = 0.02
HOLDS_SHARE = 0.5  # of full service: a train that stands at the mark


class Driver(Protocol):
    """Pure: no clock, no bus. Times are microseconds from the run's start."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def demand(self, now_us: int, position_m: float, speed_m_s: float, mark_m: float | None) -> float:
        """Return the share of the full effort, -1 … 1, braking negative. mark_m: where to stand; None: nowhere."""


class Rule(Protocol):
    """What a driver who stops at a mark goes by."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the deceleration to plan with now, at this place."""


class Always:
    """Plans with one rate, whatever the bus says."""

    def __init__(self, rate_m_s2: float) -> None:
        self._rate_m_s2 = rate_m_s2

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Nothing on the bus is for this one."""

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the rate."""
        return self._rate_m_s2


class MarkDriver:
    """Coasts until the mark needs what the rule plans with, then brakes so that the train stands at the mark.

    full_m_s2: deceleration of full service. begun_us: when the brake was decided on; None before.
    """

    def __init__(self, rule: Rule, full_m_s2: float) -> None:
        self.begun_us: int | None = None
        self.rate_m_s2: float | None = None  # that was planned with
        self._rule, self._full_m_s2 = rule, full_m_s2
        self._share = 0.0

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        self._rule.hear(can_id, data, stamp_us)

    def demand(self, now_us: int, position_m: float, speed_m_s: float, mark_m: float | None) -> float:
        """Return the share now."""
        if mark_m is None:
            return 0.0
        rest_m = mark_m - position_m
        if self.begun_us is None:
            rate = self._rule.rate_m_s2(now_us, position_m)
            if needed_m_s2(speed_m_s, rest_m - REACTION_S * speed_m_s) < rate:
                return 0.0
            self.begun_us, self.rate_m_s2 = now_us, rate
        if now_us - self.begun_us < REACTION_S * 1e6:
            return 0.0
        if speed_m_s < STANDS_M_S:
            self._share = -HOLDS_SHARE
        elif rest_m > NEAR_M or self._share == 0.0:
            self._share = -min(needed_m_s2(speed_m_s, rest_m) / self._full_m_s2, 1.0)
        elif rest_m <= 0.0:
            self._share = -1.0
        return self._share
