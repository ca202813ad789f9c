"""What a law of slip control sees of its axle in a cycle, and what it answers."""

from dataclasses import dataclass
from typing import Protocol

from sim_ecu.loop.control.resync import Constants as Release


@dataclass(frozen=True, slots=True)
class Seen:
    """One axle in one cycle. Torques are amounts; slip and acceleration count in the direction of the slide."""

    period_s: float
    now_us: int
    speed_m_s: float  # the reference speed
    slip_m_s: float  # against it: positive when the wheel slides
    slide_m_s2: float  # how fast the wheel runs away; negative: it comes back
    asked_N_m: float  # the most that the law may give: the driver's demand, or the adhesion's limit below it
    actual_N_m: float  # what the actuators are thought to give now

    @property
    def creep(self) -> float:
        """Slip over speed."""
        return self.slip_m_s / max(self.speed_m_s, 1.0)


class Law(Protocol):
    """Slip control of one axle. release: when an axle under this law is released for the reference's sake."""

    release: Release

    @property
    def sliding(self) -> bool:
        """Whether the law takes the wheel for sliding."""

    def step(self, seen: Seen) -> float:
        """|torque| (N m) for this cycle, 0 ... asked."""

    def reset(self) -> None:
        """Forget the effort that has ended: another one begins."""
