"""What the frames of a log or a bus say: the values of each input, in figures."""

import math
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.batch import FrameBatch
from wrcd.bus.dbc import cycle_ms, find_message
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.configuration import Config, Input
from wrcd.core.reading import NOT_MAPPED, Receiver
from wrcd.logs.columns import Item, Stretch
from wrcd.logs.story_records import NO_GAPS, Gaps
from wrcd.logs.time_order import MonotonicTime

MAX_KEPT = 500_000  # of each input's values: 40 min at 200 Hz

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(slots=True)
class Readings:
    """Values in SI units and their stamps, the first MAX_KEPT of them."""

    stamps: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))
    frames: int = 0  # that carry it, refused ones too

    def add(self, stamp_us: int, value: float) -> None:
        """One more."""
        self.frames += 1
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

    def __init__(self, config: Config, clock: MonotonicTime | None = None) -> None:
        """clock: of a log, whose time goes on."""
        self._clock = clock
        self.receiver = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
        self._messages = {m.key: m for m in self.receiver.mapped.messages}
        self.inputs = [Readings() for _ in config.inputs]  # plausible or not
        self.frames: Counter[str] = Counter()  # by mapped message, refused ones too
        self.times: dict[str, array[int]] = {m.name: array("q") for m in self._messages.values()}
        self.others: Counter[int] = Counter()  # frames that are not mapped, by key
        self.errors = 0
        self.first_us: int | None = None
        self.last_us = -(1 << 62)

    @property
    def gaps(self) -> Gaps:
        """Of the log."""
        return NO_GAPS if self._clock is None else self._clock.gaps

    @property
    def seconds(self) -> float:
        """From the first frame to the last, or as long as the bus was listened to, without the gaps."""
        return 0.0 if self.first_us is None else (self.last_us - self.first_us - self.gaps.total_us) * 1e-6

    @property
    def recorded_us(self) -> tuple[int, int]:
        """The first and the last time, as if there were no gaps."""
        first_us = self.first_us or 0
        return first_us, max(self.last_us - self.gaps.total_us, first_us)

    @property
    def mapped(self) -> int:
        """Frames of mapped messages."""
        return self.frames.total()

    def carries_none(self, number: int) -> bool:
        """Whether frames of an input's message come, but none in which a multiplexer selects it."""
        return any(
            self.frames[m.name] and not self.inputs[number].frames and s.branch.conditions
            for m in self._messages.values()
            for s in m.signals
            if s.number == number
        )

    def watched(self, items: Iterable[Item]) -> Iterator[Item]:
        """The same items, each taken down on its way."""
        for item in items:
            self.take(item)
            yield item

    def take(self, item: Item) -> None:
        """A frame, or a stretch of them."""
        if self._clock is not None:
            item = self._clock.moved(item)
        if isinstance(item, tuple):
            self._frame(item[0])
        elif len(item):
            self._stretch(item)

    def _frame(self, frame: Frame) -> None:
        self.lasts(frame.stamp_us)
        if frame.error:
            self.errors += 1
            return
        self._take(FrameBatch.of((frame,)), [frame.stamp_us], np.array([frame.key]))

    def _stretch(self, s: Stretch) -> None:
        self.lasts(int(s.stamps_us[0]))
        self.lasts(int(s.stamps_us[-1]))
        self._take(s.batch, s.stamps_us.tolist(), s.keys)

    def _take(self, batch: FrameBatch, stamps_us: Sequence[int], keys: IntArray) -> None:
        reasons, samples = self.receiver.read_all(batch)
        for reason, stamp_us, key in zip(
            reasons.tolist(), stamps_us, self.receiver.mapped.named(keys).tolist(), strict=True
        ):  # fmt: skip
            if reason == NOT_MAPPED:
                self.others[key] += 1
                continue
            name = self._messages[key].name
            self.frames[name] += 1
            if len(self.times[name]) < MAX_KEPT:
                self.times[name].append(stamp_us)
        for stamp_us, number, value in zip(
            *(samples[of].tolist() for of in ("stamp_us", "input", "value")), strict=True
        ):
            if value == value:
                self.inputs[number].add(stamp_us, value)
            else:  # of a frame that was refused
                self.inputs[number].frames += 1

    def lasts(self, stamp_us: int) -> None:
        """There was listened at a time."""
        self.first_us = stamp_us if self.first_us is None else min(self.first_us, stamp_us)
        self.last_us = max(self.last_us, stamp_us)


FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
STEADY = 0.5  # of the usual gap: neighbours further apart than that are none


@dataclass(frozen=True, slots=True)
class SignalFigures:
    """Of one input. Times in ms, values in SI units; NaN where there is nothing to tell it from."""

    name: str  # Message.Signal
    quantity: str
    unit: str
    axles: tuple[int, ...]  # numbers
    frames: int  # of its message; of a multiplexed one those that carry it
    per_s: float
    cycle_ms: int | None  # as the DBC says; of a multiplexed signal it does not
    usual_ms: float  # the mean gap in which nothing is missing
    jitter_ms: float  # 99 of 100 gaps lie within so much of the usual one
    longest_ms: float  # gap
    timeout_ms: float
    refused: Mapping[Reason, int]
    low: float
    high: float
    step: float  # of its raw value, of a float the smallest that was seen
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
    signal = next(r for r in gathered.receiver.mapped.signals if r.number == number)
    came = gathered.inputs[number]
    values, stamps, frames = came.si, np.array(gathered.times[s.message], np.int64), gathered.frames[s.message]
    if signal.branch.conditions:  # only some frames of its message carry it
        stamps, frames = came.stamps_us, came.frames
    usual, jitter, longest = _gaps(gathered.gaps.taken_out(stamps), *gathered.recorded_us, whole=frames < MAX_KEPT)
    step = _float_step(values) if signal.field.is_float else abs(float(signal.scale) * signal.factor)
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
        cycle_ms=None if signal.branch.conditions else cycle_ms(message),
        usual_ms=usual,
        jitter_ms=jitter,
        longest_ms=longest,
        timeout_ms=i.timeout_us / 1000,
        refused=dict(refused),
        low=float(values.min()) if n else math.nan,
        high=float(values.max()) if n else math.nan,
        step=step,
        noise=noise(came.stamps_us, values),
        at_limit=float(stands.mean()) if n else math.nan,
    )


def _float_step(values: FloatArray) -> float:
    """The step that values have in fact: one change in a hundred is smaller."""
    changes = np.abs(np.diff(values))
    changes = changes[changes > 0.0]
    return float(np.percentile(changes, 1)) if len(changes) else math.nan


def _gaps(stamps_us: IntArray, begin_us: int, end_us: int, *, whole: bool) -> tuple[float, float, float]:
    """The usual gap, the 99th percentile of how far gaps are from it, and the longest, in ms. The silences at both ends
    of the log count; whole: the stamps go on until its end."""
    if len(stamps_us) < 2:
        return math.nan, math.nan, math.nan
    gaps = np.diff(stamps_us) / 1000
    usual = float(np.mean(gaps[gaps <= 2 * np.median(gaps)]))  # of those in which nothing is missing
    silences = (stamps_us[0] - begin_us, (end_us - stamps_us[-1]) * whole)
    return usual, float(np.percentile(np.abs(gaps - usual), 99)), max(float(gaps.max()), *(x / 1000 for x in silences))


def noise(stamps_us: IntArray, values: FloatArray) -> float:
    """Rms of the white part of a series: the median square of its fourth difference over consecutive values."""
    if len(values) < 100:
        return math.nan
    gaps = np.diff(stamps_us)
    steady = np.abs(gaps - np.median(gaps)) < STEADY * np.median(gaps)
    whole = np.convolve(steady, np.ones(4), "valid") == 4
    difference = np.convolve(values, FOURTH_DIFFERENCE, "valid")[whole] / np.linalg.norm(FOURTH_DIFFERENCE)
    return float(np.sqrt(np.mean(difference * difference))) if len(difference) else math.nan
