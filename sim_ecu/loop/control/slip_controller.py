"""One controller for every law: keeps the reference speed, applies limit and law, commands the actuators."""

from collections.abc import Callable, Mapping

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, Facts, TrainController, Unprotected, usable_receiver
from sim_ecu.loop.control.adhesion_limit import AdhesionLimit, LimitConstants
from sim_ecu.loop.control.controlled_axle import AxleCycle, ControlledAxle, CreepControl, Law, Thresholds
from sim_ecu.loop.control.reference_speed import TURNS_M_S, Proof, ReferenceSpeed, Resync
from sim_ecu.loop.control.sanding_policies import SandControl
from sim_ecu.loop.control.shared_effort import carried_N_m, shared_effort
from sim_ecu.loop.rig_messages import BRAKE, COAST, TRACTION, driver_demand
from sim_ecu.play.encoder import Sent
from wrcd.core.configuration import AxleConfig, Config

MAX_PERIOD_US = 100_000  # a cycle that comes later than this counts for so much
LOST_US = 200_000  # a silence of all wheels, or of the controller itself, after which no wheel is believed unproved


class SlipController:
    """Wheel-slide protection and traction control of a train.

    Before the driver's first frame it sends nothing: without a Demand the rig brakes by itself. Inputs that are silent
    past their time-out: DriverDemand: traction ends; a brake that was demanded stays, protected. WheelSpeed: the axle
    pulls no more, and brakes as the driver demands, without protection. BrakePressure: the controller goes on with its
    own model of the cylinder. After its start, and after it has received no wheel while braking, a wheel has to prove
    the reference first: see `proof`. sanding: asks the train's sanders. shares_effort: a brake that one axle's
    adhesion does not carry is asked of the axles whose adhesion does.
    """

    def __init__(
        self,
        facts: Facts,
        law: Callable[[], Law],
        limits: Mapping[int, AdhesionLimit] | None = None,
        sanding: SandControl | None = None,
        shares_effort: bool = False,
    ) -> None:
        self.facts = facts
        limits = limits or {}
        self.axles = [ControlledAxle(n, facts, law(), limits.get(n)) for n in facts.axles]
        self._driver = driver_demand()
        inputs = [self._driver, *(h for a in self.axles for h in (a.wheel, a.pressure))]
        self._inputs = {h.message.frame_id: h for h in inputs}
        self._pressures = {a.pressure.message.frame_id: a for a in self.axles}
        self._sanding = sanding
        self._shares_effort = shares_effort
        self._reference = ReferenceSpeed(facts)
        self._resync = Resync(len(self.axles), self.axles[0].law.release)
        self.proof = Proof(facts)
        self._blind_us = 0
        self._braking = True
        self._now_us: int | None = None
        self._period_us = CYCLE_US

    @property
    def reference_m_s(self) -> float | None:
        """The ground speed that the controller goes by; None before the first wheel speed."""
        return self._reference.speed_m_s

    @property
    def releases(self) -> int:
        """How often an axle was released for the reference's sake."""
        return self._resync.releases

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        message = self._inputs.get(can_id)
        if message is None:
            for a in self.axles:
                if a.limit is not None:
                    a.limit.hear(can_id, data, stamp_us)
            if self._sanding is not None:
                self._sanding.hear(can_id, data, stamp_us)
        elif message.take(data, stamp_us) and can_id in self._pressures:
            self._pressures[can_id].blending.take(float(message.values["Pressure"]))

    def tick(self, now_us: int) -> list[Sent]:
        """The Demand and Sand frames of a cycle. Cycles may be left out; time does not run backwards."""
        since_us = now_us - (now_us - CYCLE_US if self._now_us is None else self._now_us)
        self._now_us, self._period_us = now_us, min(max(since_us, CYCLE_US), MAX_PERIOD_US)
        share = self._driver_share()
        for a in self.axles:
            a.observe(now_us, self._braking)
        wheels = [a.speed_m_s for a in self.axles if not a.wheel_silent]
        if since_us > LOST_US:
            self._reference.forget()
        speed = self._reference.step(wheels, [a.force_N() for a in self.axles], self._braking, self._period_us * 1e-6)
        demand_N_m = self.facts.demand_N_m(share, self._braking)
        self._blind_us = 0 if wheels else self._blind_us + self._period_us
        if self._blind_us > LOST_US or since_us > LOST_US:
            self.proof.lose()
        freed = self.proof.step(now_us, self.axles, demand_N_m, self._braking)
        asked_N_m = self._asked(now_us, share, demand_N_m, speed)
        out = []
        for k, a in enumerate(self.axles):
            if speed is None or a.wheel_silent:
                torque = demand_N_m if self._braking else 0.0
                self._resync.skip(k)
            else:
                torque = self._protected(k, a, now_us, demand_N_m, asked_N_m[k], speed, k == freed)
            a.given_N_m = torque
            drive, valve = a.blending.step(torque, share, self._braking, self._known(a, speed, torque, demand_N_m))
            if self._driver.stamp_us is not None:
                shared = self._braking and torque > demand_N_m
                out.append(a.channel.encode(now_us, {"Torque": drive, "Valve": valve, "Shared": shared}))
        if self._sanding is not None and self._driver.stamp_us is not None:
            brake_N_m = demand_N_m if self._braking else 0.0
            sliding = [a.law.sliding for a in self.axles]
            out += self._sanding.tick(now_us, self._period_us * 1e-6, speed, brake_N_m, sliding)
        return out

    def _asked(self, now_us: int, share: float, demand_N_m: float, speed_m_s: float | None) -> list[float]:
        """|torque| that is asked of each axle: the driver's demand, or what it has of that when effort is shared."""
        if not self._shares_effort or not self._braking or speed_m_s is None:
            return [demand_N_m] * len(self.axles)
        most_N_m = self.facts.actuators.most_brake_N_m(share, speed_m_s)
        carried = [self._carried(a, now_us) for a in self.axles]
        # one that slides takes no more
        most = [demand_N_m if a.law.sliding or a.guard.off else most_N_m for a in self.axles]
        return shared_effort(demand_N_m, carried, most)

    def _carried(self, a: ControlledAxle, now_us: int) -> float | None:
        """|torque| that an axle is trusted to carry; None: no frame of it says within what limits."""
        usable = None if a.limit is None or a.wheel_silent else a.limit.adhesion(now_us)
        if usable is None or usable.half_width is None:
            return None
        return carried_N_m(usable.mu, usable.half_width, self.facts.unit_adhesion_N_m)

    def _known(self, a: ControlledAxle, speed_m_s: float | None, torque_N_m: float, demand_N_m: float) -> float | None:
        """The speed that the drive's share may follow; None where a locked wheel could pass for a train that stands."""
        if speed_m_s is None or torque_N_m < demand_N_m:
            return speed_m_s
        return None if a.wheel_silent or a.guard.off or speed_m_s < TURNS_M_S else speed_m_s

    def _driver_share(self) -> float:
        """The driver's share, 0 ... 1. While coasting the direction of the last effort stays."""
        silent = not self._driver.fresh(self._now_us or 0)
        share, mode = float(self._driver.values.get("Share", 0.0)), int(self._driver.values.get("Mode", COAST))
        if mode not in (TRACTION, BRAKE) or (silent and mode == TRACTION):
            return 0.0
        if self._braking is not (mode == BRAKE):
            self._braking = mode == BRAKE
            for a in self.axles:
                a.law.reset()
                a.guard.reset()
        return share

    def _protected(
        self, k: int, a: ControlledAxle, now_us: int, demand_N_m: float, asked_N_m: float, speed_m_s: float, freed: bool
    ) -> float:
        """|torque| of an axle by limit, law, release and guard, of what is asked of it; demand_N_m: the driver's.

        freed: it has none, to prove the reference.
        """
        slip = a.speed_m_s - speed_m_s
        slip = -slip if self._braking else slip
        most: float | None = None
        if a.limit is not None:
            creep = slip / max(speed_m_s, 1.0)
            # what is found at the driver's demand stays known while less is asked
            wanted_N_m = max(asked_N_m, demand_N_m)
            most = a.limit.limit(now_us, wanted_N_m, a.blending.actual_N_m, creep, a.law.sliding, self._braking)
        most = asked_N_m if most is None else min(max(most, 0.0), asked_N_m)
        actual = a.blending.actual_N_m
        torque = a.law.step(AxleCycle(self._period_us * 1e-6, now_us, speed_m_s, slip, a.slide_m_s2, most, actual))
        limited = most <= torque < demand_N_m  # by the limit alone: the law leaves the wheel all that is demanded
        torque = self._resync.step(k, now_us, torque, demand_N_m, a.law.sliding, a.slide_m_s2, limited)
        if freed:
            a.law.reset()
            a.guard.begin(now_us)
            return 0.0
        if self._braking:
            least_N_m = min(asked_N_m, demand_N_m)
            torque = a.guard.step(now_us, a.speed_m_s, torque, least_N_m, self.facts.full_brake_N_m)
        return torque


LAWS: dict[str, Callable[[], Law]] = {"thresholds": Thresholds, "creep": CreepControl}
NAMES = ("none", *LAWS)
# Thresholds slide often: the estimate spares slides, and is followed up to the knee. Creep control wears more and stops
# as short as the rail allows: the estimate takes wear off, at some distance.
LIMITS = {
    "thresholds": LimitConstants(),
    "creep": LimitConstants(
        aim=0.955, half_widths=1.0, pull_aim=0.85, pull_rise_s=2.0, keep=(0.93, 0.985), take=(0.9, 0.97),
        hold_s=1.6, surprise=0.045, free_s=3.0,
    ),
}  # fmt: skip


def make_controller(
    name: str, facts: Facts, config: Config | None = None, sanding: SandControl | None = None,
    shares_effort: bool = False,
) -> TrainController:  # fmt: skip
    """A controller by its name, one of NAMES; with a daemon's configuration, one that uses its adhesion; with sanding,
    one that asks for sand. shares_effort: one that asks each axle for what its adhesion carries; without a
    configuration nothing is known of it, and nothing is shared.

    KeyError for another name; "none" has no use for any. InputError where the configuration's adhesion message lacks
    what a controller needs of it.
    """
    if name == "none":
        return Unprotected(facts.axles, facts.actuators)
    if config is None:
        return SlipController(facts, LAWS[name], sanding=sanding)
    limits = {a.number: _limit(name, facts, config, a) for a in config.axles if a.number in facts.axles}
    return SlipController(facts, LAWS[name], limits, sanding, shares_effort)


def _limit(name: str, facts: Facts, config: Config, axle: AxleConfig) -> AdhesionLimit:
    return AdhesionLimit(usable_receiver(config, axle), facts.carried_N_m, LIMITS[name])
