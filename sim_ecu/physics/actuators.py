"""What turns demands into torque at the wheelset: the drive (traction and electric brake) and the pneumatic brake.

Constants are this project's own choice where no source is given; they are of the size of a multiple unit's.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

EMPTY_BAR = 1e-6


class Valve(IntEnum):
    """What the anti-slide valve of a brake cylinder does."""

    FILL = 0  # the cylinder goes to the pressure that the brake control demands
    HOLD = 1
    VENT = 2


@dataclass(frozen=True, slots=True)
class Drive:
    """Traction motor and electric brake of a wheelset, torques at the wheelset."""

    max_traction_N_m: float = 25_000.0
    max_brake_N_m: float = 25_000.0  # of the electric brake; 0: there is none
    lag_s: float = 0.05
    rise_N_m_s: float = 60_000.0  # of the torque's amount
    fall_N_m_s: float = 180_000.0
    fades_m_s: float = 3.0  # the electric brake is whole above this speed, and ends at half of it
    max_power_kW: float = 1_800.0  # of traction, at the wheel; the electric brake has none but its torque
    cut_out_m_s: float = 70.0  # wheel speed above which there is no traction

    def traction_N_m(self, wheel_m_s: float, radius_m: float) -> float:
        """The most that it may pull with, at a wheel's circumferential speed."""
        if wheel_m_s > self.cut_out_m_s:
            return 0.0
        if wheel_m_s * self.max_traction_N_m <= 1e3 * self.max_power_kW * radius_m:
            return self.max_traction_N_m
        return 1e3 * self.max_power_kW * radius_m / wheel_m_s


@dataclass(frozen=True, slots=True)
class Pneumatics:
    """Brake cylinder, its valve and its blocks or pads, of a wheelset."""

    torque_per_bar_N_m: float = 6_000.0  # friction torque at the wheelset
    max_bar: float = 5.0
    valve_delay_s: float = 0.03
    fill_s: float = 0.25  # time constants of the cylinder's pressure
    vent_s: float = 0.15


@dataclass(frozen=True, slots=True)
class Actuators:
    """The actuators of every wheelset of a train, and what full service braking demands of each."""

    drive: Drive = field(default_factory=Drive)
    pneumatics: Pneumatics = field(default_factory=Pneumatics)
    full_brake_N_m: float = 22_000.0

    def electric_N_m(self, brake_share: float, speed_m_s: float) -> float:
        """Return what the brake control demands of the electric brake for a share (0 … 1) of the full service brake."""
        whole = min(brake_share * self.full_brake_N_m, self.drive.max_brake_N_m)
        if speed_m_s >= self.drive.fades_m_s:
            return whole
        return whole * max(2.0 * speed_m_s / self.drive.fades_m_s - 1.0, 0.0)

    def demand_bar(self, brake_share: float, speed_m_s: float, electric: bool = True) -> float:
        """Return the pressure for what the electric brake is not to give; electric False: for all."""
        rest = brake_share * self.full_brake_N_m - (self.electric_N_m(brake_share, speed_m_s) if electric else 0.0)
        return min(rest / self.pneumatics.torque_per_bar_N_m, self.pneumatics.max_bar)


class AxleActuators:
    """The state of one wheelset's actuators, in steps of any length: lags are solved exactly, demands held within."""

    def __init__(self, actuators: Actuators, step_s: float) -> None:
        d, p = actuators.drive, actuators.pneumatics
        self._max_traction_N_m = d.max_traction_N_m
        self._rise, self._fall = d.rise_N_m_s * step_s, d.fall_N_m_s * step_s
        self._lag, self._fill, self._vent = (_share(step_s, constant) for constant in (d.lag_s, p.fill_s, p.vent_s))
        self._per_bar_N_m = p.torque_per_bar_N_m
        self.drive_N_m = 0.0
        self.pressure_bar = 0.0
        self._valves = deque([Valve.FILL] * round(p.valve_delay_s / step_s))

    def step(
        self, torque_N_m: float, valve: Valve, demand_bar: float, electric_N_m: float, traction_N_m: float = math.inf
    ) -> float:
        """One step on. torque_N_m: demand to the drive; electric_N_m, traction_N_m: the most that it may brake or pull.

        Returns the torque at a wheelset that turns forward, braking negative: drive_N_m, less what the cylinder presses
        for.
        """
        wanted = min(max(torque_N_m, -electric_N_m), self._max_traction_N_m, traction_N_m)
        self.drive_N_m = self._limited(self.drive_N_m + (wanted - self.drive_N_m) * self._lag)
        self._valves.append(valve)
        acts = self._valves.popleft()
        if acts is not Valve.HOLD:
            target = demand_bar if acts is Valve.FILL else 0.0
            share = self._vent if target < self.pressure_bar else self._fill
            self.pressure_bar += (target - self.pressure_bar) * share
            if self.pressure_bar < EMPTY_BAR:
                self.pressure_bar = 0.0
        return self.drive_N_m - self.friction_N_m

    @property
    def friction_N_m(self) -> float:
        """The torque that the brake can hold with the cylinder's pressure."""
        return self.pressure_bar * self._per_bar_N_m

    def _limited(self, next_N_m: float) -> float:
        """The drive's next torque, its amount growing and falling no faster than it may; through zero it does both."""
        now = self.drive_N_m
        if now < 0.0:
            return -_limit(-now, -next_N_m, self._rise, self._fall)
        return _limit(now, next_N_m, self._rise, self._fall)


def _limit(now: float, following: float, rise: float, fall: float) -> float:
    """The same for a torque that is not negative."""
    if following >= now:
        return min(following, now + rise)
    if following >= 0.0 or now >= fall:
        return max(following, now - fall)
    return max(following, -rise * (1.0 - now / fall))  # what is left of the step after zero


def _share(step_s: float, constant_s: float) -> float:
    """Share of its way that a lag of first order goes in a step."""
    return 1.0 if constant_s <= 0.0 else -math.expm1(-step_s / constant_s)
