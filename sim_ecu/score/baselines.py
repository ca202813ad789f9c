"""Other ways to the same figure, on the same ticks as wrcd: the torque ratio, and other designs."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.features import estimator_alone
from wrcd.core.design import Design
from wrcd.core.records import Ticks
from wrcd.errors import InputError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class GivenTicks:
    """t ticks of n axles of one run, which share the speed. z and torque_ratio are NaN where unknown.

    z and present (t, 2, n): yaw rate (rad/s), lateral acceleration (m/s2), and whether the tick brought them.
    torque_ratio (t, n): |torque| / (2 N r_0).
    """

    z: FloatArray
    present: BoolArray
    torque_ratio: FloatArray
    speed_m_s: FloatArray  # (t,)
    tick_s: float
    number: NDArray[np.int64]  # (t,) of each tick on the bus; they are in order, and some may be missing


def running_mean(values: FloatArray, window: int) -> FloatArray:
    """Means (t, …) over the newest `window` ticks, or as many as there are yet."""
    total = np.cumsum(np.concatenate((np.zeros_like(values[:1]), values)), axis=0)
    newest = np.arange(1, len(total))
    oldest = np.maximum(newest - window, 0)
    count = (newest - oldest).reshape(-1, *[1] * (values.ndim - 1))
    mean: FloatArray = (total[newest] - total[oldest]) / count
    return mean


ANSWER_EVERY_S = 0.02  # as the adhesion frames
PAPER = "the paper's own form"


class Baseline(Protocol):
    """Another way to the same figure, on the same ticks."""

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Available adhesion in percent, (ticks, n)."""
        ...


@dataclass(frozen=True, slots=True)
class TorqueRatio:
    """What anyone can do without a filter: the adhesion in use is the least there can be."""

    window: int

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Adhesion in percent (t, n)."""
        return 100.0 * running_mean(np.nan_to_num(ticks.torque_ratio), self.window)


@dataclass(frozen=True, slots=True)
class Beside:
    """The train's estimator with another design, on the same ticks."""

    design: Design

    def mu_pct(self, ticks: GivenTicks) -> FloatArray:
        """Adhesion in percent (t, n); between two answers the last one stands."""
        t, n = ticks.torque_ratio.shape
        every = max(1, round(ANSWER_EVERY_S / self.design.tick_s))
        estimator = estimator_alone(self.design, n)
        out, first = np.empty((t, n)), 0
        gaps = np.flatnonzero(np.diff(ticks.number) != 1).tolist()  # the ticks before them are stops, too
        for stop in sorted({*range(0, t, every), *gaps, t - 1}):
            at, speeds_m_s = slice(first, stop + 1), ticks.speed_m_s[first : stop + 1].tolist()
            given = ticks.z[at], ticks.present[at], ticks.torque_ratio[at], speeds_m_s
            estimator.run(Ticks(int(ticks.number[first]), *given), 0, len(speeds_m_s), resets=True)
            if stop % every == 0:
                out[stop : stop + every] = estimator.estimate().mu_available_pct
            first = stop + 1
        return out


ALIKE = 0.02  # by how much load and radius may differ: a calibration finds them within that


def fitting(name: str, other: Design, design: Design) -> None:
    """Raises InputError where a design cannot run on the ticks that are made for another."""
    for key in ("tick_s", "normal_N", "r_0"):
        ours, theirs = getattr(design, key), getattr(other, key)
        if not math.isclose(ours, theirs, rel_tol=0.0 if key == "tick_s" else ALIKE):
            raise InputError(
                f"has {key} = {theirs:g}, the design that is scored {ours:g}",
                key=f"--beside {name}",
                hint="only designs for the same wheelset and tick can be compared on the same frames",
            )
