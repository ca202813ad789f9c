"""What a good frame may still get wrong: a sensor that stands still while the train moves, a value that jumps."""

import math

from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity

# A sensor on a moving wheelset seldom says the same twice: its noise alone moves it by some steps of its converter.
# How seldom is learnt; a run of equal values that would come about by chance once in so many frames is
# doubted (the axle is not Valid while it lasts, and for a window after it: once in some hours is seldom enough), and
# one that never would is refused.
DOUBTED, STUCK = math.log(1e-6), math.log(1e-12)
MIN_RUN = 4
# Of frames that repeat the one before: at first and at least, for a sensor that vibration dithers at speed is coarser
# where the train is slow; and while it is learnt.
FIRST_SHARE, FIRST_FRAMES, MAX_FRAMES = 0.05, 20.0, 1000.0
GOES_ON = 1.5  # a run goes on oftener than frames repeat: most where the slow value is in the middle of a step (1.41)
MAX_SHARE = 0.9  # of runs that go on; a coarser sensor is not watched: it would be doubted after 0.7 s at 200 Hz
STUCK_CHECKED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)

# What no vehicle changes by from one frame to the next (or within 0.1 s, if that is longer). A value further away is
# refused, and believed if the next frame says so, too: a real step comes a frame late, a corrupted frame not at all.
MAX_STEP = {
    Quantity.TORQUE: 4000.0,
    Quantity.BRAKE_TORQUE: 4000.0,
    Quantity.SPEED: 1.0,
    Quantity.AXLE_LOAD: 20_000.0,
    Quantity.WHEEL_RADIUS: 0.02,
}


class StuckCheck:
    """Watches a sensor that must move."""

    value: float
    run: int  # equal neighbours in a row
    _changed_us: int | None
    _share: float
    _frames: float

    def __init__(self, ends: tuple[float, float] = (-math.inf, math.inf)) -> None:
        """ends: the values from which on it is clipped."""
        self._ends = ends
        self._share, self._frames = FIRST_SHARE, FIRST_FRAMES
        self.reset()

    def reset(self) -> None:
        """Nothing that came before counts; how coarse the sensor is, is remembered."""
        self.value = math.nan
        self.run = 0
        self._changed_us = None

    def check(self, value: float, stamp_us: int, moving: bool) -> Reason | None:
        """STUCK for a value that has been the same for too long."""
        if value == self.value and moving:
            self.run += 1
            return Reason.STUCK if self.run >= MIN_RUN and self.run >= self._longest(STUCK) else None
        low, high = self._ends
        if value != self.value and low < self.value < high:  # clipped, it repeats itself, however fine it is
            self._learn(self.run)
        self.run, self._changed_us, self.value = 0, stamp_us, value
        return None

    def _learn(self, run: int) -> None:
        """How often it repeats itself; a stuck sensor must not teach that it always does."""
        if run < self._longest(STUCK):
            for repeats in [True] * min(run, MIN_RUN) + [False] * (run < MIN_RUN):
                self._frames = min(self._frames + 1.0, MAX_FRAMES)
                self._share += (repeats - self._share) / self._frames

    def unchanged(self, now_us: int, timeout_us: int) -> bool:
        """Whether it has sent the same for longer than its time-out, and oftener than by chance, or is clipped."""
        low, high = self._ends
        return (
            self._changed_us is not None
            and now_us - self._changed_us > timeout_us
            and self.run >= (self._longest(DOUBTED) if low < self.value < high else MIN_RUN)
        )

    def _longest(self, chance: float) -> int:
        """Equal neighbours that come about with less than a chance (its logarithm)."""
        return longest_run(self._share, chance)


def longest_run(share: float, chance: float) -> int:
    """Equal neighbours that come about with less than a chance (its logarithm), where a share of the frames repeats."""
    return max(MIN_RUN, math.ceil(chance / math.log(min(GOES_ON * max(share, FIRST_SHARE), MAX_SHARE))))


def cost_of_step(steps: float) -> str:
    """What a converter's step of so many times the rms of the sensor's noise costs. A slow value repeats itself most
    where it stands in the middle of a step."""
    share = math.erf(steps / math.sqrt(8.0)) / math.sqrt(2.0)
    if GOES_ON * share > MAX_SHARE:
        return "a sound one is taken for frozen"
    return f"a frozen one is found after {longest_run(share, DOUBTED)} repeats, and a sound one may be taken for it"


class JumpCheck:
    """Watches a quantity that cannot jump."""

    _value: float
    _stamp_us: int
    _doubted: float  # the value that was refused last

    def __init__(self, max_step: float, timeout_us: int) -> None:
        self._max_step, self._timeout_us = max_step, timeout_us
        self.reset()

    def reset(self) -> None:
        """Nothing that came before counts."""
        self._value = math.nan
        self._stamp_us = 0
        self._doubted = math.nan
        self.jumped = False  # whether the newest value is believed, and far from the one before

    def check(self, value: float, stamp_us: int) -> Reason | None:
        """JUMP for a value too far from the one before; believed is what a second frame confirms, or comes after a
        gap."""
        age_us, self.jumped = stamp_us - self._stamp_us, False
        most = self._max_step * max(1.0, age_us / 100_000)
        if age_us <= self._timeout_us and abs(value - self._value) > most:
            if not abs(value - self._doubted) <= most:
                self._doubted = value
                return Reason.JUMP
            self.jumped = True
        self._value, self._stamp_us, self._doubted = value, stamp_us, math.nan
        return None
