"""The reference controller: keeps the reference speed, applies limit and law, commands the actuators."""

from collections.abc import Mapping

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, Facts, TrainController, Unprotected, usable_receiver
from sim_ecu.loop.control.adhesion_limit import AdhesionLimit
from sim_ecu.loop.control.controlled_axle import AxleCycle, ControlledAxle
from sim_ecu.loop.control.reference_speed import TURNS_M_S, Proof, ReferenceSpeed, Resync
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
    the reference first: see `proof`. limits: of the axles that have one, by number.
    """

    def __init__(self, facts: Facts, limits: Mapping[int, AdhesionLimit] | None = None) -> None:
        self.facts = facts
        limits = limits or {}
        self.axles = [ControlledAxle(n, facts, limits.get(n)) for n in facts.axles]
        self._driver = driver_demand()
        inputs = [self._driver, *(h for a in self.axles for h in (a.wheel, a.pressure))]
        self._inputs = {h.message.frame_id: h for h in inputs}
        self._pressures = {a.pressure.message.frame_id: a for a in self.axles}
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
        elif message.take(data, stamp_us) and can_id in self._pressures:
            self._pressures[can_id].blending.take(float(message.values["Pressure"]))

    def tick(self, now_us: int) -> list[Sent]:
        """The Demand frames of a cycle. Cycles may be left out; time does not run backwards."""
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
        out = []
        for k, a in enumerate(self.axles):
            if speed is None or a.wheel_silent:
                torque = demand_N_m if self._braking else 0.0
                self._resync.skip(k)
            else:
                torque = self._protected(k, a, now_us, demand_N_m, speed, k == freed)
            a.given_N_m = torque
            drive, valve = a.blending.step(torque, share, self._braking, self._known(a, speed, torque, demand_N_m))
            if self._driver.stamp_us is not None:
                out.append(a.channel.encode(now_us, {"Torque": drive, "Valve": valve}))
        return out

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
        self, k: int, a: ControlledAxle, now_us: int, demand_N_m: float, speed_m_s: float, freed: bool
    ) -> float:
        """|torque| of an axle by limit, law, release and guard. freed: it has none, to prove the reference."""
        slip = a.speed_m_s - speed_m_s
        slip = -slip if self._braking else slip
        most: float | None = None
        if a.limit is not None:
            creep = slip / max(speed_m_s, 1.0)
            most = a.limit.limit(now_us, demand_N_m, a.blending.actual_N_m, creep, a.law.sliding, self._braking)
        most = demand_N_m if most is None else min(max(most, 0.0), demand_N_m)
        actual = a.blending.actual_N_m
        torque = a.law.step(AxleCycle(self._period_us * 1e-6, now_us, speed_m_s, slip, a.slide_m_s2, most, actual))
        limited = most <= torque < demand_N_m  # by the limit alone: the law leaves the wheel all that is demanded
        torque = self._resync.step(k, now_us, torque, demand_N_m, a.law.sliding, a.slide_m_s2, limited)
        if freed:
            a.law.reset()
            a.guard.begin(now_us)
            return 0.0
        if self._braking:
            torque = a.guard.step(now_us, a.speed_m_s, torque, demand_N_m, self.facts.full_brake_N_m)
        return torque


NAMES = ("none", "thresholds")


def make_controller(name: str, facts: Facts, config: Config | None = None) -> TrainController:
    """A controller by its name, one of NAMES; with a daemon's configuration, one that uses its adhesion.

    KeyError for another name; "none" has no use for any. InputError where the configuration's adhesion message lacks
    what a controller needs of it.
    """
    if name not in NAMES:
        raise KeyError(name)
    if name == "none":
        return Unprotected(facts.axles, facts.actuators)
    if config is None:
        return SlipController(facts)
    return SlipController(facts, {a.number: _limit(facts, config, a) for a in config.axles if a.number in facts.axles})


def _limit(facts: Facts, config: Config, axle: AxleConfig) -> AdhesionLimit:
    return AdhesionLimit(usable_receiver(config, axle), facts.carried_N_m)
