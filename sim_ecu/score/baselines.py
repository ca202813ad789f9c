"""Other ways to the same figure, each given what wrcd has: the offsets taken off, the ticks as they came.

Not among them: interacting multiple models over the four filters. As the design tunes those, for telling residuals,
their likelihoods were worth a mean error of 4.6 points in the grid, and in Python they are too slow to be tuned for
their own sake.
"""

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from sim_ecu.design.features import estimator_alone
from sim_ecu.physics.compiled import compiled
from sim_ecu.score.ticks import BoolArray, FloatArray, Ticks, running_mean
from wrcd.errors import InputError
from wrcd.estimator.design import Design
from wrcd.estimator.estimator import OFFSET_WINDOWS
from wrcd.estimator.records import one_tick

ANSWER_EVERY_S = 0.02  # as the adhesion frames
PAPER = "the paper's own form"


class Baseline(Protocol):
    """Another way to the same figure, on the same ticks."""

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Available adhesion in percent, (ticks, n)."""
        ...


def without_offset(ticks: Ticks, window_ticks: int) -> Ticks:
    """The ticks with the sensors' offsets taken off as the train does it: what a filter alone would have to learn."""
    z = np.nan_to_num(ticks.z)
    _take_offset(z, ticks.present, float(OFFSET_WINDOWS * window_ticks))
    return replace(ticks, z=np.where(ticks.present, z, np.nan))


@compiled
def _take_offset(z: FloatArray, present: BoolArray, most: float) -> None:
    """`wrcd.estimator.offset` over all ticks of z (t, 2, n), in place: a test compares them."""
    for c in range(z.shape[1]):
        for i in range(z.shape[2]):
            mean, count = 0.0, 0.0
            for k in range(z.shape[0]):
                if present[k, c, i]:
                    count = min(count + 1.0, most)
                    mean += 1.0 / max(count, 1.0) * (z[k, c, i] - mean)
                z[k, c, i] -= mean


@dataclass(frozen=True, slots=True)
class Offsetless:
    """A baseline that is given measurements without their offsets."""

    baseline: Baseline
    window_ticks: int

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n)."""
        return self.baseline.mu_pct(without_offset(ticks, self.window_ticks))


@dataclass(frozen=True, slots=True)
class TorqueRatio:
    """What anyone can do without a filter: the adhesion in use is the least there can be."""

    window: int

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n)."""
        return 100.0 * running_mean(np.nan_to_num(ticks.torque_ratio), self.window)


@dataclass(frozen=True, slots=True)
class Beside:
    """The train's estimator with another design, on the same ticks."""

    design: Design
    every: int = field(init=False)  # ticks

    def __post_init__(self) -> None:
        object.__setattr__(self, "every", max(1, round(ANSWER_EVERY_S / self.design.tick_s)))

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Adhesion in percent (t, n); between two answers the last one stands."""
        t, n = ticks.torque_ratio.shape
        estimator = estimator_alone(self.design, n)
        out, newest = np.full((t, n), np.nan), np.full(n, np.nan)
        for k in range(t):
            result = estimator.step(
                one_tick(
                    int(ticks.number[k]), ticks.z[k], ticks.present[k], ticks.torque_ratio[k],
                    float(ticks.speed_m_s[k]),
                )
            )  # fmt: skip
            for axle in np.flatnonzero(result.needs_reset):
                estimator.reset(int(axle))
            if k % self.every == 0:
                newest = estimator.estimate().mu_available_pct
            out[k] = newest
        return out


def fitting(name: str, other: Design, design: Design) -> None:
    """Raises InputError where a design cannot run on the ticks that are made for another."""
    for key in ("tick_s", "normal_N", "r_0"):
        ours, theirs = getattr(design, key), getattr(other, key)
        if ours != theirs:
            raise InputError(
                f"has {key} = {theirs:g}, the design that is scored {ours:g}",
                key=f"--beside {name}",
                hint="only designs for the same wheelset and tick can be compared on the same frames",
            )
