"""The controller's ground speed: made from the wheels, proved after a start, met again by releasing axles in turn.

Braking, no wheel turns faster than the train runs: the fastest wheel is a lower bound. When all slide, the bound goes
on by the most that the train can slow down: by the force that the wheels can be passing on, which follows from torque
and wheel acceleration, and a margin for what a controller does not know. Traction is the mirror of it.
"""

from collections import deque
from collections.abc import Sequence

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.controlled_axle import ControlledAxle, Release

# Our choice: load, wheel radius and pad friction are known to a tenth; a gradient of 1 % is not known at all.
MARGIN = 1.1
GRADIENT_M_S2 = 0.1
# After a change between traction and braking a wheel may still spin (slide) from before: it is not believed for so
# long, if it is so far from the reference. Our choice: wheels without torque come back within this.
SETTLE_S, SETTLED_M_S = 0.7, 0.2


class ReferenceSpeed:
    """Ground speed (m/s) from wheel speeds, one step per cycle. speed_m_s is None before the first wheel speed."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self.speed_m_s: float | None = None
        self._braking: bool | None = None
        self._settles_s = 0.0

    def forget(self) -> None:
        """Start anew: time has passed that nobody counted."""
        self.speed_m_s = None

    def step(
        self, wheels_m_s: Sequence[float], forces_N: Sequence[float], braking: bool, period_s: float
    ) -> float | None:
        """One cycle on.

        wheels_m_s: circumferential speeds that were received (none: extrapolates). forces_N: of each axle, the force at
        the rail in the direction of the effort, at least 0.
        """
        sign = 1.0 if braking else -1.0
        seen = [sign * w for w in wheels_m_s]
        if self.speed_m_s is None:
            self.speed_m_s = sign * max(seen) if seen else None
            self._braking = braking
            return self.speed_m_s
        self._settles_s = SETTLE_S if braking is not self._braking else max(self._settles_s - period_s, 0.0)
        self._braking = braking
        mass_kg = self._facts.wheelset.M_v * len(self._facts.axles)
        held = sign * self.speed_m_s - (MARGIN * sum(forces_N) / mass_kg + GRADIENT_M_S2) * period_s
        if self._settles_s > 0.0:
            seen = [w for w in seen if w < held + SETTLED_M_S]
        self.speed_m_s = max(sign * max([held, *seen]), 0.0)
        return self.speed_m_s


class Resync:
    """The releases of a train's axles, in turn."""

    def __init__(self, axles: int, constants: Release | None = None) -> None:
        self._c = constants or Release()
        self._turn = 0
        self._axles = axles
        self._proved_us = 0
        self._began_us: int | None = None
        self._torque_N_m = 0.0
        self._was_sliding = [False] * axles
        self.releases = 0

    def skip(self, k: int) -> None:
        """Pass the turn on: axle k has no wheel speed that could prove it."""
        if k == self._turn:
            self._began_us, self._turn = None, (k + 1) % self._axles

    def step(
        self, k: int, now_us: int, torque_N_m: float, demand_N_m: float, sliding: bool, slide_m_s2: float, limited: bool
    ) -> float:
        """The torque of axle k in this cycle, from what its law gives.

        demand_N_m: what the driver demands. limited: a limit below that is all that holds the torque; a wheel that
        carries what a limit leaves it has proved nothing: it may slide at that.
        """
        c = self._c
        if torque_N_m >= demand_N_m or (self._was_sliding[k] and not sliding):
            self._proved_us = now_us  # it carries all that is demanded, or has just come back from a slide
        self._was_sliding[k] = sliding
        if k != self._turn:
            return torque_N_m
        if self._began_us is None:
            if now_us - self._proved_us < c.after_s * 1e6:
                return torque_N_m
            self._began_us, self._torque_N_m = now_us, torque_N_m * (c.limited_share if limited else c.share)
            self.releases += 1
        lasts_s = (now_us - self._began_us) * 1e-6
        if lasts_s >= c.max_s or (lasts_s >= c.min_s and -slide_m_s2 < c.back_m_s2):
            self._began_us, self._proved_us = None, now_us
            self._turn = (k + 1) % self._axles
        return min(torque_N_m, self._torque_N_m)


STEADY_US = 300_000  # a wheel is looked at for so long
GAIN_M_S2 = 0.5  # a wheel that gains more has not arrived
NOISE_M_S = 0.05  # of the difference of two wheel speeds
TURNS_M_S = 1.0  # a slower wheel may be locked
FREE_SHARE = 0.03  # of the full brake: with less a wheel is free to roll
MAX_RELEASE_US = 8_000_000  # then the next axle's turn


class Proof:
    """Which axle is released until a wheel has proved the reference.

    proved: the reference may be trusted. losses: how often it was not any more. releases: of axles, so far.
    """

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self.proved = False
        self.losses = self.releases = 0
        self.freed: int | None = None  # place of the axle that is released
        self._began_us = 0
        self._left: list[int] = []  # places that had no turn yet
        self._seen: list[deque[tuple[int, float]]] = [deque() for _ in facts.axles]
        self._first_us: int | None = None

    def lose(self) -> None:
        """Trust the reference no more."""
        self.losses += self.proved
        self.proved, self.freed, self._first_us = False, None, None
        for seen in self._seen:
            seen.clear()

    def step(self, now_us: int, axles: Sequence[ControlledAxle], demand_N_m: float, braking: bool) -> int | None:
        """The place of the axle that has no torque in this cycle; None: every axle has what it has."""
        if self.proved:
            return None
        if not braking and demand_N_m > 0.0:
            self.proved, self.freed = True, None  # traction ended while no frame came: the wheels have come back
            return None
        for seen, a in zip(self._seen, axles, strict=True):
            if a.wheel_silent:
                seen.clear()
            else:
                seen.append((now_us, a.speed_m_s))
        if all(a.wheel_silent for a in axles):
            self._first_us, self.freed = None, None
            return None
        if any(self._is_proof(k, a, demand_N_m) for k, a in enumerate(axles)):
            self.proved, self.freed = True, None
            return None
        if demand_N_m <= 0.0:
            self._first_us, self.freed = None, None
            return None
        if self._first_us is None:
            self._first_us, self._left = now_us, list(range(len(axles)))
        if now_us - self._first_us <= STEADY_US:
            return None
        return self._turn(now_us, axles)

    def _turn(self, now_us: int, axles: Sequence[ControlledAxle]) -> int | None:
        k = self.freed
        if k is not None:
            if axles[k].blending.actual_N_m > FREE_SHARE * self._facts.full_brake_N_m:
                self._seen[k].clear()
            gain = self._gain_m_s(k)
            stays = gain is not None and gain <= self._most_gain_m_s
            if not stays and not axles[k].wheel_silent and now_us - self._began_us < MAX_RELEASE_US:
                return k
        if not self._left:
            self.proved, self.freed = True, None  # no wheel moves: the train stands
            return None
        self.freed, self._began_us = self._left.pop(0), now_us
        self.releases += not axles[self.freed].wheel_silent
        return self.freed

    def _is_proof(self, k: int, a: ControlledAxle, demand_N_m: float) -> bool:
        """Whether a wheel runs as the train can run."""
        if self._gain_m_s(k) is None:
            return False
        speeds = [speed for _, speed in self._seen[k]]
        if max(speeds) - speeds[0] > self._most_gain_m_s:
            return False
        if a.speed_m_s < TURNS_M_S:
            return demand_N_m <= 0.0 and a.blending.actual_N_m <= FREE_SHARE * self._facts.full_brake_N_m
        f = self._facts
        slows = (MARGIN * demand_N_m / f.wheelset.r_0 / f.wheelset.M_v + GRADIENT_M_S2) * STEADY_US * 1e-6
        return speeds[0] - min(speeds) <= slows + NOISE_M_S

    @property
    def _most_gain_m_s(self) -> float:
        return GAIN_M_S2 * STEADY_US * 1e-6 + NOISE_M_S

    def _gain_m_s(self, k: int) -> float | None:
        """What a wheel has gained in STEADY_US; None before it was looked at for so long."""
        seen = self._seen[k]
        while len(seen) > 1 and seen[1][0] <= seen[-1][0] - STEADY_US:
            seen.popleft()
        if not seen or seen[-1][0] - seen[0][0] < STEADY_US:
            return None
        return seen[-1][1] - seen[0][1]
