"""What frames have said of one wheelset."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Validity
from wrcd.core.configuration import AxleConfig
from wrcd.core.messages import NAMES
from wrcd.core.vocabulary import CONFIDENCES, MESSAGES, Words
from wrcd.estimator.design import MODELS
from wrcd.tools.monitor.spells import Spells
from wrcd.tools.monitor.table import Table
from wrcd.tools.said import UNKNOWN, Values
from wrcd.tools.story.records import Adhesion, Detail, Health, Truth

INPUTS = tuple(NAMES.values())
_HALF_WIDTHS = {name: width for width, name in CONFIDENCES if math.isfinite(width)}
TRUTH_CYCLE_US = 20_000


def words(message: str, signal: str) -> tuple[str, ...]:
    """Of a signal of ours."""
    found = MESSAGES[message][signal]
    assert isinstance(found, Words)
    return found.words


# by place in the words; the last place is UNKNOWN's
_WIDTH = np.array(
    [*(_HALF_WIDTHS.get(w, math.nan) for w in words("adhesion", "Confidence")), math.nan], dtype=np.float32
)
VALIDITIES = words("adhesion", "Validity")
NOT_AVAILABLE = VALIDITIES.index("NotAvailable")
_F, _P = (np.float32, 0), (np.int8, 0)


class AxleModel:
    """Its columns, at most hold_us of them, and its spells."""

    def __init__(self, config: AxleConfig, hold_us: int) -> None:
        self.number = config.number
        self.cycle_us = config.adhesion.cycle_us
        self.has_detail, self.has_health = config.detail is not None, config.inputs is not None
        self._adhesion = Table(
            {
                "time_us": (np.int64, 0), "validity": _P, "available_pct": _F, "used_pct": _F, "low_pct": _F,
                "high_pct": _F, "confidence": _P, "contact": _P, "surface": _P, "age_ms": _F,
            },
            _rows(hold_us, self.cycle_us),
        )  # fmt: skip
        self._detail = Table(
            {
                "time_us": (np.int64, 0), "residual_db": (np.float32, MODELS), "winner": _P, "rule": (np.int16, 0),
                "cause": _P, "stale": (np.bool_, len(INPUTS)),
            },
            _rows(hold_us, config.detail.cycle_us if config.detail else 0),
        )  # fmt: skip
        self._health = Table(
            {
                "time_us": (np.int64, 0), "reach": (np.uint8, len(INPUTS)), "refused": (np.int8, len(INPUTS)),
                "plausibility": _P, "outlier": (np.bool_, 0), "unchanged": (np.bool_, 0),
            },
            _rows(hold_us, config.inputs.cycle_us if config.inputs else 0),
        )  # fmt: skip
        self._truth = Table(
            {"time_us": (np.int64, 0), "available_pct": _F, "used_pct": _F}, _rows(hold_us, TRUTH_CYCLE_US)
        )
        self.spells = Spells(self.number, self.cycle_us)
        self.has_come = False  # an input of its own, or an Adhesion frame that is not NotAvailable

    def take(self, kind: str, times: NDArray[np.int64], values: Mapping[str, Values]) -> None:
        """Frames of one message, decoded. What a train's DBC does not carry is not there: NaN, UNKNOWN, none."""
        n = len(times)

        def number(name: str) -> Values:
            return values.get(name, np.full(n, math.nan))

        def place(name: str) -> Values:
            return values.get(name, np.full(n, UNKNOWN, dtype=np.int8))

        def whole(name: str) -> NDArray[np.float64]:
            return np.nan_to_num(number(name).astype(np.float64), nan=0.0)

        if kind == "adhesion":
            confidence, available = place("Confidence"), number("MuAvailable")
            self.has_come |= bool((place("Validity") != NOT_AVAILABLE).any())
            width = _WIDTH[confidence]
            self._adhesion.append(
                time_us=times, validity=place("Validity"), available_pct=available, used_pct=number("MuUsed"),
                low_pct=np.maximum(available - width, 0.0), high_pct=available + width, confidence=confidence,
                contact=place("ContactState"), surface=place("Surface"), age_ms=number("SampleAge"),
            )  # fmt: skip
        elif kind == "detail":
            self._detail.append(
                time_us=times,
                residual_db=np.stack([number(f"Residual{m + 1}") for m in range(MODELS)], axis=1),
                winner=whole("WinningModel"), rule=whole("DominantRule"), cause=place("Cause"),
                stale=np.stack([whole(f"Stale{name}") > 0 for name in INPUTS], axis=1),
            )  # fmt: skip
        elif kind == "inputs":
            self._health.append(
                time_us=times,
                reach=np.stack([whole(f"Reach{name}") for name in INPUTS], axis=1),
                refused=np.stack([place(f"Refused{name}") for name in INPUTS], axis=1),
                plausibility=place("Plausibility"), outlier=whole("Outlier") > 0, unchanged=whole("Unchanged") > 0,
            )  # fmt: skip

    def take_truth(self, times: NDArray[np.int64], values: Mapping[str, Values]) -> None:
        """Frames of the rig's truth."""
        self._truth.append(time_us=times, available_pct=values["MuAvailable"], used_pct=values["MuUsed"])

    def update(self, now_us: int) -> None:
        """Bring the spells up to a time."""
        self.spells.update(self.adhesion, self.detail if self.has_detail else None, now_us)

    @property
    def adhesion(self) -> Adhesion:
        """Columns as they are now; views, to be read before the next frames are taken."""
        t = self._adhesion
        return Adhesion(**{name: t[name] for name in Adhesion.__slots__})

    @property
    def detail(self) -> Detail:
        """Likewise; without rows where there are no such frames."""
        return Detail(**{name: self._detail[name] for name in Detail.__slots__})

    @property
    def health(self) -> Health:
        """Likewise."""
        return Health(**{name: self._health[name] for name in Health.__slots__})

    @property
    def truth(self) -> Truth:
        """Likewise."""
        return Truth(**{name: self._truth[name] for name in Truth.__slots__})


def _rows(hold_us: int, cycle_us: int) -> int:
    return hold_us // max(cycle_us, 1_000) * 5 // 4 + 100 if cycle_us else 1


def row_at(times: NDArray[np.int64], at_us: int, within_us: int) -> int | None:
    """The newest row at or before a time and not older than within_us; None where there is none."""
    k = int(np.searchsorted(times, at_us, side="right")) - 1
    return k if k >= 0 and at_us - int(times[k]) <= within_us else None


__all__ = ["INPUTS", "VALIDITIES", "AxleModel", "Validity", "row_at", "words"]
