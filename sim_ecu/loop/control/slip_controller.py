"""One controller for every law: hears the bus, keeps the reference speed, applies limit and law, asks the actuators."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from sim_ecu.loop.control.blending import Blending
from sim_ecu.loop.control.controller import CYCLE_US
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.law import Law, Seen
from sim_ecu.loop.control.reference_speed import ReferenceSpeed
from sim_ecu.loop.messages import Heard, rig_message
from sim_ecu.play.encoder import Channel, Sent

PERIOD_S = CYCLE_US * 1e-6
COAST, TRACTION, BRAKE = range(3)
SLOPE_CYCLES = 3  # the wheel's acceleration is taken over so many cycles


class Limit(Protocol):
    """An upper bound of an axle's torque from what is known of the rail."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def limit(
        self, now_us: int, asked_N_m: float, given_N_m: float, creep: float, sliding: bool, braking: bool
    ) -> float | None:
        """Most |torque| to ask for; None: no limit."""


@dataclass(slots=True)
class Silence:
    """How often an input fell silent, and for how long in all."""

    times: int = 0
    silent_us: int = 0
    _was: bool = field(default=False, repr=False)

    def note(self, silent: bool) -> bool:
        """Count a cycle; returns what it was told."""
        self.times += silent and not self._was
        self.silent_us += CYCLE_US * silent
        self._was = silent
        return silent


class _Axle:
    """What the controller keeps of one axle."""

    def __init__(self, number: int, facts: Facts, law: Law, limit: Limit | None) -> None:
        self.wheel = Heard(rig_message(f"WheelSpeed_A{number}"))
        self.pressure = Heard(rig_message(f"BrakePressure_A{number}"))
        self.channel = Channel(rig_message(f"Demand_A{number}"))
        self.law, self.limit = law, limit
        self.blending = Blending(facts, PERIOD_S)
        self.given_N_m = 0.0
        self._speeds: deque[float] = deque(maxlen=SLOPE_CYCLES + 1)

    def observe(self, silent: bool) -> float:
        """The wheel's acceleration (m/s2) over the last cycles; 0 while it is not known."""
        if silent:
            self._speeds.clear()
            return 0.0
        self._speeds.append(self.speed_m_s)
        n = len(self._speeds) - 1
        return (self._speeds[-1] - self._speeds[0]) / (n * PERIOD_S) if n else 0.0

    @property
    def speed_m_s(self) -> float:
        return float(self.wheel.values["WheelSpeed"])


class SlipController:
    """Wheel-slide protection and traction control of a train.

    Input silent past its time-out: DriverDemand: traction ends, a brake that was asked stays asked and protected.
    WheelSpeed: the axle pulls no more, and brakes as the driver asks, without protection. Both are counted in
    `silences`, by message.
    """

    def __init__(self, facts: Facts, law: Callable[[], Law], limits: Mapping[int, Limit] | None = None) -> None:
        self.facts = facts
        limits = limits or {}
        self._axles = [_Axle(n, facts, law(), limits.get(n)) for n in facts.axles]
        self._driver = Heard(rig_message("DriverDemand"))
        self._heard = {
            h.message.frame_id: h for h in (self._driver, *(h for a in self._axles for h in (a.wheel, a.pressure)))
        }
        self._reference = ReferenceSpeed(facts)
        self.silences = {h.message.name: Silence() for h in self._heard.values()}
        self._braking = True

    @property
    def reference_m_s(self) -> float | None:
        """The ground speed that the controller goes by; None before a wheel was heard."""
        return self._reference.speed_m_s

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        heard = self._heard.get(can_id)
        if heard is not None:
            if heard.take(data, stamp_us):
                for a in self._axles:
                    if heard is a.pressure:
                        a.blending.hear(float(heard.values["Pressure"]))
            return
        for a in self._axles:
            if a.limit is not None:
                a.limit.hear(can_id, data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """The Demand frames of a cycle."""
        share, mode = self._asked(now_us)
        braking = mode == BRAKE if mode != COAST else self._braking
        if braking is not self._braking:
            for a in self._axles:
                a.law.reset()
        self._braking = braking
        slide = -1.0 if braking else 1.0  # a sliding wheel is slower than the train when braking
        silent = [self.silences[a.wheel.message.name].note(not a.wheel.fresh(now_us)) for a in self._axles]
        for a in self._axles:
            self.silences[a.pressure.message.name].note(not a.pressure.fresh(now_us))
        slopes = [slide * a.observe(s) for a, s in zip(self._axles, silent, strict=True)]
        forces = [self._force_N(a, slope) for a, slope in zip(self._axles, slopes, strict=True)]
        wheels = [a.speed_m_s for a, s in zip(self._axles, silent, strict=True) if not s]
        speed = self._reference.step(wheels, forces, braking, PERIOD_S)
        out = []
        for a, s, slope in zip(self._axles, silent, slopes, strict=True):
            asked = self.facts.asked_N_m(share, braking)
            if speed is None or s:
                torque = asked if braking else 0.0
            else:
                slip = slide * (a.speed_m_s - speed)
                torque = self._law(a, now_us, asked, speed, slip, slope)
            a.given_N_m = torque
            drive, valve = a.blending.step(torque, share, braking, speed or 0.0)
            out.append(a.channel.encode(now_us, {"Torque": drive, "Valve": valve}))
        return out

    def _asked(self, now_us: int) -> tuple[float, int]:
        """The driver's share and mode."""
        silent = self.silences[self._driver.message.name].note(not self._driver.fresh(now_us))
        share, mode = float(self._driver.values.get("Share", 0.0)), int(self._driver.values.get("Mode", COAST))
        if mode not in (TRACTION, BRAKE) or (silent and mode == TRACTION):
            return 0.0, COAST
        return share, mode

    def _force_N(self, a: _Axle, slide_m_s2: float) -> float:
        """Force at the rail: torque less what runs into the wheelset's own rotation."""
        f = self.facts
        return max(a.blending.actual_N_m - f.inertia_kg_m2 * slide_m_s2 / f.radius_m, 0.0) / f.radius_m

    def _law(self, a: _Axle, now_us: int, asked: float, speed: float, slip: float, slope: float) -> float:
        limit = None
        if a.limit is not None:
            creep = slip / max(speed, 1.0)
            limit = a.limit.limit(now_us, asked, a.given_N_m, creep, a.law.sliding, self._braking)
        most = asked if limit is None else min(asked, max(limit, 0.0))
        seen = Seen(now_us, PERIOD_S, self._braking, speed, slip, slope, most, a.blending.actual_N_m)
        return a.law.step(seen)
