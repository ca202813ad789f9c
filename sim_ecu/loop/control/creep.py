"""Slip control by creepage: a PI controller holds the creep at a set point, as far as the driver asks for so much."""

from dataclasses import dataclass

from sim_ecu.loop.control.law import Seen
from sim_ecu.loop.control.resync import Constants as Release

SLIDES = 2.0  # times the set point: the wheel is said to slide; until it is back at the set point


@dataclass(frozen=True, slots=True)
class Constants:
    """Found by `tune`; see docs/explanation/slip-control.md."""

    creep: float = 0.029  # set point
    min_slip_m_s: float = 0.233  # the set point at low speed
    kp_N_m: float = 560_000.0  # per unit of creep
    ki_N_m_s: float = 2_300_000.0
    kd_N_m_s2: float = 197.0  # per m/s2 of running away
    room_N_m: float = 3700.0  # anti-windup: the integral is at most this above what the actuators give


class CreepControl:
    """The law of one axle."""

    release: Release = Release(after_s=1.9, share=0.6)

    def __init__(self, constants: Constants | None = None) -> None:
        self._c = constants or Constants()
        self._integral_N_m: float | None = None
        self.sliding = False

    def reset(self) -> None:
        """Give what is asked again."""
        self._integral_N_m, self.sliding = None, False

    def step(self, seen: Seen) -> float:
        """One cycle on."""
        c = self._c
        target = max(c.creep, c.min_slip_m_s / max(seen.speed_m_s, 1.0))
        error = target - seen.creep
        if seen.creep > SLIDES * target:
            self.sliding = True
        elif seen.creep < target:
            self.sliding = False
        if self._integral_N_m is None:  # the driver has all that is asked, until the creep says otherwise
            if error > 0.0:
                return seen.asked_N_m
            self._integral_N_m = min(seen.actual_N_m, seen.asked_N_m)
        integral = self._integral_N_m + c.ki_N_m_s * error * seen.period_s
        self._integral_N_m = max(min(integral, seen.actual_N_m + c.room_N_m), 0.0)
        if self._integral_N_m >= seen.asked_N_m and error > 0.0:
            self._integral_N_m = None
            return seen.asked_N_m
        torque = self._integral_N_m + c.kp_N_m * min(error, 0.0) - c.kd_N_m_s2 * max(seen.slide_m_s2, 0.0)
        return min(max(torque, 0.0), seen.asked_N_m)
