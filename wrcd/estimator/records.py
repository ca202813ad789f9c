"""The records that travel through the estimator: ticks, what a step brought, the estimate."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from wrcd.estimator.design import FloatArray, IntArray
from wrcd.estimator.paper.bank import BoolArray


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of n axles. What is not present, or unknown, is NaN or anything."""

    number: int
    z: FloatArray  # (2, n) yaw rate in rad/s, lateral acceleration in m/s2
    present: BoolArray  # (2, n)
    torque_ratio: FloatArray  # (n,) |torque| / (2 N r0)
    speed_m_s: float


@dataclass(frozen=True, slots=True)
class Ticks:
    """Columns of m ticks on end."""

    number: int  # of the first
    z: FloatArray  # (m, 2, n)
    present: BoolArray  # (m, 2, n)
    torque_ratio: FloatArray  # (m, n)
    speeds_m_s: Sequence[float]  # m

    def __len__(self) -> int:
        return len(self.speeds_m_s)

    def tick(self, k: int) -> Tick:
        """The k-th of them."""
        return Tick(self.number + k, self.z[k], self.present[k], self.torque_ratio[k], self.speeds_m_s[k])

    def part(self, first: int, end: int) -> "Ticks":
        """Ticks first … end - 1 of them."""
        return Ticks(
            self.number + first, self.z[first:end], self.present[first:end], self.torque_ratio[first:end],
            self.speeds_m_s[first:end],
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class StepResult:
    """What one tick brought; masks are (n,)."""

    innovations: FloatArray  # (4, 2, n)
    whitened: FloatArray  # the same in units of their expected size
    accepted: BoolArray  # both measurements were used
    outliers: BoolArray  # a measurement was left out by the gate
    near_pulse: BoolArray  # at a pulse of the axle box, or just after it
    live: BoolArray  # the window was given the innovation of HOLD_TICKS before
    calm: BoolArray  # and that one is far from any pulse
    needs_reset: BoolArray  # outliers go on, or a filter is not finite

    @property
    def notable(self) -> bool:
        """Whether anything was left out, or needs a reset."""
        return bool(self.outliers.any() or self.needs_reset.any())


class EstimateDoubt(IntEnum):
    """What of the estimate itself keeps it from being believed."""

    NONE = 0
    NO_RULE = 1  # too few rules fire
    BEYOND_TRAINING = 2  # residuals unlike any that the rules were made from
    HARSH = 3  # so many pulses that little of the window is left
    SHORT = 4  # of too little track to tell
    GAPS = 5  # so many lost measurements that little of the window is left


@dataclass(frozen=True, slots=True)
class Estimate:
    """Per axle (n,), NaN where unknown. Adhesion in percent, half_width in percentage points (90 % interval)."""

    residuals: FloatArray  # (n, 4)
    torque_ratio: FloatArray
    inputs: FloatArray  # (n, COLUMNS) what the rules were given
    fuzzy: FloatArray  # 0 … 100
    firing: FloatArray  # total weight of the rules; below 0.05 there is no answer
    rule: IntArray  # that weighs most, from 1; 0 none
    rule_share: FloatArray
    winner: IntArray  # model from 1 whose residual (as the rules see it) is lowest in its own range; 0 none
    mu_available_pct: FloatArray
    half_width_pp: FloatArray
    used_pct: FloatArray  # of the moment
    saturated: BoolArray
    contradicted: BoolArray  # more is in use than the rules, with their interval, say there is: one of them is wrong
    doubt: IntArray  # an EstimateDoubt: what speaks against the estimate itself
    window_s: FloatArray  # length of the window that the rules have judged
    mu_from_rules_pct: FloatArray  # the rules' word, fused with those before; without what is or was in use
    live_share: FloatArray  # of the window, with data far from pulses
    regime: IntArray  # a Regime: what the interval's width goes by
