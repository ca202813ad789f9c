"""Who decides when to begin braking: the protocol of a driver beside the controllers, and one who stops at a mark."""

from collections.abc import Callable
from typing import Protocol

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.advice_receiver import AdviceReceiver
from sim_ecu.loop.control.braking_rate import RATES, AdvisedRate, RateLimits, needed_m_s2
from sim_ecu.loop.rig_messages import NewestFrame, rig_message
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config

LEVER_US = 50_000  # how often a driver moves the lever
REACTION_S = 0.8  # from the decision until the brake is applied: hand and brake together; our choice
NEAR_M = 0.3  # the rest of the way in which nothing is chosen any more
STANDS_M_S = 0.02
HOLDS_SHARE = 0.5  # of full service: a train that stands at the mark
SLIDES_SHARE, SLIDES_M_S = 0.05, 0.5  # slip that a driver is shown, whichever is more


class Driver(Protocol):
    """Pure: no clock, no bus. Times are microseconds from the run's start. ids: of the messages that it hears."""

    ids: tuple[int, ...]

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def demand(self, now_us: int, position_m: float, speed_m_s: float, mark_m: float | None) -> float:
        """Return the share of the full effort, -1 … 1, braking negative. mark_m: where to stand; None: nowhere."""


class Rule:
    """What a driver who stops at a mark goes by: one rate, and no test, unless a kind says more."""

    ids: tuple[int, ...] = ()

    def __init__(self, rate_m_s2: float) -> None:
        self._rate_m_s2 = rate_m_s2

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def look(self, now_us: int, position_m: float, speed_m_s: float) -> None:
        """Take where the train is."""

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the deceleration to plan with now, at this place."""
        return self._rate_m_s2

    def tests(self, now_us: int, position_m: float) -> bool:
        """Return whether to brake for a moment first."""
        return False

    def tested(self, now_us: int, position_m: float) -> None:
        """The moment is over."""

    @property
    def test_m_s2(self) -> float:
        """The brake of that moment."""
        return RATES.tests


class Advised(Rule):
    """Plans with what wrcd advises. tests: whether it brakes for a moment where it is not sure."""

    def __init__(self, config: Config, limits: RateLimits = RATES, *, tests: bool = True) -> None:
        super().__init__(limits.cautious)
        self._tests = tests
        self._receiver, self._rate, self._position_m = AdviceReceiver(config), AdvisedRate(limits), 0.0
        self.ids = (self._receiver.can_id,)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take an advice."""
        if self._receiver.hear(can_id, data, stamp_us) and (valid := self._receiver.valid) is not None:
            self._rate.take(stamp_us, self._position_m, *valid)

    def look(self, now_us: int, position_m: float, speed_m_s: float) -> None:
        """Take where the train is: an advice is of there."""
        self._position_m = position_m

    def rate_m_s2(self, now_us: int, position_m: float) -> float:
        """Return the advised rate."""
        return self._rate.rate_m_s2(now_us, position_m)

    def tests(self, now_us: int, position_m: float) -> bool:
        """Return whether a test may find more."""
        return self._tests and self._rate.tests(now_us, position_m)

    def tested(self, now_us: int, position_m: float) -> None:
        """Plan with what the test has found."""
        self._rate.tested(now_us, position_m)


class BrakeTesting(Rule):
    """Knows nothing of wrcd: brakes for a moment with the dry rate before every mark, and sees if a wheel slides."""

    def __init__(self, axles: tuple[int, ...], limits: RateLimits = RATES) -> None:
        super().__init__(limits.cautious)
        self._limits, self._slid, self._over, self._speed_m_s = limits, False, False, 0.0
        self._wheels = {w.message.frame_id: w for w in (NewestFrame(rig_message(f"WheelSpeed_A{n}")) for n in axles)}
        self.ids = tuple(self._wheels)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a wheel's speed."""
        wheel = self._wheels.get(can_id)
        if wheel is not None and wheel.take(data, stamp_us):
            slip = self._speed_m_s - float(wheel.values["WheelSpeed"])
            self._slid = self._slid or slip > max(SLIDES_SHARE * self._speed_m_s, SLIDES_M_S)

    def look(self, now_us: int, position_m: float, speed_m_s: float) -> None:
        """Take how fast the train is."""
        self._speed_m_s = speed_m_s

    def tests(self, now_us: int, position_m: float) -> bool:
        """Return whether it has not tested yet. What slid before counts no more: a speed that was silent is stale."""
        self._slid = False
        return not self._over

    def tested(self, now_us: int, position_m: float) -> None:
        """Plan with the dry rate if nothing slid."""
        self._over = True
        self._rate_m_s2 = self._limits.cautious if self._slid else self._limits.dry

    @property
    def test_m_s2(self) -> float:
        """The dry rate: less would not show whether the rail bears it."""
        return self._limits.dry


class MarkDriver:
    """Coasts until the mark needs what the rule plans with, then brakes so that the train stands at the mark.

    full_m_s2: deceleration of full service. begun_us: when the brake was decided on; None before. tested_us: when a
    test was.
    """

    def __init__(self, rule: Rule, full_m_s2: float, test_s: float = RATES.test_s) -> None:
        self.begun_us: int | None = None
        self.tested_us: int | None = None
        self.rate_m_s2 = 0.0  # that was planned with
        self.rule, self._full_m_s2, self._test_us = rule, full_m_s2, round(1e6 * test_s)
        self.ids = rule.ids
        self._testing = False
        self._applies_us = 0
        self._share = 0.0

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        self.rule.hear(can_id, data, stamp_us)

    def demand(self, now_us: int, position_m: float, speed_m_s: float, mark_m: float | None) -> float:
        """Return the share now."""
        self.rule.look(now_us, position_m, speed_m_s)
        if mark_m is None:
            return 0.0
        rest_m = mark_m - position_m
        if self._testing:
            if now_us < self._applies_us + self._test_us:
                return 0.0 if now_us < self._applies_us else -self.rule.test_m_s2 / self._full_m_s2
            self._testing = False
            self.rule.tested(now_us, position_m)
            self._decide(now_us, position_m, speed_m_s, rest_m, 0.0)
        elif self.begun_us is None:
            self._decide(now_us, position_m, speed_m_s, rest_m, REACTION_S)
        if self.begun_us is None or now_us < self._applies_us:
            return 0.0
        if speed_m_s < STANDS_M_S:
            self._share = -HOLDS_SHARE
        elif rest_m > NEAR_M or self._share == 0.0:
            self._share = -min(needed_m_s2(speed_m_s, rest_m) / self._full_m_s2, 1.0)
        elif rest_m <= 0.0:
            self._share = -1.0
        return self._share

    def _decide(self, now_us: int, position_m: float, speed_m_s: float, rest_m: float, reaction_s: float) -> None:
        """Begin to brake, or a test, if it is time. reaction_s: until the brake is applied."""
        rate = self.rule.rate_m_s2(now_us, position_m)
        needed = needed_m_s2(speed_m_s, rest_m - REACTION_S * speed_m_s)
        if needed < rate:
            return
        self._applies_us = now_us + round(1e6 * reaction_s)
        if needed <= self.rule.test_m_s2 and self.rule.tests(now_us, position_m):  # later there is no time for a test
            self.tested_us, self._testing = now_us, True
        else:
            self.begun_us, self.rate_m_s2 = now_us, rate


POLICIES = ("wrcd", "tests", "dry", "slippery")


def make_driver(name: str, facts: Facts, config: Config | None = None) -> MarkDriver:
    """A driver by the name of a policy: one of POLICIES. config: of the daemon that "wrcd" listens to; None: the
    packaged one with its advice. KeyError for another name, InputError for a configuration without advice."""
    rules: dict[str, Callable[[], Rule]] = {
        "wrcd": lambda: Advised(config or load_packaged(len(facts.axles), advice=True)),
        "tests": lambda: BrakeTesting(facts.axles),
        "dry": lambda: Rule(RATES.dry),
        "slippery": lambda: Rule(RATES.cautious),
    }
    return MarkDriver(rules[name](), facts.full_brake_m_s2)
