"""What a log tells, as records of columns, and its numbers and times in words. Times are whole microseconds as in
the log, and go on over a step of its clock; NaN is: there is none."""

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.design_fit import DesignFit
from wrcd.errors import InputError

Times = NDArray[np.int64]
Numbers = NDArray[np.float32]
Places = NDArray[np.int8]  # of a word in the vocabulary's words (wrcd/core/vocabulary.py); -1: another


@dataclass(frozen=True, slots=True)
class Record:
    """Frames in the order of time, as columns of one length."""

    time_us: Times

    def __len__(self) -> int:
        return len(self.time_us)

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def part(self, rows: slice | NDArray[Any]) -> Self:
        """Return some of the rows."""
        return type(self)(**{name: column[rows] for name, column in self.columns().items()})


@dataclass(frozen=True, slots=True)
class AdhesionRecord(Record):
    """Adhesion frames of an axle, n of them."""

    validity: Places
    available_pct: Numbers
    used_pct: Numbers
    low_pct: Numbers  # the interval that was estimated, or of sent frames Confidence's; cut at 0; NaN: no bound
    high_pct: Numbers
    confidence: Places
    contact: Places
    surface: Places
    age_ms: Numbers


@dataclass(frozen=True, slots=True)
class Detail(Record):
    """AdhesionDetail frames, m of them."""

    residual_db: Numbers  # (m, 4)
    winner: Places  # 1 … 4, 0: none
    rule: NDArray[np.int16]  # from 1, 0: none
    cause: Places
    stale: NDArray[np.bool_]  # (m, 4): yaw rate, lateral acceleration, torque, speed


@dataclass(frozen=True, slots=True)
class HealthRecord(Record):
    """InputHealth frames, h of them."""

    reach: NDArray[np.uint8]  # (h, 4)
    refused: Places  # (h, 4): place of the reason
    plausibility: Places
    outlier: NDArray[np.bool_]
    unchanged: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class TruthRecord(Record):
    """What the rig says of an axle."""

    available_pct: Numbers
    used_pct: Numbers


@dataclass(frozen=True, slots=True)
class Gaps:
    """Where a log has nobody's frame for so long that its recorder was off, (n,) each, in the order of time."""

    begin_us: Times
    end_us: Times

    @classmethod
    def of(cls, gaps: Sequence[tuple[int, int]]) -> Self:
        """From begins and ends."""
        begin_us, end_us = np.array(gaps, np.int64).reshape(-1, 2).T
        return cls(begin_us, end_us)

    @property
    def total_us(self) -> int:
        """How long they last together."""
        return int((self.end_us - self.begin_us).sum())

    def taken_out(self, time_us: Times) -> Times:
        """Times as if the recorder had gone on."""
        lost_us = np.concatenate((np.zeros(1, np.int64), np.cumsum(self.end_us - self.begin_us)))
        out: Times = time_us - lost_us[np.searchsorted(self.end_us, time_us, side="right")]
        return out


NO_GAPS = Gaps.of(())
GAP = "gap of the log"


@dataclass(frozen=True, slots=True)
class Event:
    """An axle in one state of Validity, for one cause, from begin until before end (the end of the log, perhaps)."""

    axle: int
    begin_us: int
    end_us: int
    validity: Validity
    cause: Cause
    detail: str  # an input with its figures, where it is known; else ""

    @property
    def duration_s(self) -> float:
        """How long."""
        return (self.end_us - self.begin_us) / 1e6

    @property
    def name(self) -> str:
        """Its cause, as the DBC spells it."""
        return self.cause.label if self.cause else self.detail or "cause not known"

    @property
    def because(self) -> str:
        """Its cause in words, with its figures where they are known."""
        if not self.cause:
            return self.detail or "cause not known"
        return self.cause.words + (f" ({self.detail})" if self.detail else "")

    @property
    def is_gap(self) -> bool:
        """Whether the log has nobody's frame: nothing is known of the axle."""
        return self.detail == GAP


@dataclass(frozen=True, slots=True)
class Spells:
    """How long an axle was in which state, gaps left out."""

    events: tuple[Event, ...]

    @classmethod
    def of(cls, events: Iterable[Event]) -> Self:
        """Those that are no gap."""
        return cls(tuple(e for e in events if not e.is_gap))

    @property
    def known_s(self) -> float:
        """All of it."""
        return total_s(self.events)

    def lasted_s(self, validity: Validity) -> float:
        """How long it was of a Validity."""
        return total_s(e for e in self.events if e.validity is validity)

    def share(self, validity: Validity) -> float:
        """Of what is known, 0 … 1; NaN where nothing is."""
        return self.lasted_s(validity) / self.known_s if self.known_s else math.nan

    @property
    def shares(self) -> dict[Cause, float]:
        """By cause of not being Valid, the largest first."""
        lasted: dict[Cause, float] = {}
        for e in self.events:
            if e.validity is not Validity.VALID:
                lasted[e.cause] = lasted.get(e.cause, 0.0) + e.duration_s
        return {cause: s / self.known_s for cause, s in sorted(lasted.items(), key=lambda item: -item[1])}

    def longest(self, cause: Cause) -> str:
        """The detail of a cause when it lasted longest."""
        longest = max((e for e in reversed(self.events) if e.cause is cause), key=lambda e: e.duration_s)
        return longest.detail or cause.words


@dataclass(frozen=True, slots=True)
class StoryAxle:
    """One wheelset's log."""

    number: int
    adhesion: AdhesionRecord
    detail: Detail | None
    health: HealthRecord | None
    truth: TruthRecord | None
    events: tuple[Event, ...]  # without a gap between them
    own: "Series | None" = None  # AdhesionOwn

    def event_at(self, time_us: int) -> Event | None:
        """Return the event that a moment lies in."""
        found = [e for e in self.events if e.begin_us <= time_us < e.end_us]
        if found:
            return found[-1]
        return self.events[-1] if self.events and time_us == self.events[-1].end_us else None

    @property
    def spells(self) -> Spells:
        """How long it was in which state."""
        return Spells.of(self.events)

    def not_valid_runs(self) -> list[list[Event]]:
        """Return consecutive events that are not Valid, run by run. A gap of the log ends a run."""
        groups = itertools.groupby(self.events, key=lambda e: (e.validity is Validity.VALID, e.is_gap))
        return [list(run) for (valid, gap), run in groups if not (valid or gap)]


@dataclass(frozen=True, slots=True)
class Series:
    """Values by name, each (n,), that came together: WrcdStatus, WrcdRejects, WrcdLink, an input."""

    time_us: Times
    values: Mapping[str, NDArray[np.float64]]
    constant: bool = False  # what the configuration says holds from the first to the last

    def at(self, name: str, time_us: int, max_age_us: int) -> float:
        """Return a value at a time, NaN if there is none so new. What a constant makes holds, or grows, all along."""
        if name not in self.values:
            return math.nan
        if self.constant:
            return float(np.interp(time_us, self.time_us, self.values[name]))
        place = newest(self.time_us, time_us, max_age_us)
        return math.nan if place is None else float(self.values[name][place])


@dataclass(frozen=True, slots=True)
class MessageStatistics:
    """The frames of one id on the bus."""

    key: int  # Frame.key
    name: str  # "" if no DBC knows it
    role: str  # "input", "output", "truth", "other"
    frames: int
    mean_hz: float
    longest_gap_ms: float
    longest_gap_at_us: int
    cycle_ms: float  # as the DBC or the configuration says, NaN if neither does
    wrong_e2e: int  # frames whose CRC does not fit, of outputs and inputs under E2E; -1: not looked at


@dataclass(frozen=True, slots=True)
class BusStatistics:
    """The bus over the log."""

    messages: tuple[MessageStatistics, ...]
    time_us: Times  # one a second, when it begins
    frames_per_s: Numbers
    load_pct: Numbers  # at bit_rate, with the mean of fewest and most stuff bits
    bit_rate: int  # assumed or given, bit/s: no log tells it
    error_frames: Times  # their time stamps


@dataclass(frozen=True, slots=True)
class Finding:
    """A sentence of the verdict. level: "good", "note", "warning" or "bad"."""

    level: str
    text: str
    axle: int = 0  # 0: of all
    begin_us: int | None = None
    end_us: int | None = None


@dataclass(frozen=True, slots=True)
class ClockStep:
    """The log's clock was set back: when, in the time that goes on, and by how much."""

    at_us: int
    back_us: int
    before_us: int = 0  # how far that time was ahead of the log's stamps before it


@dataclass(frozen=True, slots=True)
class Fall:
    """MuAvailable fell or rose for good: what a reader asks about first."""

    axle: int
    begin_us: int
    end_us: int
    before_pct: float
    after_pct: float

    @property
    def is_down(self) -> bool:
        """Whether it is a fall."""
        return self.after_pct < self.before_pct

    @property
    def verb(self) -> str:
        """What it did."""
        return "fell" if self.is_down else "rose"


@dataclass(frozen=True, slots=True)
class Story:
    """All of a log."""

    log: Path
    channel: str
    source: str  # "frames of the log", "estimated here"
    begin_us: int
    end_us: int
    axles: tuple[StoryAxle, ...]
    speed: Series | None  # "speed_m_s"
    distance: Series | None  # "distance_m": from the speed, 0 at the beginning
    torque: Mapping[int, Series]  # by axle: "torque_Nm"
    status: Series | None
    rejects: Series | None
    link: Series | None
    bus: BusStatistics
    falls: tuple[Fall, ...]
    verdict: tuple[Finding, ...]
    warnings: tuple[str, ...]  # of the log's damage, order, …
    config: Config
    versions: Mapping[str, str] = field(default_factory=dict)  # wrcd, design and its checksum, Python, libraries
    whole: bool = True  # all of the log could be read
    clock_steps: tuple[ClockStep, ...] = ()
    gaps: Gaps = NO_GAPS
    accepted: int = 0  # frames that the core accepted, of what is estimated here
    refused: Mapping[tuple[str, Reason], int] = field(default_factory=dict)  # by message and reason, likewise
    design_fits: tuple[DesignFit, ...] = ()  # of its bogies, likewise

    def axle(self, number: int) -> StoryAxle:
        """Return an axle by its number. Raises InputError for one that the log has not."""
        for axle in self.axles:
            if axle.number == number:
                return axle
        shown = ", ".join(str(a.number) for a in self.axles) or "none"
        raise InputError(f"the log has nothing of axle {number}", key="--axle", hint=f"it has {shown}")


def newest(time_us: Times, at_us: int, max_age_us: int) -> int | None:
    """Return the place of the newest of some times at or before a time, None if it is older than that."""
    place = int(np.searchsorted(time_us, at_us, side="right")) - 1
    return place if place >= 0 and at_us - int(time_us[place]) <= max_age_us else None


def newest_values(time_us: Times, values: NDArray[Any], at_us: Times, max_age_us: int) -> NDArray[np.float64]:
    """Return the newest value at each time, NaN where there is none yet or it is older than that."""
    if not len(time_us):
        return np.full(len(at_us), np.nan)
    places = np.searchsorted(time_us, at_us, side="right") - 1
    at = places.clip(0)
    return np.where((places >= 0) & (at_us - time_us[at] <= max_age_us), values[at].astype(np.float64), np.nan)


def percent(value: float) -> str:
    """38 or 4.6: two digits are enough."""
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}"


def seconds(value_s: float) -> str:
    """A duration: 0.02 s, 8.0 s, 95 s."""
    digits = 2 if abs(value_s) < 0.995 else 1 if abs(value_s) < 99.95 else 0
    return f"{value_s:.{digits}f} s"


def at(story: Story, time_us: int) -> str:
    """A time since the log's first frame."""
    return f"{(time_us - story.begin_us) * 1e-6:.1f} s"


def causes(events: Iterable[Event]) -> str:
    """For how long each cause lasted, longest first: "TooLittleData 0.48 s, Harsh 0.04 s"."""
    lasted: dict[str, float] = {}
    for e in events:
        lasted[e.name] = lasted.get(e.name, 0.0) + e.duration_s
    ordered = sorted(lasted.items(), key=lambda item: -item[1])
    more = f", {len(ordered) - 4} more" if len(ordered) > 4 else ""
    return ", ".join(f"{cause} {seconds(s)}" for cause, s in ordered[:4]) + more


def lasting(events: Iterable[Event], validity: Validity, begin_us: int, end_us: int) -> list[Event]:
    """What of the events of one Validity lies within a time."""
    return [
        Event(e.axle, max(e.begin_us, begin_us), min(e.end_us, end_us), e.validity, e.cause, e.detail)
        for e in events
        if e.validity is validity and e.begin_us < end_us and e.end_us > begin_us
    ]


def total_s(events: Iterable[Event]) -> float:
    """How long they last together."""
    return sum(e.duration_s for e in events)
