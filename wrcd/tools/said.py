"""What frames say, many at once: of the messages that the daemon sends, by our names, and of any other by its DBC's.

The inverse of wrcd/bus/writers.py, for those who look: report, plot, monitor.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Message, Signal, find_message, find_signal
from wrcd.bus.positions import Branch, Field, Numbers, frame_length
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import MESSAGES, Numeric, Words

UNKNOWN = -1  # a word that is none of ours
Values = NDArray[np.float64] | NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Kind:
    """A message of ours: its key in the vocabulary and its axle's number, 0 for the daemon's own."""

    name: str
    axle: int


class Said:
    """Decodes frames of one message. Damaged ones too: whether a frame may be believed is another question."""

    def __init__(
        self, message: Message, output: Output | None = None, kind: Kind | None = None, *, extra: bool = False
    ) -> None:
        self.name, self.key, self.length = message.name, message_key(message), frame_length(message)
        self.kind = kind
        self.cycle_us = 0 if output is None else output.cycle_us
        vocabulary: Mapping[str, Numeric | Words] = {} if kind is None else MESSAGES[kind.name]
        sent = {s.name: OutputSignal(s.name) for s in message.signals} if output is None else output.signals
        self._columns = {
            name: _Column(message, self.length, s, vocabulary.get(name), extra) for name, s in sent.items()
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Of the values that frames carry."""
        return tuple(self._columns)

    def read(self, data: NDArray[np.uint8]) -> dict[str, Values]:
        """Values of frames, data (n, at least the message's length), by name, each (n,).

        A number is in our unit (without a kind in the DBC's), NaN where there is none. A word is its place in the
        vocabulary's words (with extra, those that a field may have beside them come after), UNKNOWN for another.
        """
        data = np.ascontiguousarray(data[:, : self.length])
        whole: dict[str, NDArray[np.uint64]] = {}
        if self.length <= 8:
            padded = np.zeros((len(data), 8), dtype=np.uint8)
            padded[:, : self.length] = data
            whole["little"] = padded.view("<u8")[:, 0]
            padded = np.zeros((len(data), 8), dtype=np.uint8)
            padded[:, 8 - self.length :] = data
            whole["big"] = padded.view(">u8")[:, 0].astype(np.uint64)
        return {name: column.read(data, whole) for name, column in self._columns.items()}


class _Column:
    """One signal of a message."""

    def __init__(
        self, message: Message, length: int, sent: OutputSignal, ours: Numeric | Words | None, extra: bool
    ) -> None:
        s = find_signal(message, sent.name)
        self._field, self._branch = Field(s, length), Branch(message, s, length)
        self._scale, self._offset = float(s.scale) / sent.factor, float(s.offset) / sent.factor
        words = (*ours.words, *(ours.extra if extra else ())) if isinstance(ours, Words) else None
        self._words = None if words is None else _places(s, sent, words)
        self._nothing = _nothing(s, sent) if isinstance(ours, Numeric) and ours.absent else []
        low, high = s.minimum, s.maximum
        self._low = -math.inf if low is None else float(low) / sent.factor
        self._high = math.inf if high is None else float(high) / sent.factor
        if self._low > self._high:
            self._low, self._high = self._high, self._low

    def read(self, data: NDArray[np.uint8], whole: Mapping[str, NDArray[np.uint64]]) -> Values:
        raw = self._raw(data, whole)
        if self._words is not None:
            out = np.full(len(raw), UNKNOWN, dtype=np.int8)
            for value, place in self._words.items():
                out[raw == value] = place
            return out
        values = raw * self._scale + self._offset
        beyond = (values < self._low - 1e-9 * abs(self._low)) | (values > self._high + 1e-9 * abs(self._high))
        values[beyond | np.isin(raw, self._nothing)] = np.nan
        return values

    def _raw(self, data: NDArray[np.uint8], whole: Mapping[str, NDArray[np.uint64]]) -> NDArray[np.float64]:
        at = self._field.position
        if not whole or self._field.is_float or self._branch.conditions:
            return np.array(list(self._one_by_one(data)), dtype=np.float64)
        raw = (whole[at.order] >> np.uint64(at.shift) & np.uint64(at.mask)).astype(np.float64)
        return raw - 2.0 * at.sign * (raw >= at.sign) if at.sign else raw

    def _one_by_one(self, data: NDArray[np.uint8]) -> Iterator[float]:
        for row in data:
            numbers = Numbers(row.tobytes())
            yield float(self._field.raw(numbers)) if self._branch.carried(numbers) else math.nan


def _places(s: Signal, sent: OutputSignal, words: tuple[str, ...]) -> dict[int, int]:
    """Raw values of words, as read from a frame, to their places. Of words that share one raw value the first wins."""
    labels = {str(label): int(raw) for raw, label in (s.choices or {}).items()} if sent.words is None else sent.words
    out: dict[int, int] = {}
    for place, word in enumerate(words):
        if word in labels:
            out.setdefault(labels[word], place)
    return out


def _nothing(s: Signal, sent: OutputSignal) -> list[float]:
    """Raw values that are no number: those that are named, or, as writers have it, the highest."""
    named = [float(raw) for raw in s.choices or {}]
    if sent.not_available is not None:
        named.append(float(sent.not_available))
    return named or [float((1 << s.length - s.is_signed) - 1)]


def said(config: Config, *, extra: bool = False) -> Iterator[Said]:
    """A decoder for each message that a daemon of this configuration sends; with the vocabulary's extra words, too."""
    for axle in config.axles:
        for name, output in (
            ("adhesion", axle.adhesion), ("detail", axle.detail), ("inputs", axle.inputs), ("ahead", axle.ahead),
        ):  # fmt: skip
            if output is not None:
                yield Said(find_message(config.database, output.message), output, Kind(name, axle.number), extra=extra)
    for name, output in (
        ("status_message", config.status), ("rejects_message", config.rejects), ("link_message", config.link),
    ):  # fmt: skip
        if output is not None:
            yield Said(find_message(config.database, output.message), output, Kind(name, 0), extra=extra)
