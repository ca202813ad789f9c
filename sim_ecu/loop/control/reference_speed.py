"""The controller's ground speed: made from the wheels, for a controller has no other.

Braking, no wheel turns faster than the train runs: the fastest wheel is a lower bound. When all slide, the bound goes
on by the most that the train can slow down: by the force that the wheels can be passing on, which follows from torque
and wheel acceleration, and a margin for what a controller does not know. Traction is the mirror of it.
"""

from collections.abc import Sequence

from sim_ecu.loop.control.facts import Facts

# Our choice: load, wheel radius and pad friction are known to a tenth; a gradient of 1 % is not known at all.
MARGIN = 1.1
GRADIENT_M_S2 = 0.1


class ReferenceSpeed:
    """Ground speed (m/s) from wheel speeds, one step per cycle. speed_m_s is None before the first wheel was heard."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self.speed_m_s: float | None = None

    def step(
        self, wheels_m_s: Sequence[float], forces_N: Sequence[float], braking: bool, period_s: float
    ) -> float | None:
        """One cycle on.

        wheels_m_s: circumferential speeds that were heard (none: extrapolates). forces_N: of each axle, the force at
        the rail in the direction of the effort, at least 0.
        """
        sign = 1.0 if braking else -1.0
        seen = max((sign * w for w in wheels_m_s), default=None)
        if self.speed_m_s is None:
            self.speed_m_s = None if seen is None else sign * seen
            return self.speed_m_s
        mass_kg = self._facts.mass_kg * len(self._facts.axles)
        change = (MARGIN * sum(forces_N) / mass_kg + GRADIENT_M_S2) * period_s
        held = sign * self.speed_m_s - change
        self.speed_m_s = max(sign * (held if seen is None else max(held, seen)), 0.0)
        return self.speed_m_s
