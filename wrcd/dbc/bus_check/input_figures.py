"""What the frames of a log or a bus say: the values of each input, in figures, and how long each axle was Valid."""

import math
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import MessageReader, Receiver, Sample
from wrcd.bus.dbc import cycle_ms, find_message
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config, Input
from wrcd.core.events import Change
from wrcd.logs.columns import Columns, Item, Stretch
from wrcd.logs.story_events import of_changes
from wrcd.logs.story_records import Event, total_s

MAX_KEPT = 500_000  # of each input's values: 40 min at 200 Hz

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(slots=True)
class Readings:
    """Values in SI units and their stamps, the first MAX_KEPT of them."""

    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, stamp_us: int, value: float) -> None:
        """One more."""
        if len(self.stamps) < MAX_KEPT:
            self.stamps.append(stamp_us)
            self.values.append(value)

    @property
    def stamps_us(self) -> IntArray:
        """(n,)"""
        return np.array(self.stamps, dtype=np.int64)

    @property
    def si(self) -> FloatArray:
        """(n,)"""
        return np.array(self.values, dtype=np.float64)


class Gathered:
    """What came, frame by frame: the values of each input, the times of each mapped message, who else is there."""

    def __init__(self, config: Config) -> None:
        self.receiver = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
        self._columns = Columns(self.receiver)  # plausible or not
        self.inputs = [Readings() for _ in config.inputs]
        self.frames: Counter[str] = Counter()  # by mapped message, refused ones too
        self.times: dict[str, array[int]] = {r.name: array("q") for r in self.receiver.readers.values()}
        self.others: Counter[int] = Counter()  # frames that are not mapped, by key
        self.errors = 0
        self.first_us: int | None = None
        self.last_us = 0

    @property
    def seconds(self) -> float:
        """From the first frame to the last."""
        return 0.0 if self.first_us is None else (self.last_us - self.first_us) * 1e-6

    @property
    def mapped(self) -> int:
        """Frames of mapped messages."""
        return self.frames.total()

    def watched(self, items: Iterable[Item]) -> Iterator[Item]:
        """The same items, each taken down on its way."""
        for item in items:
            self.take(item)
            yield item

    def take(self, item: Item) -> None:
        """A frame, or a stretch of them."""
        if isinstance(item, tuple):
            self._frame(item[0])
        elif len(item):
            self._stretch(item)

    def _frame(self, frame: Frame) -> None:
        self._time(frame.stamp_us)
        if frame.error:
            self.errors += 1
            return
        reader = self.receiver.reader(frame)
        if reader is None:
            self.others[frame.key] += 1
            return
        samples = reader.read(frame)
        self._take(reader, frame.stamp_us, samples if isinstance(samples, list) else ())

    def _stretch(self, s: Stretch) -> None:
        self._time(int(s.stamps_us[0]))
        self._time(int(s.stamps_us[-1]))
        keys, counts = np.unique(s.keys, return_counts=True)
        for key, count in zip(keys.tolist(), counts.tolist(), strict=True):
            if key not in self.receiver.readers:
                self.others[key] += count
        for place, stamp_us, reader, samples in self._columns.read(s):
            if samples is None:
                found = reader.read(s.frame(place))
                samples = found if isinstance(found, list) else ()
            self._take(reader, stamp_us, samples)

    def _time(self, stamp_us: int) -> None:
        self.first_us = stamp_us if self.first_us is None else min(self.first_us, stamp_us)
        self.last_us = max(self.last_us, stamp_us)

    def _take(self, reader: MessageReader, stamp_us: int, samples: Iterable[Sample]) -> None:
        self.frames[reader.name] += 1
        times = self.times[reader.name]
        if len(times) < MAX_KEPT:
            times.append(stamp_us)
        for sample in samples:
            self.inputs[sample.source].add(stamp_us, sample.value)


FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
STEADY = 0.5  # of the usual gap: neighbours further apart than that are none


@dataclass(frozen=True, slots=True)
class SignalFigures:
    """Of one input. Times in ms, values in SI units; NaN where there is nothing to tell it from."""

    name: str  # Message.Signal
    quantity: str
    unit: str
    axles: tuple[int, ...]  # numbers
    frames: int  # of its message
    per_s: float
    cycle_ms: int | None  # as the DBC says
    usual_ms: float  # the mean gap in which nothing is missing
    jitter_ms: float  # 99 of 100 gaps lie within so much of the usual one
    longest_ms: float  # gap
    timeout_ms: float
    refused: Mapping[Reason, int]
    low: float
    high: float
    step: float  # of its raw value
    noise: float  # rms of what is no movement: of the fourth difference
    at_limit: float  # share of the values that stand at an end of its range

    @property
    def refused_share(self) -> float:
        """Of the frames of its message."""
        return sum(self.refused.values()) / self.frames if self.frames else 0.0


def figures(config: Config, gathered: Gathered, rejected: Mapping[tuple[str, Reason], int]) -> list[SignalFigures]:
    """Of every input of a configuration; rejected: by message, as the core counts them."""
    refused: dict[str, Counter[Reason]] = {}
    for (name, reason), count in rejected.items():
        refused.setdefault(name, Counter())[reason] += count
    return [
        _figures(config, gathered, number, i, refused.get(i.source.message, Counter()))
        for number, i in enumerate(config.inputs)
    ]


def _figures(config: Config, gathered: Gathered, number: int, i: Input, refused: Counter[Reason]) -> SignalFigures:
    s = i.source
    message = find_message(config.database, s.message)
    reader = next(r for r in gathered.receiver.readers.values() if r.name == s.message)
    signal = next(r for r in reader.signals if r.number == number)
    values, frames = gathered.inputs[number].si, gathered.frames[s.message]
    # of a multiplexed message only some frames carry the signal
    whole = len(values) == 0 or not reader.is_multiplexed
    stamps = np.array(gathered.times[s.message], dtype=np.int64) if whole else gathered.inputs[number].stamps_us
    usual, jitter, longest = _gaps(stamps)
    step = abs(float(signal.scale) * signal.factor)
    lower, upper = signal.ends
    n = len(values)
    stands = (values <= lower) | (values >= upper)
    return SignalFigures(
        name=f"{s.message}.{s.signal}",
        quantity=s.quantity.key,
        unit=s.quantity.unit,
        axles=tuple(config.axles[place].number for place in s.axles),
        frames=frames,
        per_s=frames / gathered.seconds if gathered.seconds > 0 else 0.0,
        cycle_ms=cycle_ms(message),
        usual_ms=usual,
        jitter_ms=jitter,
        longest_ms=longest,
        timeout_ms=i.timeout_us / 1000,
        refused=dict(refused),
        low=float(values.min()) if n else math.nan,
        high=float(values.max()) if n else math.nan,
        step=step,
        noise=noise(gathered.inputs[number].stamps_us, values),
        at_limit=float(stands.mean()) if n else math.nan,
    )


def _gaps(stamps_us: IntArray) -> tuple[float, float, float]:
    """The usual gap, the 99th percentile of how far gaps are from it, and the longest, in ms."""
    if len(stamps_us) < 2:
        return math.nan, math.nan, math.nan
    gaps = np.diff(stamps_us) / 1000
    usual = float(np.mean(gaps[gaps <= 2 * np.median(gaps)]))  # of those in which nothing is missing
    return usual, float(np.percentile(np.abs(gaps - usual), 99)), float(gaps.max())


def noise(stamps_us: IntArray, values: FloatArray) -> float:
    """Rms of the white part of a series: the median square of its fourth difference over neighbours on end."""
    if len(values) < 100:
        return math.nan
    gaps = np.diff(stamps_us)
    steady = np.abs(gaps - np.median(gaps)) < STEADY * np.median(gaps)
    whole = np.convolve(steady, np.ones(4), "valid") == 4
    difference = np.convolve(values, FOURTH_DIFFERENCE, "valid")[whole] / np.linalg.norm(FOURTH_DIFFERENCE)
    return float(np.sqrt(np.mean(difference * difference))) if len(difference) else math.nan


@dataclass(frozen=True, slots=True)
class Spells:
    """How long an axle was Valid, and how long not, by cause."""

    events: tuple[Event, ...]

    @property
    def all_s(self) -> float:
        """All of it."""
        return total_s(self.events)

    @property
    def valid_share(self) -> float:
        """Of all of it."""
        return self._share([e for e in self.events if e.validity is Validity.VALID])

    @property
    def shares(self) -> dict[Cause, float]:
        """By cause of not being Valid, the largest first."""
        bad = [e for e in self.events if e.validity is not Validity.VALID]
        shares = {
            cause: self._share([e for e in bad if e.cause is cause]) for cause in dict.fromkeys(e.cause for e in bad)
        }
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def longest(self, cause: Cause) -> str:
        """The detail of a cause when it lasted longest."""
        longest = max((e for e in reversed(self.events) if e.cause is cause), key=lambda e: e.duration_s)
        return longest.detail or cause.words

    def _share(self, events: Sequence[Event]) -> float:
        return total_s(events) / self.all_s if self.all_s else 0.0


def spells(axle: int, changes: Sequence[Change], end_us: int) -> Spells:
    """Of an axle, from its first change of Validity on."""
    own = [c for c in changes if c.axle == axle]
    return Spells(of_changes(axle, own, own[0].time_us, end_us) if own else ())
