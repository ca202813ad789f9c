"""What the frames of a log or a bus say, by input: kept as it comes, looked at when all of it is there."""

from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import MessageReader, Receiver, Sample
from wrcd.bus.columns import Columns, Stretch
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config

MAX_KEPT = 500_000  # of each input's values: 40 min at 200 Hz

Item = Stretch | tuple[Frame, str]
FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(slots=True)
class Series:
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
        self._columns = Columns(self.receiver, lambda *_: True)  # plausible or not
        self.inputs = [Series() for _ in config.inputs]
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
        for place, stamp_us, reader, samples, _ in self._columns.read(s):
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
