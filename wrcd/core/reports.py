"""What comes of a slot: a report of each axle, and the frames."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from wrcd.bus.batch import RECORD, FrameBatch
from wrcd.bus.frame import Frame
from wrcd.bus.writers import Value
from wrcd.core.causes import Cause, Validity
from wrcd.core.vocabulary import SURFACES, words_of

_VALIDITIES = tuple(Validity(word) for word in words_of("adhesion", "Validity"))
_SURFACES, _CONTACTS, _LEVELS = (words_of("adhesion", name) for name in ("Surface", "ContactState", "Confidence"))
_CAUSES = tuple(Cause)
Records = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Report:
    """One axle at one slot. Adhesion in percent; None is not available."""

    validity: Validity
    mu_available_pct: float | None
    mu_used_pct: float | None
    sample_age_ms: int
    surface: str
    contact_state: str
    confidence: str
    cause: Cause  # of not being Valid
    short: bool = False  # for a window of too little track: nothing was lost

    def values(self) -> dict[str, Value]:
        """By signal name of the DBC."""
        return {
            "Validity": self.validity.value,
            "MuAvailable": self.mu_available_pct,
            "MuUsed": self.mu_used_pct,
            "SampleAge": float(self.sample_age_ms),
            "Surface": self.surface,
            "ContactState": self.contact_state,
            "Confidence": self.confidence,
        }


def surface(mu_available_pct: float | None) -> str:
    """The DBC's class of an adhesion."""
    if mu_available_pct is None:
        return "Unknown"
    return next(name for low, name in SURFACES if mu_available_pct >= low)


_HEAD = [
    "validity", "mu_available_pct", "mu_used_pct", "sample_age_ms", "surface", "contact", "confidence", "cause",
    "is_short",
]  # fmt: skip


def reports(of: Records) -> list[Report]:
    """Those of records."""
    return [
        Report(
            _VALIDITIES[validity], mu if mu == mu else None, used if used == used else None, age_ms, _SURFACES[surface],
            _CONTACTS[contact], _LEVELS[confidence], _CAUSES[cause], bool(is_short),
        )
        for validity, mu, used, age_ms, surface, contact, confidence, cause, is_short in of[_HEAD].tolist()
    ]  # fmt: skip


class Outgoing(NamedTuple):
    """A frame to send, and the length of its slot: after the slot it is worthless."""

    frame: Frame
    cycle_us: int
    cause: Cause  # of an axle's adhesion not being Valid
    reports: Any  # of the slots that were made at once; report: the axle's place among them, -1: it is no adhesion
    report: int

    @property
    def why(self) -> Any:
        """What an axle's adhesion was estimated as, a record of C; None while it has no estimate."""
        if self.report < 0 or not self.reports[self.report]["has_estimate"]:
            return None
        return self.reports[self.report]["estimate"]


@cache
def _as_frames(size: int) -> np.dtype[Any]:
    return np.dtype({"names": ["frame"], "formats": [f"V{RECORD.size}"], "itemsize": size})


class Made(Sequence[Outgoing]):
    """Frames that were made, as records, and the reports that they are of; each an object when it is looked at."""

    def __init__(self, frames: Records, reports: Records) -> None:
        self.frames, self.reports = frames, reports

    def followed_by(self, other: "Made") -> "Made":
        """Both, one behind the other."""
        later = other.frames.copy()
        later["report"][later["report"] >= 0] += len(self.reports)
        return Made(np.concatenate([self.frames, later]), np.concatenate([self.reports, other.reports]))

    def batch(self, places: Any = slice(None)) -> FrameBatch:
        """The frames at some places, as a link sends them."""
        return FrameBatch(self.frames.view(_as_frames(self.frames.itemsize))["frame"][places].tobytes())

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, k: Any) -> Any:
        return list(self)[k]

    def __iter__(self) -> Iterator[Outgoing]:
        columns = (self.frames[name].tolist() for name in ("cycle_us", "cause", "report"))
        for frame, cycle_us, cause, of in zip(self.batch(), *columns, strict=True):
            yield Outgoing(frame, cycle_us, _CAUSES[cause], self.reports, of)
