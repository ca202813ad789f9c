"""What the same actuators reach when somebody knows the rail. No controller can be built so.

It is no bound in the strict sense: it never uses a wheel that slips beyond the peak, and lets a patch end before it
asks for more.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from sim_ecu.loop.rig import Rig, Step
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.physics.actuators import Valve
from sim_ecu.physics.contact import peak
from sim_ecu.physics.rail import rail_at

HELD = 0.98  # of the lowest peak under the wheel and as far ahead as the actuators need to follow
# How far: of an electric drive, and where the friction brake takes part.
AHEAD_S, AHEAD_OF_FRICTION_S = (0.1, 0.2), (0.15, 0.3, 0.45)
CUT = 0.5  # of the torque in use, beyond the peak's creep, until the wheel is back below it
PAST_PEAK = 1.5  # of the peak's creep
BAND_BAR = 0.05  # about the wanted pressure: held


class Ideal:
    """Sees the truth and the rail ahead, and asks each axle for HELD of what it will carry."""

    def __init__(self, scenario: DriveScenario) -> None:
        train = scenario.train
        self._scenario, self._contact = scenario, train.wheelset.contact
        w = train.wheelset
        # the wheelset's own rotation takes torque beside what the rail carries
        self._unit_N_m = 2 * w.normal_N * w.r_0 * (1.0 + (w.I_R + w.I_L) / (w.r_0**2 * w.M_v))
        self._radius_m = w.r_0
        a = scenario.actuators
        friction = float(scenario.driver.at(np.array([np.inf]))[0]) < 0.0 and a.full_brake_N_m > a.drive.max_brake_N_m
        self._ahead_s = AHEAD_OF_FRICTION_S if friction else AHEAD_S
        self._past = [False] * len(train.axles)

    def demands(self, step: Step | None) -> Sequence[tuple[float, Valve]]:
        """Torque and valve of every axle, from the newest step."""
        if step is None:
            return [(0.0, Valve.FILL)] * len(self._past)
        a = self._scenario.actuators
        full_N_m = a.full_brake_N_m if step.share < 0.0 else a.drive.traction_N_m(step.speed_m_s, self._radius_m)
        out = []
        for k in range(len(self._past)):
            most = min(abs(step.share) * full_N_m, self._carried(k, step))
            if step.share >= 0.0:
                out.append((most, Valve.VENT if step.pressure_bar[k] > 0.0 else Valve.FILL))
            else:
                out.append(self._brakes(k, step, most))
        return out

    def _carried(self, k: int, step: Step) -> float:
        """Torque that the axle may have."""
        axle, speed = self._scenario.train.axles[k], max(step.speed_m_s, 1.0)
        at = step.distance_m + axle.position_m
        creep, here = peak(speed, self._contact, *rail_at(axle.rail, at)[:5])
        ahead = [peak(speed, self._contact, *rail_at(axle.rail, at + speed * t)[:5])[1] for t in self._ahead_s]
        # what is under the wheel may be better than the rail was: those before have cleaned it
        better = float(step.mu_available[k]) / here
        slip = abs(float(step.slip_m_s[k])) / speed
        self._past[k] = slip > (1.0 if self._past[k] else PAST_PEAK) * creep
        if self._past[k]:
            return CUT * abs(float(step.mu_used[k])) * self._unit_N_m
        return HELD * better * min(here, *ahead) * self._unit_N_m

    def _brakes(self, k: int, step: Step, most_N_m: float) -> tuple[float, Valve]:
        """Friction brake to what the electric one leaves; the electric one to what the friction brake leaves."""
        a = self._scenario.actuators
        electric = a.electric_N_m(-step.share, step.speed_m_s)
        wanted = max(most_N_m - electric, 0.0) / a.pneumatics.torque_per_bar_N_m
        bar = float(step.pressure_bar[k])
        lead = a.pneumatics.valve_delay_s
        rate = (a.asked_bar(-step.share, step.speed_m_s) - bar) / a.pneumatics.fill_s
        if bar + max(rate, 0.0) * lead < wanted - BAND_BAR:
            valve = Valve.FILL
        elif bar * (1.0 - lead / a.pneumatics.vent_s) > wanted + BAND_BAR:
            valve = Valve.VENT
        else:
            valve = Valve.HOLD
        friction = bar * a.pneumatics.torque_per_bar_N_m
        return -float(np.clip(most_N_m - friction, 0.0, electric)), valve


def ride_ideal(scenario: DriveScenario) -> Iterator[Step]:
    """The steps of a run whose demands come from the ideal; nothing is on the bus."""
    rig, ideal = Rig(scenario, []), Ideal(scenario)
    end_us = round(scenario.train.duration_s * 1e6)
    step: Step | None = None
    while rig.time_us < end_us:
        for axle, (torque, valve) in zip(scenario.axles, ideal.demands(step), strict=True):
            rig.demand(axle, torque, valve)
        step = rig.step()
        yield step
        if step.speed_m_s < scenario.stop_m_s:
            return
