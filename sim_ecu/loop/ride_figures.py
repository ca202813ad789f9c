"""What a ride came to: time and energy beyond the creep curve's peak, slides, wear, distance, honesty of the daemon."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.rig import Step
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import SAMPLE_US
from sim_ecu.score.score_play import MessageFrames, half_widths_pp

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

# A wheel slides beyond SLIDE_M_S or SLIDE_SHARE of the ground speed, whichever is less; it has recovered below OVER of
# that. Our choice. A slide that begins at less than MIN_SLIDE_SPEED_M_S is not counted: there the bound comes near the
# slip that a wheel-slide protection begins to act at (0.71 m/s here, 15 % of 4.7 m/s).
SLIDE_M_S, SLIDE_SHARE, OVER, MIN_SLIDE_SPEED_M_S = 1.5, 0.15, 0.5, 8.0
LOCKED_SHARE = 0.05  # of the ground speed: a wheel that turns slower is locked
MIN_JUDGED_M_S = 3.0  # no slip is judged at a slower ground speed
DEMAND_SHARE = 0.5  # of the run's largest effort: the demand comes when this is first demanded


@dataclass(frozen=True, slots=True)
class Figures:
    """From the demand on. Sums are over all axles, energy is the mean of a wheel.

    slides: those that begin above MIN_SLIDE_SPEED_M_S. beyond_s, beyond_kJ: seconds, and the part of the slip energy,
    at more creep than at the peak of the creep curve: there more slip carries less. A wheel that a controller holds at
    the peak is not beyond it, whatever its slip.
    utilisation: mean of adhesion used over available while the driver demands more than there is; NaN if never.
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
    demanded = np.abs(share) * full_N_m / (2 * wheelset.normal_N * wheelset.r_0)  # as adhesion
    short = judged[:, None] & (demanded[:, None] > available)
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
    """Return the first sample (of t) of the demand, not of the little before it; 0 if nothing is demanded."""
    demanded = np.abs(share)
    return int(np.argmax(demanded >= DEMAND_SHARE * demanded.max())) if demanded.max() > 0.0 else 0


def slides(slip_m_s: FloatArray, speed_m_s: FloatArray) -> int:
    """Return how many slides begin while the train is fast enough: amounts of slip (t, axles) at ground speeds (t,)."""
    if not len(slip_m_s):
        return 0
    bound = np.minimum(SLIDE_M_S, SLIDE_SHARE * speed_m_s)[:, None]
    state = np.where(slip_m_s > bound, 1, np.where(slip_m_s < OVER * bound, 0, -1))
    state = np.vstack((np.zeros_like(state[:1]), state))  # before, there is none
    at = np.where(state >= 0, np.arange(len(state))[:, None], 0)
    held = np.take_along_axis(state, np.maximum.accumulate(at, axis=0), axis=0)
    return int(np.sum((np.diff(held, axis=0) == 1) & (speed_m_s >= MIN_SLIDE_SPEED_M_S)[:, None]))


GAP_US = 60_000  # the frame's time-out: a longer silence ends a stretch


@dataclass(frozen=True, slots=True)
class AdhesionSeries:
    """The adhesion frames of one axle: (n,). half_width_pp is inf where no bound is claimed, NaN where not Valid."""

    stamps_us: NDArray[np.int64]
    mu_pct: FloatArray
    half_width_pp: FloatArray
    valid: BoolArray


@dataclass(frozen=True, slots=True)
class Honesty:
    """Of one axle while the train is fast enough to be judged.

    outside: share of the Valid frames with the truth outside the interval. outside_s, over_s: the longest stretch on
    end that it was so, and that the truth was below it.
    """

    axle: int
    valid: float
    outside: float
    outside_s: float
    over_s: float


def adhesion_series(frames: Mapping[int, MessageFrames]) -> dict[int, AdhesionSeries]:
    """Return what there was, by axle."""
    return {
        n: AdhesionSeries(
            np.array(h.stamps_us, np.int64), h.numbers("MuAvailable"), half_widths_pp(h), h.words("Validity") == "Valid"
        )
        for n, h in frames.items()
    }


def honesty(reported: Mapping[int, AdhesionSeries], steps: Sequence[Step]) -> list[Honesty]:
    """By axle. The truth of a frame is that of the newest step by then."""
    due_us = np.array([s.due_us for s in steps])
    speed = np.array([s.speed_m_s for s in steps])
    true_pct = 100 * np.array([s.mu_available for s in steps])
    out = []
    for place, (axle, t) in enumerate(reported.items()):
        at = np.searchsorted(due_us, t.stamps_us, side="right") - 1
        judged = (at >= 0) & (speed[np.maximum(at, 0)] >= MIN_JUDGED_M_S)
        at, stamps = at[judged], t.stamps_us[judged]
        over = t.mu_pct[judged] - true_pct[at, place]
        valid, half = t.valid[judged], t.half_width_pp[judged]
        with np.errstate(invalid="ignore"):
            outside, too_high = valid & ~(np.abs(over) <= half), valid & (over > half)
        share = float(np.mean(valid)) if len(valid) else 0.0
        wrong = float(np.sum(outside) / np.sum(valid)) if valid.any() else 0.0
        out.append(Honesty(axle, share, wrong, longest_s(outside, stamps), longest_s(too_high, stamps)))
    return out


def longest_s(hits: BoolArray, stamps_us: NDArray[np.int64]) -> float:
    """The longest stretch of consecutive frames, from its first stamp to its last, without a silence between."""
    longest = 0
    for hit, part in itertools.groupby(zip(hits.tolist(), stamps_us.tolist(), strict=True), lambda p: p[0]):
        if not hit:
            continue
        begin = end = None
        for _, stamp in part:
            if begin is None or end is None or stamp - end > GAP_US:
                begin = stamp
            end = stamp
            longest = max(longest, end - begin)
    return longest * 1e-6
