"""What a run came to, from its steps: time and energy beyond the creep curve's peak, slides, wear, distance. Pure."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.rig import Step
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import SAMPLE_US

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# A wheel slides beyond SLIDE_M_S or SLIDE_SHARE of the ground speed, whichever is less; it has recovered below OVER of
# that. Our choice. A slide that begins at less than MIN_SLIDE_SPEED_M_S is not counted: there the bound comes near the
# slip that a wheel-slide protection begins to act at (0.71 m/s here, 15 % of 4.7 m/s).
SLIDE_M_S, SLIDE_SHARE, OVER, MIN_SLIDE_SPEED_M_S = 1.5, 0.15, 0.5, 8.0
LOCKED_SHARE = 0.05  # of the ground speed: a wheel that turns slower is locked
MIN_JUDGED_M_S = 3.0  # no slip is judged at a slower ground speed
DEMAND_SHARE = 0.5  # of the run's largest effort: the demand comes when this is first asked for


@dataclass(frozen=True, slots=True)
class Figures:
    """From the demand on. Sums are over all axles, energy is the mean of a wheel.

    slides: those that begin above MIN_SLIDE_SPEED_M_S. beyond_s, beyond_kJ: seconds, and the part of the slip energy,
    at more creep than at the peak of the creep curve: there more slip carries less. A wheel that a controller holds at
    the peak is not beyond it, whatever its slip.
    utilisation: mean of adhesion used over available while the driver asks for more than there is; NaN if never.
    impulse_kNs: of the forces in the demand's direction. stopped: the run ended because the train was slow enough;
    where it did not, stop_m is how far it came, and no stopping distance.
    """

    slides: int
    beyond_s: float
    locked_s: float
    max_slip_m_s: float
    slip_energy_kJ: float
    beyond_kJ: float
    utilisation: float
    impulse_kNs: float
    stop_m: float
    seconds: float
    stopped: bool


def judge(steps: Iterable[Step], scenario: DriveScenario | None = None) -> Figures:
    """The figures of a run's steps, one at least; without a scenario, of a train with the default actuators and
    wheelset."""
    every = list(steps)
    wheelset = scenario.train.wheelset if scenario is not None else Wheelset()
    actuators = scenario.actuators if scenario is not None else Actuators()
    share = np.array([s.share for s in every])
    first = demand_at(share)
    after = every[first:]
    share, speed = share[first:], np.array([s.speed_m_s for s in after])
    slip, at_peak, available, used, energy, wheel = (
        np.array([getattr(s, name) for s in after])
        for name in ("slip_m_s", "creep_at_peak", "mu_available", "mu_used", "slip_energy_J", "wheel_m_s")
    )
    sample_s = SAMPLE_US * 1e-6
    judged = speed >= MIN_JUDGED_M_S
    traction_N_m = [actuators.drive.traction_N_m(float(v), wheelset.r_0) for v in speed]
    full_N_m = np.where(share < 0.0, actuators.full_brake_N_m, traction_N_m)
    asked = np.abs(share) * full_N_m / (2 * wheelset.normal_N * wheelset.r_0)  # as adhesion
    short = judged[:, None] & (asked[:, None] > available)
    towards = np.sign(share)[:, None] * used
    beyond = judged[:, None] & (np.abs(slip) > at_peak * speed[:, None])
    wheels = 2 * slip.shape[1]
    began_m = every[first - 1].distance_m if first else 0.0
    return Figures(
        slides=slides(np.abs(slip[judged]), speed[judged]),
        beyond_s=float(np.sum(beyond)) * sample_s,
        locked_s=float(np.sum(np.abs(wheel[judged]) < LOCKED_SHARE * speed[judged][:, None])) * sample_s,
        max_slip_m_s=float(np.max(np.abs(slip[judged]), initial=0.0)),
        slip_energy_kJ=float(np.sum(energy[judged])) / wheels / 1e3,
        beyond_kJ=float(np.sum(energy[beyond])) / wheels / 1e3,
        utilisation=float(np.mean(np.maximum(towards[short], 0.0) / available[short])) if short.any() else float("nan"),
        impulse_kNs=float(np.sum(towards)) * 2 * wheelset.normal_N * sample_s / 1e3,
        stop_m=every[-1].distance_m - began_m,
        seconds=len(after) * sample_s,
        stopped=bool(speed[-1] < (scenario.stop_m_s if scenario is not None else MIN_JUDGED_M_S)),
    )


def demand_at(share: FloatArray) -> int:
    """The first sample (of t) that asks for the demand, and not for the little before it; 0 if nothing is asked."""
    asked = np.abs(share)
    return int(np.argmax(asked >= DEMAND_SHARE * asked.max())) if asked.max() > 0.0 else 0


def slides(slip_m_s: FloatArray, speed_m_s: FloatArray) -> int:
    """How many slides begin while the train is fast enough: amounts of slip (t, axles) at ground speeds (t,)."""
    if not len(slip_m_s):
        return 0
    bound = np.minimum(SLIDE_M_S, SLIDE_SHARE * speed_m_s)[:, None]
    state = np.where(slip_m_s > bound, 1, np.where(slip_m_s < OVER * bound, 0, -1))
    state = np.vstack((np.zeros_like(state[:1]), state))  # before, there is none
    at = np.where(state >= 0, np.arange(len(state))[:, None], 0)
    held = np.take_along_axis(state, np.maximum.accumulate(at, axis=0), axis=0)
    return int(np.sum((np.diff(held, axis=0) == 1) & (speed_m_s >= MIN_SLIDE_SPEED_M_S)[:, None]))
