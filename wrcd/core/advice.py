"""What deceleration the train can reach on the rail that it runs on: one advice of the train from its axles' estimates.

It is to choose when to begin braking. It promises nothing: the rail ahead may be another one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.codec import Value
from wrcd.bus.units import G
from wrcd.core.ahead import RailAhead
from wrcd.core.causes import Validity
from wrcd.core.configuration import AdviceConfig
from wrcd.core.messages import Report
from wrcd.core.vocabulary import CATEGORIES, DEGRADED, NOT_AVAILABLE, VALID
from wrcd.estimator.design import FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.records import Estimate

# Set by hand, on stops of training seeds: the advice changes slowly, over more track than one axle's window.
KEPT_US, KEPT_M = 2_000_000.0, 100.0  # how far back samples count
NEWEST_US = 1_000_000.0  # axles that were not Valid in this say nothing
# Torque tells more of the rail than coasting does. As soon as there are so many samples of the newest second with so
# much adhesion in use, only these count.
LOADED_PCT, LOADED_SAMPLES = 3.0, 3
MAX_GAP_US = 1_000_000.0  # between two slots: after a longer one the way between is not known
LEAST_SHARE = 0.5  # of what a drop ahead is said to have: no interval comes with it
M_S2 = 0.01 * G  # deceleration by 1 % of adhesion on all wheels


@dataclass(frozen=True, slots=True)
class Advice:
    """Of the whole train, in m/s²; None is not available."""

    validity: str
    deceleration_m_s2: float | None = None
    low_m_s2: float | None = None  # lower end of the 90 % interval
    distance_m: float | None = None
    category: str = "Unknown"
    age_ms: float | None = None
    ahead: str = "None"

    def values(self) -> dict[str, Value]:
        """By signal name of the DBC."""
        return {
            "Validity": self.validity,
            "Deceleration": self.deceleration_m_s2,
            "DecelerationLow": self.low_m_s2,
            "Distance": self.distance_m,
            "Category": self.category,
            "Age": self.age_ms,
            "Ahead": self.ahead,
        }


NO_ADVICE = Advice(NOT_AVAILABLE)


def category(low_m_s2: float, limits_m_s2: Sequence[float]) -> str:
    """Return the category of a deceleration; limits: from which the better ones hold, falling."""
    return CATEGORIES[sum(low_m_s2 < limit for limit in limits_m_s2)]


@dataclass(init=False, repr=False, eq=False)
class Adviser:
    """Keeps what the axles have found, and makes an advice of it, slot by slot. axles: how many there are."""

    # (samples, 5) when (µs), way (m), the axles' mean estimate and least lower end (both m/s²), adhesion in use (%);
    # newest last, empty are NaN
    _samples: FloatArray
    _valid_us: FloatArray  # (axles,) when each was Valid last
    _slot_us: float = math.nan  # of the newest slot
    _way_m: float = 0.0
    _speed_m_s: float = 0.0

    def __init__(self, axles: int, config: AdviceConfig) -> None:
        self._limits_m_s2, cycle_us = config.limits_m_s2, config.output.cycle_us
        self._max_gap_us = max(MAX_GAP_US, 2.0 * cycle_us)
        self._samples = np.full((math.ceil(KEPT_US / cycle_us) + 1, 5), np.nan)
        self._valid_us = np.full(axles, np.nan)

    @property
    def is_possible(self) -> bool:
        """Whether the samples are such as this class makes: a state from a file may hold others."""
        empty = np.isnan(self._samples).all(axis=1)
        at_us, way_m, middle, low, _ = self._samples[~empty].T
        return bool(
            np.isfinite(self._samples[~empty]).all()
            and (np.diff(empty.astype(np.int8)) <= 0).all()
            and (np.diff(at_us) > 0.0).all()
            and (np.diff(way_m) >= 0.0).all()
            and ((low >= 0.0) & (low <= middle)).all()
            and not np.isinf([*self._valid_us, self._slot_us]).any()
            and math.isfinite(self._way_m)
            and math.isfinite(self._speed_m_s)
        )

    def update(
        self,
        now_us: int,
        speed_m_s: float,
        below_min_speed: bool,
        reports: Sequence[Report],
        estimate: Estimate | None,
        rail_ahead: Sequence[RailAhead] | None,
    ) -> Advice:
        """Take a slot's reports; return the advice. speed: NaN where it is not known; rail_ahead: with fusion."""
        now = float(now_us)
        if below_min_speed or math.isnan(speed_m_s):
            self._forget()
            return NO_ADVICE
        self._move(now, abs(speed_m_s))
        middle, low, used = _decelerations(reports, estimate)
        valid = np.isfinite(middle)
        self._valid_us[valid] = now
        if valid.any():
            mean = middle[valid].mean()
            self._samples = np.roll(self._samples, -1, axis=0)
            self._samples[-1] = now, self._way_m, mean, min(low[valid].min(), mean), used[valid].mean()
        old = (now - self._samples[:, 0] > KEPT_US) | (self._way_m - self._samples[:, 1] > KEPT_M)
        self._samples[old] = np.nan
        kept = self._samples[np.isfinite(self._samples[:, 0])]
        few = 2 * np.count_nonzero(now - self._valid_us <= NEWEST_US) < len(reports)
        if few or not len(kept) or now - kept[-1, 0] > NEWEST_US:
            self._samples[:] = np.nan
            return NO_ADVICE
        return self._advice(now, kept, valid, rail_ahead or ())

    def _move(self, now: float, speed_m_s: float) -> None:
        """A slot later. Where time went back or stood, or the way is not known, nothing that was kept holds."""
        elapsed_us = now - self._slot_us
        if 0.0 < elapsed_us <= self._max_gap_us:
            self._way_m += 1e-6 * elapsed_us * 0.5 * (self._speed_m_s + speed_m_s)
        else:
            self._forget()
        self._slot_us, self._speed_m_s = now, speed_m_s

    def _forget(self) -> None:
        self._samples[:] = np.nan
        self._valid_us[:] = np.nan
        self._slot_us = math.nan
        self._way_m = 0.0

    def _advice(self, now: float, kept: FloatArray, valid: BoolArray, rail_ahead: Sequence[RailAhead]) -> Advice:
        middle, low = self._found(now, kept)
        evidence = {r.evidence for r in rail_ahead}
        if less := [r.mu_pct for r in rail_ahead if r.evidence == "Confirmed" and r.mu_pct is not None]:
            middle, low = min(middle, min(less) * M_S2), min(low, LEAST_SHARE * min(less) * M_S2)
        return Advice(
            validity=VALID if valid.all() else DEGRADED,
            deceleration_m_s2=middle,
            low_m_s2=low,
            distance_m=float(kept[-1, 1] - kept[0, 1]),
            category=category(low, self._limits_m_s2),
            age_ms=1e-3 * (now - float(kept[-1, 0])),
            ahead=next((word for word in ("Confirmed", "Suspected") if word in evidence), "None"),
        )

    def _found(self, now: float, kept: FloatArray) -> tuple[float, float]:
        """The rule: the medians of estimate and lower end (m/s²) of the samples that count. At least one of those that
        are kept is of the newest second."""
        at_us, _, middles, lows, used = kept.T
        loaded = (now - at_us <= NEWEST_US) & (used >= LOADED_PCT)
        counts = loaded if np.count_nonzero(loaded) >= LOADED_SAMPLES else np.full(len(kept), True)
        return float(np.median(middles[counts])), float(np.median(lows[counts]))


def _decelerations(reports: Sequence[Report], estimate: Estimate | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of each axle (n,), NaN where it is not Valid: its estimate and the lower end of its interval (m/s²), and the
    adhesion in use (%). What is in use while the wheel adheres is there at least."""
    valid = np.array([r.validity is Validity.VALID and r.mu_available_pct is not None for r in reports])
    if estimate is None or not valid.any():
        nothing = np.full(len(reports), np.nan)
        return nothing, nothing, nothing
    mu = np.where(valid, estimate.mu_available_pct, np.nan)
    used = np.array([r.mu_used_pct or 0.0 for r in reports])
    adheres = np.array([r.contact_state == "Adhering" for r in reports])
    low = np.fmax(mu - estimate.half_width_pp, np.where(adheres, np.fmin(used, mu), 0.0))
    return M_S2 * mu, M_S2 * np.where(valid, low, np.nan), used
