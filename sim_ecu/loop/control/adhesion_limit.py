"""An axle's limit of effort from its adhesion frames: where to start, where to resume, and probing for the rest.

The estimate may be wrong either way, so it is never the last word. Effort starts at what the estimate carries, and goes
on from there as fast as the wheel shows no creep: a false low is passed within tenths of a second. Where the creep
rises (the knee of the creep curve) the estimate says where to stay, within a tenth of what was just found. From there
it probes again and again, for the rail gets better too. A deep slide says that the rail is another: then the slip
control is alone until the estimate is steady. docs/reference/what-a-controller-does.md has the rules.
"""

import math
from dataclasses import dataclass
from enum import Enum

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, AdhesionReceiver

PERIOD_S = CYCLE_US * 1e-6


@dataclass(frozen=True, slots=True)
class LimitConstants:
    """Our choice, found on training seeds. Rates are per second of the limit itself, creeps are ratios."""

    aim: float = 0.94  # of the adhesion that is there
    half_widths: float = 0.5  # of Confidence that are taken off first
    pull_aim: float = 0.92  # the same when pulling
    pull_half_widths: float = 1.0
    fall_s: float = 0.1  # time constant after which a lower estimate is believed
    rise_s: float = 0.4  # in which a higher one is followed: the law's own slide costs less than a longer stop
    pull_rise_s: float = 0.6  # the same when pulling
    fast: float = 6.0  # growth at first, where more has been carried or nothing is known yet,
    fast_doubles_s: float = 0.08  # and it doubles in so long
    slow: float = 0.2  # beyond what was found
    slow_doubles_s: float = 0.2
    rise_N_m_s: float = 60_000.0  # the most that either comes to
    ahead_N_m: float = 3500.0  # of what the actuators give, at most, while the wheel shows no creep
    near: float = 0.8  # of what was found: fast up to it
    knee: float = 0.008  # creep at which a probe ends
    far_knee: float = 0.008  # the same where the estimate has been left far behind
    far: float = 1.5  # times what the estimate carries
    over: float = 0.022  # creep at which effort is taken off
    keep: tuple[float, float] = (0.9, 0.98)  # of the torque at the knee: what is kept of it,
    pull_keep: tuple[float, float] = (0.88, 0.97)  # the same when pulling,
    keep_alone: tuple[float, float] = (0.96, 0.98)  # the same where no frame may be used, or the knee is in doubt
    take: tuple[float, float] = (0.8, 0.95)  # the same where effort is taken off
    after_slide: float = 0.85  # of the torque at which a slide began: what is demanded at most
    hold_s: float = 2.0  # between probes,
    pull_hold_s: float = 3.5  # the same when pulling,
    doubt_s: float = 0.4  # the same where the knee lies so many times above what the estimate carries:
    doubt: float = 1.25  # and, without a frame, where it lies elsewhere than before; then it doubles up to hold_s
    settle_s: float = 0.15  # between two steps down
    surprise: float = 0.06  # creep of a slide that nothing foretold: the rail is another
    pull_surprise: float = 0.06  # the same when pulling
    free_s: float = 1.2  # without a slide of the law, before the estimate may limit a brake again
    steady: float = 0.25  # share by which the estimate may differ from its own mean of the last
    steady_s: float = 0.4  # for so long: then it is of a rail that stays
    memory_s: float = 30.0  # without a frame that may be used: from then on the limit is lifted,
    lift: float = 0.25  # by so much of the demand a second
    smooth: float = 0.5  # of a new creep, in each cycle


class Probe(Enum):
    """What the limit does."""

    WAIT = 0
    CLIMB = 1
    FREE = 2  # the rail has changed under the wheel: a brake is the law's alone


class AdhesionLimit:
    """The limit of one axle.

    unit_N_m: torque at the wheelset that takes an adhesion of 1, its own rotation included.
    """

    def __init__(self, source: AdhesionReceiver, unit_N_m: float) -> None:
        self._source, self._unit_N_m, self._c = source, unit_N_m, LimitConstants()
        self.limit_N_m: float | None = None
        self._carried_N_m: float | None = None  # what the estimate carries, its rises followed slowly
        self._used_us = 0  # when a frame was last used
        self._saturated = False
        self._unsteady_us, self._mean_N_m, self._rise_s = 0, 0.0, self._c.rise_s
        self._hold_s = self._c.hold_s
        self._creep = 0.0
        self._was_sliding = False
        self._state = Probe.WAIT
        self._end()

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        self._source.hear(can_id, data, stamp_us)

    def limit(
        self, now_us: int, demand_N_m: float, given_N_m: float, creep: float, sliding: bool, braking: bool
    ) -> float | None:
        """Return the most |torque| to demand in this cycle (N m); None: no limit.

        demand_N_m: |torque| that the driver demands. given_N_m: |torque| that the actuators are thought to give. creep,
        sliding: as the controller's own slip control sees them.
        """
        self._creep += self._c.smooth * (creep - self._creep)
        begins, self._was_sliding = sliding and not self._was_sliding, sliding
        used = self._follow(now_us, demand_N_m, braking)
        carried = self._carried_N_m
        if self._state is Probe.FREE:
            self._return(now_us, demand_N_m, given_N_m, sliding, used)
            return self.limit_N_m
        if carried is None or (self.limit_N_m is None and not used):
            return None
        if used and demand_N_m <= carried and (self.limit_N_m is None or self.limit_N_m >= demand_N_m):
            self._end()
            return None
        now = self.limit_N_m if self.limit_N_m is not None else max(carried, given_N_m)
        if sliding and self._creep > (self._c.surprise if braking else self._c.pull_surprise):
            self._state, self._free_us, self.limit_N_m = Probe.FREE, now_us, None
            return None
        if sliding:
            now = self._slide(now, now_us, given_N_m, carried, begins)
        elif self._creep > self._c.over:
            now = self._step_down(now, now_us, given_N_m, carried)
        else:
            now = self._probe(now, now_us, given_N_m, carried, braking)
        if now_us - self._used_us > self._c.memory_s * 1e6:
            now = max(now, (self.limit_N_m or 0.0) + self._c.lift * demand_N_m * PERIOD_S)
        if now >= demand_N_m and (not used or demand_N_m <= carried):
            self._end()
            return None
        self.limit_N_m = min(now, demand_N_m)
        return self.limit_N_m

    def _end(self) -> None:
        """No limit, and nothing found."""
        self.limit_N_m = None
        self._found_N_m = math.inf  # the torque at the last knee or slide: nothing is known yet
        self._growth = 0.0
        self._state = Probe.WAIT
        self._hold_s = self._c.doubt_s
        self._wait_until_us = self._settled_us = self._free_us = 0

    def _return(self, now_us: int, demand_N_m: float, given_N_m: float, sliding: bool, used: bool) -> None:
        """Limit a brake again that is the law's alone, from what it carries now: where it has not slid for some time,
        and the estimate is of a rail that stays."""
        if sliding:
            self._free_us = now_us
        steady_us = now_us - self._unsteady_us
        if not used or steady_us < self._c.steady_s * 1e6 or now_us - self._free_us < self._c.free_s * 1e6:
            return
        self._end()
        if given_N_m < demand_N_m:
            self.limit_N_m = self._knee(now_us, given_N_m, given_N_m, self._c.keep)

    def _follow(self, now_us: int, demand_N_m: float, braking: bool) -> bool:
        """Follow the estimate: down at once, up slowly. False where there is none to be used."""
        c, usable = self._c, self._source.adhesion(now_us)
        if usable is None:
            return False
        self._used_us, self._saturated = now_us, usable.saturated
        if usable.half_width is None:
            return False
        self._hold_s = c.hold_s if braking else c.pull_hold_s
        self._rise_s = c.rise_s if braking else c.pull_rise_s
        aim, widths = (c.aim, c.half_widths) if braking else (c.pull_aim, c.pull_half_widths)
        carries = self._unit_N_m * aim * max(usable.mu - widths * usable.half_width, 0.5 * usable.mu)
        self._mean_N_m += (carries - self._mean_N_m) * PERIOD_S / c.steady_s
        if abs(carries - self._mean_N_m) > c.steady * self._mean_N_m:
            self._unsteady_us = now_us
        if self._carried_N_m is None or (self.limit_N_m is None and demand_N_m < carries):
            self._carried_N_m = carries
        elif carries < self._carried_N_m:
            self._carried_N_m += (carries - self._carried_N_m) * PERIOD_S / c.fall_s
        else:
            self._carried_N_m += min(carries - self._carried_N_m, carries * PERIOD_S / self._rise_s)
        return True

    def _slide(self, now: float, now_us: int, given_N_m: float, carried_N_m: float, begins: bool) -> float:
        """The law cuts: resume at what the estimate carries, and below where the slide began."""
        if begins:
            self._found_N_m = given_N_m
        self._wait(now_us, carried_N_m)
        return min(now, carried_N_m, self._c.after_slide * self._found_N_m)

    def _step_down(self, now: float, now_us: int, given_N_m: float, carried_N_m: float) -> float:
        """The wheel creeps too much, though the law does not cut yet."""
        if now_us < self._settled_us:
            return now
        return min(now, self._knee(now_us, given_N_m, carried_N_m, self._c.take))

    def _probe(self, now: float, now_us: int, given_N_m: float, carried_N_m: float, braking: bool) -> float:
        """Demand more while the wheel does not creep."""
        c = self._c
        if self._creep > (c.far_knee if given_N_m > c.far * carried_N_m else c.knee):
            if self._state is Probe.CLIMB:
                agrees = self._used_us == now_us and given_N_m <= c.doubt * carried_N_m
                keep = (c.keep if braking else c.pull_keep) if agrees else c.keep_alone
                return min(now, self._knee(now_us, given_N_m, carried_N_m, keep))
            return now
        follows = max(now, min(carried_N_m, now + carried_N_m * PERIOD_S / self._rise_s))
        fast = braking and now < c.near * self._found_N_m
        ahead = c.ahead_N_m if fast and self._creep < 0.5 * c.knee else 0.15 * now + 300.0
        if not braking and self._saturated:
            return now
        if now_us < self._wait_until_us or now - given_N_m > ahead:
            return follows  # what was demanded has not come yet
        if self._state is Probe.WAIT:
            self._state, self._growth = Probe.CLIMB, c.fast if fast else c.slow
        else:
            self._growth *= 2.0 ** (PERIOD_S / (c.fast_doubles_s if fast else c.slow_doubles_s))
        if not fast and self._found_N_m < math.inf and now - self._growth * now * PERIOD_S < c.near * self._found_N_m:
            self._growth = min(self._growth, c.slow)
        more = now + min(self._growth * now, c.rise_N_m_s) * PERIOD_S
        return max(more, follows)

    def _knee(self, now_us: int, given_N_m: float, carried_N_m: float, keep: tuple[float, float]) -> float:
        """Where to stay, after the torque at which the creep rises was found."""
        same = given_N_m < self._c.doubt * self._found_N_m and self._found_N_m < self._c.doubt * given_N_m
        self._hold_s = min(2.0 * self._hold_s, self._c.hold_s) if same else self._c.doubt_s
        self._found_N_m = given_N_m
        self._wait(now_us, carried_N_m)
        return min(max(carried_N_m, keep[0] * given_N_m), keep[1] * given_N_m)

    def _wait(self, now_us: int, carried_N_m: float) -> None:
        self._state = Probe.WAIT
        doubtful = self._found_N_m > self._c.doubt * carried_N_m
        self._wait_until_us = now_us + round((self._c.doubt_s if doubtful else self._hold_s) * 1e6)
        self._settled_us = now_us + round(self._c.settle_s * 1e6)
