"""Sanding policies, and the part of a controller that asks the sanders by one of them. No figure here is published but
where it says so: they are this project's choice.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sim_ecu.loop.control.adhesion_consumer import AdhesionReceiver, Facts, UsableAdhesion, usable_receiver
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.physics.sanding import AHEAD_M, MAX_DENSITY_G_M
from sim_ecu.play.encoder import Channel, Sent
from wrcd.core.configuration import Config
from wrcd.errors import InputError

HOLD_S = 2.0  # after what asks for sand: slides and low estimates come and go on one rail
# Sand insulates wheels from track circuits, and a train must not stand on it. Germany forbids short trains to sand
# below 25 km/h (7 m/s); ours is far above it.
MIN_SPEED_M_S = 15.0
SEEN_S = 0.3  # from a rail under the leading axle to its estimate: so far back a low one may have begun
PLACE_M = 1.0  # length of a place


@dataclass(frozen=True, slots=True)
class SandCycle:
    """What a controller knows in one cycle; tuples are by axle. Adhesion is a ratio.

    position_m: of the train, from any start. needed: adhesion that the brake demand takes of each axle, 0 while none is
    demanded. adhesion: None for an axle whose frame may not be used.
    """

    now_us: int
    speed_m_s: float
    position_m: float
    needed: float
    sliding: tuple[bool, ...]
    adhesion: tuple[UsableAdhesion | None, ...]

    def low(self, k: int) -> bool:
        """Whether the upper end of an axle's interval is below what the brake needs."""
        a = self.adhesion[k]
        return a is not None and a.half_width is not None and a.mu + a.half_width < self.needed


class Policy:
    """When each sander of a train lays sand.

    It lays its most, and no more than the 7.5 g/m of GM/RT2461 at low speed.
    """

    needs_adhesion = False

    def __init__(self, facts: Facts) -> None:
        assert facts.sanders is not None
        self._max_kg_min, self._delay_s = facts.sanders.each.max_kg_min, facts.sanders.each.delay_s
        at = dict(zip(facts.axles, facts.positions_m, strict=True))
        self._nozzles_m = [at[n] + AHEAD_M for n in facts.sanders.axles]
        self._axles_m = list(facts.positions_m)

    def step(self, seen: SandCycle) -> tuple[float, ...]:
        """Return kg/min on each rail, by sander."""
        rate = min(self._max_kg_min, MAX_DENSITY_G_M * max(seen.speed_m_s, 0.0) * 60.0 / 1e3)
        return tuple(rate * wanted for wanted in self.wanted(seen))

    def wanted(self, seen: SandCycle) -> Sequence[bool]:
        """Return whether each sander lays sand."""
        raise NotImplementedError


class AtSlide(Policy):
    """All sanders while any axle slides, and HOLD_S longer."""

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        self._until_us = -1

    def asks(self, seen: SandCycle) -> bool:
        """Return whether there is a reason to sand now."""
        return any(seen.sliding)

    def wanted(self, seen: SandCycle) -> Sequence[bool]:
        """All, or none."""
        if self.asks(seen):
            self._until_us = seen.now_us + round(HOLD_S * 1e6)
        return [seen.now_us <= self._until_us] * len(self._nozzles_m)


class BelowSpeed(AtSlide):
    """All sanders at a slide, but no sand below MIN_SPEED_M_S."""

    def wanted(self, seen: SandCycle) -> Sequence[bool]:
        """None at low speed."""
        wanted = super().wanted(seen)
        return wanted if seen.speed_m_s >= MIN_SPEED_M_S else [False] * len(wanted)


class WhenLow(AtSlide):
    """All sanders at a slide, and before any: where a usable estimate of any axle is below what the brake demand needs,
    interval and all. Under sand the estimate rises: then a slide asks again."""

    needs_adhesion = True

    def asks(self, seen: SandCycle) -> bool:
        """Return whether any axle slides, or its rail is too low."""
        return super().asks(seen) or any(seen.low(k) for k in range(len(seen.adhesion)))


class AtPlace(Policy):
    """Sand the places that the leading axle has found too low while braking, by its estimate or by a slide: a sander
    behind it begins so early that its sand falls on the first of them. One ahead of the leading axle never reaches any.
    """

    needs_adhesion = True

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        self._leading = self._axles_m.index(max(self._axles_m))
        self._low: set[int] = set()

    def wanted(self, seen: SandCycle) -> Sequence[bool]:
        """Those that come to a low place by the time that their sand falls."""
        if seen.low(self._leading) or (seen.sliding[self._leading] and seen.needed > 0.0):
            here = seen.position_m + self._axles_m[self._leading]
            self._low.update(range(int((here - SEEN_S * seen.speed_m_s) // PLACE_M), int(here // PLACE_M) + 1))
        falls = seen.position_m + self._delay_s * seen.speed_m_s
        return [int((falls + nozzle) // PLACE_M) in self._low for nozzle in self._nozzles_m]


POLICIES: Mapping[str, type[Policy]] = {
    "at-slide": AtSlide, "below-speed": BelowSpeed, "when-low": WhenLow, "at-place": AtPlace,
}  # fmt: skip


class SandControl:
    """Asks the sanders by a policy, every cycle of Sand_A*a*. It keeps the train's position by the reference speed."""

    def __init__(self, facts: Facts, policy: Policy, receivers: Mapping[int, AdhesionReceiver] | None = None) -> None:
        assert facts.sanders is not None
        self._policy, self._facts = policy, facts
        self._receivers = receivers or {}
        self._channels = [Channel(rig_message(f"Sand_A{n}")) for n in facts.sanders.axles]
        self._position_m = 0.0

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        for r in self._receivers.values():
            r.hear(can_id, data, stamp_us)

    def tick(
        self, now_us: int, period_s: float, speed_m_s: float | None, brake_N_m: float, sliding: Sequence[bool]
    ) -> list[Sent]:
        """Return the Sand frames of a cycle. brake_N_m: |torque| that the driver's brake demands of a wheelset."""
        speed = speed_m_s or 0.0
        self._position_m += speed * period_s
        receivers = [self._receivers.get(n) for n in self._facts.axles]
        rates = self._policy.step(
            SandCycle(
                now_us, speed, self._position_m, brake_N_m / self._facts.carried_N_m, tuple(sliding),
                tuple(None if r is None else r.adhesion(now_us) for r in receivers),
            )
        )  # fmt: skip
        return [
            c.encode(now_us, {"Rate": rate})
            for c, rate in zip(self._channels, rates, strict=True)
            if now_us % c.every_us == 0
        ]


def make_sanding(name: str, facts: Facts, config: Config | None = None) -> SandControl:
    """The sanding of a controller by its policy, one of POLICIES; config: the daemon's, for those that need adhesion.

    KeyError for another name. InputError for a train without sanders, a missing configuration, or one whose adhesion
    message lacks what a controller needs of it.
    """
    kind = POLICIES[name]
    if facts.sanders is None:
        raise InputError("the train has no sanders", hint="write [sanders] in its scenario")
    if not kind.needs_adhesion:
        return SandControl(facts, kind(facts))
    if config is None:
        raise InputError(f"{name} goes by what a daemon says of the adhesion: there is none")
    receivers = {a.number: usable_receiver(config, a) for a in config.axles if a.number in facts.axles}
    return SandControl(facts, kind(facts), receivers)
