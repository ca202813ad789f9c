"""What goes into the estimator and comes out: ticks, the estimate."""

from collections.abc import Sequence
from dataclasses import dataclass

from wrcd.core.design import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class Ticks:
    """Columns of m consecutive ticks."""

    number: int  # of the first
    z: FloatArray  # (m, 2, n)
    present: BoolArray  # (m, 2, n)
    torque_ratio: FloatArray  # (m, n)
    speeds_m_s: Sequence[float]  # m

    def __len__(self) -> int:
        return len(self.speeds_m_s)

    def part(self, first: int, end: int) -> "Ticks":
        """Ticks first … end - 1 of them."""
        return Ticks(
            self.number + first, self.z[first:end], self.present[first:end], self.torque_ratio[first:end],
            self.speeds_m_s[first:end],
        )  # fmt: skip


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
    reaches_pct: FloatArray  # what the newest part says at the least: the interval reaches down to it
