"""What a controller keeps of one axle: what was heard, its law, its actuators."""

from collections import deque
from typing import Protocol

from sim_ecu.loop.control.blending import Blending
from sim_ecu.loop.control.controller import CYCLE_US
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.guard import Guard
from sim_ecu.loop.control.law import Law
from sim_ecu.loop.messages import Heard, rig_message
from sim_ecu.play.encoder import Channel

PERIOD_S = CYCLE_US * 1e-6
SLOPE_CYCLES = 3  # the wheel's acceleration is taken over so many: noise of 0.5 m/s2 with the rig's tachometer


class Limit(Protocol):
    """An upper bound of an axle's torque, from what is known of the rail."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def limit(
        self, now_us: int, asked_N_m: float, given_N_m: float, creep: float, sliding: bool, braking: bool
    ) -> float | None:
        """Most |torque| to ask for; None: no limit."""


class Axle:
    """One axle. heard: its input messages; given_N_m: |torque| asked of its actuators in the cycle before."""

    def __init__(self, number: int, facts: Facts, law: Law, limit: Limit | None) -> None:
        self.wheel = Heard(rig_message(f"WheelSpeed_A{number}"))
        self.pressure = Heard(rig_message(f"BrakePressure_A{number}"))
        self.channel = Channel(rig_message(f"Demand_A{number}"))
        self.law, self.limit = law, limit
        self.blending = Blending(facts, PERIOD_S)
        self.guard = Guard()
        self.given_N_m = 0.0
        self.wheel_silent = True
        self.slide_m_s2 = 0.0
        self._facts = facts
        self._speeds: deque[tuple[int, float]] = deque(maxlen=SLOPE_CYCLES + 1)

    @property
    def speed_m_s(self) -> float:
        """The wheel's circumferential speed as it was heard last."""
        return float(self.wheel.values["WheelSpeed"])

    def observe(self, now_us: int, braking: bool) -> None:
        """Take the wheel's state of a cycle: whether it is silent, and how fast it runs away (0 while not known)."""
        self.wheel_silent = not self.wheel.fresh(now_us)
        self.slide_m_s2 = 0.0
        if self.wheel_silent:
            self._speeds.clear()
            return
        self._speeds.append((now_us, self.speed_m_s))
        (before_us, before), (_, speed) = self._speeds[0], self._speeds[-1]
        if now_us > before_us:
            slope = (speed - before) / (now_us - before_us) * 1e6
            self.slide_m_s2 = -slope if braking else slope

    def force_N(self) -> float:
        """Force at the rail in the direction of the effort: torque less what turns the wheelset itself."""
        f = self._facts
        torque = self.blending.actual_N_m - f.inertia_kg_m2 * self.slide_m_s2 / f.radius_m
        return max(torque, 0.0) / f.radius_m
