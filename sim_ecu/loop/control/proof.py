"""Proof of the reference speed: a controller that starts while braking must not take a locked wheel for standstill.

Nothing is known of the train's speed after a start, or after a silence in which the brakes acted unprotected. A wheel
that turns, and slows down no faster than the train can, proves it. When none does, axles are released in turn, wholly:
a wheel that slid rolls up. It has arrived when it gains no more speed. If no wheel moves, the train stands.
"""

from collections import deque
from collections.abc import Sequence

from sim_ecu.loop.control.axle import Axle
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.reference_speed import GRADIENT_M_S2, MARGIN

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

    def step(self, now_us: int, axles: Sequence[Axle], asked_N_m: float, braking: bool) -> int | None:
        """The place of the axle that has no torque in this cycle; None: every axle has what it has."""
        if self.proved:
            return None
        if not braking and asked_N_m > 0.0:
            self.proved, self.freed = True, None  # traction ended while nobody was heard: the wheels have come back
            return None
        for seen, a in zip(self._seen, axles, strict=True):
            if a.wheel_silent:
                seen.clear()
            else:
                seen.append((now_us, a.speed_m_s))
        if all(a.wheel_silent for a in axles):
            self._first_us, self.freed = None, None
            return None
        if any(self._is_proof(k, a, asked_N_m) for k, a in enumerate(axles)):
            self.proved, self.freed = True, None
            return None
        if asked_N_m <= 0.0:
            self._first_us, self.freed = None, None
            return None
        if self._first_us is None:
            self._first_us, self._left = now_us, list(range(len(axles)))
        if now_us - self._first_us <= STEADY_US:
            return None
        return self._turn(now_us, axles)

    def _turn(self, now_us: int, axles: Sequence[Axle]) -> int | None:
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

    def _is_proof(self, k: int, a: Axle, asked_N_m: float) -> bool:
        """Whether a wheel runs as the train can run."""
        if self._gain_m_s(k) is None:
            return False
        speeds = [speed for _, speed in self._seen[k]]
        if max(speeds) - speeds[0] > self._most_gain_m_s:
            return False
        if a.speed_m_s < TURNS_M_S:
            return asked_N_m <= 0.0 and a.blending.actual_N_m <= FREE_SHARE * self._facts.full_brake_N_m
        f = self._facts
        slows = (MARGIN * asked_N_m / f.radius_m / f.mass_kg + GRADIENT_M_S2) * STEADY_US * 1e-6
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
