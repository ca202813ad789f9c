"""Slip control by thresholds: a slide is cut, held and re-applied (vent, hold, fill of a valve)."""

from dataclasses import dataclass
from enum import Enum

from sim_ecu.loop.control.law import Seen
from sim_ecu.loop.control.resync import Constants as Release


@dataclass(frozen=True, slots=True)
class Constants:
    """Found by `tune`; see docs/explanation/slip-control.md."""

    on_m_s: float = 0.71  # slip at which a slide begins: this, or the share of the speed where that is more
    on_share: float = 0.048
    on_m_s2: float = 9.2  # or at half the slip, when the wheel runs away faster than this
    off_share: float = 0.50  # of the slip at which it begins: below it, it is over
    back_m_s2: float = 3.0  # a wheel that comes back faster than this has not arrived
    hold_m_s2: float = 1.54  # a wheel that comes back faster than this needs no further cut
    reapply_share: float = 0.8  # of the torque at which the slide began: given back at once
    rise_N_m_s: float = 4800.0  # then it grows by this,
    growth_s: float = 0.10  # and the faster the longer no slide has come: e-fold in this time


class Phase(Enum):
    """What is done with the torque."""

    FOLLOW = 0
    CUT = 1
    HOLD = 2
    REAPPLY = 3


class Thresholds:
    """The law of one axle."""

    release: Release = Release(after_s=3.0, share=0.6)

    def __init__(self, constants: Constants | None = None) -> None:
        self._c = constants or Constants()
        self.phase = Phase.FOLLOW
        self._torque_N_m = 0.0
        self._began_N_m = 0.0
        self._rise_N_m_s = self._c.rise_N_m_s

    @property
    def sliding(self) -> bool:
        """Whether torque is cut or held."""
        return self.phase in (Phase.CUT, Phase.HOLD)

    def reset(self) -> None:
        """Give what is asked again."""
        self.phase = Phase.FOLLOW

    def step(self, seen: Seen) -> float:
        """One cycle on."""
        c = self._c
        on = max(c.on_m_s, c.on_share * seen.speed_m_s)
        over = seen.slip_m_s > on or (seen.slip_m_s > 0.5 * on and seen.slide_m_s2 > c.on_m_s2)
        if self.sliding:
            back = seen.slip_m_s < c.off_share * on and -seen.slide_m_s2 < c.back_m_s2
            if back:
                self.phase = Phase.REAPPLY
                self._torque_N_m = c.reapply_share * self._began_N_m
                self._rise_N_m_s = c.rise_N_m_s
            elif -seen.slide_m_s2 > c.hold_m_s2:
                if self.phase is Phase.CUT:
                    self._torque_N_m = seen.actual_N_m
                self.phase = Phase.HOLD
            else:
                self.phase, self._torque_N_m = Phase.CUT, 0.0
        elif over:
            self.phase = Phase.CUT
            self._began_N_m = min(seen.actual_N_m, seen.asked_N_m)
            self._torque_N_m = 0.0
        elif self.phase is Phase.REAPPLY:
            self._torque_N_m += self._rise_N_m_s * seen.period_s
            self._rise_N_m_s *= 1.0 + seen.period_s / c.growth_s
            if self._torque_N_m >= seen.asked_N_m:
                self.phase = Phase.FOLLOW
        if self.phase is Phase.FOLLOW:
            self._torque_N_m = seen.asked_N_m
        return min(self._torque_N_m, seen.asked_N_m)
