"""What goes into the estimator and comes out: ticks, what a step brought, the estimate."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from wrcd.core.design import BoolArray, FloatArray, IntArray
from wrcd.core.terms import CHANNELS, MODELS


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


class StepResult:
    """What the newest tick brought; masks are (n,). Read it before the next one."""

    innovations: FloatArray  # (4, 2, n)
    whitened: FloatArray  # the same in units of their expected size
    accepted: BoolArray  # both measurements were used
    outliers: BoolArray  # a measurement was left out by the gate
    near_pulse: BoolArray  # at a pulse of the axle box, or just after it
    live: BoolArray  # the window was given the innovation of some ticks before, when no pulse could follow any more
    calm: BoolArray  # and that one is far from any pulse
    needs_reset: BoolArray  # outliers go on, or a filter is not finite
    notable: bool = False  # whether anything was left out, or needs a reset

    def __init__(self, memory: Any, axles: int) -> None:
        self._memory, self._n = memory, axles

    def __getattr__(self, name: str) -> Any:
        found = self._memory[name]
        if name in ("innovations", "whitened"):
            return found.reshape(MODELS, CHANNELS, -1)[..., : self._n].copy()
        return found[: self._n] > 0


class Outliers(NamedTuple):
    """What an axle is reset for: by how often its usual size each channel's innovation is off, of the model that it
    fits best, with the limits; and by how much the yaw rate differs from the newest that was used."""

    times_usual: list[float]
    limits: list[float]
    jump_rad_s: float


class HealthFigures(NamedTuple):
    """What leads beside a sound pair, with its probability, and what that was found by, for a person."""

    state: int
    probability: float
    sound: float
    low: float  # correlation below 1.5 Hz
    middle: float  # and in 3 to 10 Hz
    yaw_rms: float  # of each signal's alternating part, in units of the design's sensor noise
    lat_rms: float


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
