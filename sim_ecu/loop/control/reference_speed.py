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
# After a change between traction and braking a wheel may still spin (slide) from before: it is not believed for so
# long, if it is so far from the reference. Our choice: wheels without torque come back within this.
SETTLE_S, SETTLED_M_S = 0.7, 0.2


class ReferenceSpeed:
    """Ground speed (m/s) from wheel speeds, one step per cycle. speed_m_s is None before the first wheel was heard."""

    def __init__(self, facts: Facts) -> None:
        self._facts = facts
        self.speed_m_s: float | None = None
        self._braking: bool | None = None
        self._settles_s = 0.0

    def forget(self) -> None:
        """Start anew: time has passed that nobody counted."""
        self.speed_m_s = None

    def step(
        self, wheels_m_s: Sequence[float], forces_N: Sequence[float], braking: bool, period_s: float
    ) -> float | None:
        """One cycle on.

        wheels_m_s: circumferential speeds that were heard (none: extrapolates). forces_N: of each axle, the force at
        the rail in the direction of the effort, at least 0.
        """
        sign = 1.0 if braking else -1.0
        seen = [sign * w for w in wheels_m_s]
        if self.speed_m_s is None:
            self.speed_m_s = sign * max(seen) if seen else None
            self._braking = braking
            return self.speed_m_s
        self._settles_s = SETTLE_S if braking is not self._braking else max(self._settles_s - period_s, 0.0)
        self._braking = braking
        mass_kg = self._facts.mass_kg * len(self._facts.axles)
        held = sign * self.speed_m_s - (MARGIN * sum(forces_N) / mass_kg + GRADIENT_M_S2) * period_s
        if self._settles_s > 0.0:
            seen = [w for w in seen if w < held + SETTLED_M_S]
        self.speed_m_s = max(sign * max([held, *seen]), 0.0)
        return self.speed_m_s
