"""A torque of one axle carried out by its actuators: the drive first, the cylinder what the drive does not take."""

from collections import deque

from sim_ecu.loop.control.facts import Facts
from sim_ecu.physics.actuators import Valve

BAND_BAR = 0.08  # half of what a cycle of filling or venting changes at medium pressure


class Blending:
    """Follows one axle's torque with drive and valve, and keeps a model of both: the drive's torque is not on the bus.

    The valve acts after a delay: it is set by the pressure that will be there by then.
    """

    def __init__(self, facts: Facts, period_s: float) -> None:
        self._facts, self._period_s = facts, period_s
        cycles = round(facts.actuators.pneumatics.valve_delay_s / period_s)
        self._coming = deque([Valve.FILL] * cycles, maxlen=max(cycles, 1))
        self._drive_N_m = 0.0
        self.pressure_bar = 0.0

    @property
    def actual_N_m(self) -> float:
        """What drive and cylinder are thought to give now, an amount."""
        return abs(self._drive_N_m) + self.pressure_bar * self._facts.actuators.pneumatics.torque_per_bar_N_m

    def hear(self, pressure_bar: float) -> None:
        """Take a measured pressure."""
        self.pressure_bar = pressure_bar

    def step(self, torque_N_m: float, share: float, braking: bool, speed_m_s: float | None) -> tuple[float, Valve]:
        """Drive torque (signed) and valve for a wanted amount of torque; share is the driver's.

        speed None: not known; the drive is asked for all, and what it is not allowed the actuators keep from it.
        """
        if not braking:
            most = self._facts.actuators.drive.traction_N_m(speed_m_s or 0.0, self._facts.radius_m)
            self._follow(min(torque_N_m, most))
            return torque_N_m, self._set(Valve.FILL, 0.0)
        facts, pneumatics = self._facts, self._facts.actuators.pneumatics
        if speed_m_s is None:
            electric, asked_bar = torque_N_m, facts.actuators.asked_bar(share, 0.0)
        else:
            electric, asked_bar = facts.electric_N_m(share, speed_m_s), facts.actuators.asked_bar(share, speed_m_s)
        target_bar = max(torque_N_m - electric, 0.0) / pneumatics.torque_per_bar_N_m
        coming_bar = self._coming_bar(asked_bar)
        if torque_N_m >= facts.asked_N_m(share, True):
            valve = Valve.FILL
        elif coming_bar > target_bar + BAND_BAR or (target_bar == 0.0 and coming_bar > 0.0):
            valve = Valve.VENT
        else:
            valve = Valve.FILL if coming_bar < target_bar - BAND_BAR else Valve.HOLD
        drive = -min(max(torque_N_m - self.pressure_bar * pneumatics.torque_per_bar_N_m, 0.0), electric)
        self._follow(drive)
        return drive, self._set(valve, asked_bar)

    def _coming_bar(self, asked_bar: float) -> float:
        pressure = self.pressure_bar
        for valve in self._coming:
            pressure = self._after(valve, pressure, asked_bar)
        return pressure

    def _after(self, valve: Valve, pressure_bar: float, asked_bar: float) -> float:
        """Pressure a cycle later."""
        if valve is Valve.HOLD:
            return pressure_bar
        pneumatics = self._facts.actuators.pneumatics
        target = asked_bar if valve is Valve.FILL else 0.0
        constant_s = pneumatics.vent_s if target < pressure_bar else pneumatics.fill_s
        return pressure_bar + (target - pressure_bar) * min(self._period_s / constant_s, 1.0)

    def _set(self, valve: Valve, asked_bar: float) -> Valve:
        acts = self._coming[0] if self._coming else valve
        self.pressure_bar = self._after(acts, self.pressure_bar, asked_bar)
        self._coming.append(valve)
        return valve

    def _follow(self, wanted_N_m: float) -> None:
        d = self._facts.actuators.drive
        change = (wanted_N_m - self._drive_N_m) / max(d.lag_s, self._period_s)
        rate = d.rise_N_m_s if self._drive_N_m * change >= 0.0 else d.fall_N_m_s
        self._drive_N_m += min(max(change, -rate), rate) * self._period_s
