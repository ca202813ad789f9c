"""Decodes frames by columns: messages that the daemon sends, by our names and as records, and others by their DBC.

The inverse of wrcd/bus/writers.py.
"""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import Message, Signal, find_message, find_signal
from wrcd.bus.positions import Branch, Field, Order, frame_length, message_key, span
from wrcd.bus.positions import Numbers as FrameNumbers
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.configuration import AXLE_OUTPUTS, Config
from wrcd.core.vocabulary import CONFIDENCES, MESSAGES, Numeric, Words
from wrcd.logs.scan import Scan, good_frames
from wrcd.logs.story_records import AdhesionRecord, Detail, HealthRecord, Numbers, Places, Series

OF_DAEMON = ("status_message", "rejects_message", "link_message")
UNKNOWN = -1  # a word that is none of ours
Values = NDArray[np.float64] | NDArray[np.int8]


class MessageDecoder:
    """Decodes frames of one message. Damaged ones too: whether a frame may be believed is another question."""

    def __init__(self, message: Message, output: Output | None = None, kind: str = "", axle: int = 0) -> None:
        """kind: the key in the vocabulary of a message of ours; axle: its number, 0 for the daemon's own."""
        self.name, self.key, self.length = message.name, message_key(message), frame_length(message)
        self.kind, self.axle, self.message = kind, axle, message
        self.cycle_us = 0 if output is None else output.cycle_us
        self.data_id = None if output is None else output.data_id
        vocabulary: Mapping[str, Numeric | Words] = MESSAGES[kind] if kind else {}
        self.signals = {s.name: OutputSignal(s.name) for s in message.signals} if output is None else output.signals
        self._columns = {
            name: _Column(message, self.length, s, vocabulary.get(name)) for name, s in self.signals.items()
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Of the values that frames carry."""
        return tuple(self._columns)

    def read(self, data: NDArray[np.uint8]) -> dict[str, Values]:
        """Values of frames, data (n, at least the message's length), by name, each (n,).

        A number is in our unit (without a kind in the DBC's), NaN where there is none. A word is its place in the
        vocabulary's words, UNKNOWN for another.
        """
        data = np.ascontiguousarray(data[:, : self.length])
        orders: tuple[Order, ...] = ("little", "big") if self.length <= 8 else ()
        whole = {order: whole_numbers(data, self.length, order) for order in orders}
        return {name: column.read(data, whole) for name, column in self._columns.items()}


def whole_numbers(data: NDArray[np.uint8], length: int, order: Order) -> NDArray[np.uint64]:
    """Frames of up to eight bytes, data (n, length or more), as whole numbers, (n,)."""
    padded = np.zeros((len(data), 8), dtype=np.uint8)
    first = 0 if order == "little" else 8 - length
    padded[:, first : first + length] = data[:, :length]
    return padded.view("<u8" if order == "little" else ">u8")[:, 0].astype(np.uint64)


class _Column:
    """One signal of a message."""

    def __init__(self, message: Message, length: int, sent: OutputSignal, ours: Numeric | Words | None) -> None:
        s = find_signal(message, sent.name)
        self._field, self._branch = Field(s, length), Branch(message, s, length)
        self._scale, self._offset = float(s.scale) / sent.factor, float(s.offset) / sent.factor
        self._words = _places_of_raw(s, sent, ours.words) if isinstance(ours, Words) else None
        self._nothing = _nothing(s, sent) if isinstance(ours, Numeric) and ours.absent else []
        low, high = s.minimum, s.maximum
        self._low = -math.inf if low is None else float(low) / sent.factor
        self._high = math.inf if high is None else float(high) / sent.factor
        if self._low > self._high:
            self._low, self._high = self._high, self._low

    def read(self, data: NDArray[np.uint8], whole: Mapping[Order, NDArray[np.uint64]]) -> Values:
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

    def _raw(self, data: NDArray[np.uint8], whole: Mapping[Order, NDArray[np.uint64]]) -> NDArray[np.float64]:
        at = self._field.position
        if not whole or self._field.is_float or self._branch.conditions:
            return np.array(list(self._one_by_one(data)), dtype=np.float64)
        raw = (whole[at.order] >> np.uint64(at.shift) & np.uint64(at.mask)).astype(np.float64)
        return raw - 2.0 * at.sign * (raw >= at.sign) if at.sign else raw

    def _one_by_one(self, data: NDArray[np.uint8]) -> Iterator[float]:
        for row in data:
            numbers = FrameNumbers(row.tobytes())
            yield float(self._field.raw(numbers)) if self._branch.carried(numbers) else math.nan


def _places_of_raw(s: Signal, sent: OutputSignal, words: tuple[str, ...]) -> dict[int, int]:
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
    return named or [float(span(s)[1])]


def decoders(config: Config) -> Iterator[MessageDecoder]:
    """A decoder for each message that a daemon of this configuration sends."""
    for kind, number, output in sent_messages(config):
        yield MessageDecoder(find_message(config.database, output.message), output, kind, number)


def sent_messages(config: Config) -> Iterator[tuple[str, int, Output]]:
    """What a daemon sends: the key in the vocabulary, the axle's number (0: its own), the message."""
    for axle in config.axles:
        for kind, output in zip(AXLE_OUTPUTS, axle.sent, strict=True):
            if output is not None:
                yield kind, axle.number, output
    for kind, output in zip(OF_DAEMON, (config.status, config.rejects, config.link), strict=True):
        if output is not None:
            yield kind, 0, output


INPUTS = ("YawRate", "LatAccel", "Torque", "Speed")
# half-widths in percentage points by the place of the word of Confidence: None and Wider have no bound
HALF_WIDTHS_PP = np.array([np.nan, *(w if np.isfinite(w) else np.nan for w, _ in CONFIDENCES)], dtype=np.float32)


class OwnFrames:
    """Decodes the messages that a daemon of a configuration sends. Frames that a receiver would refuse, for their
    length or their CRC, are left out and counted."""

    def __init__(self, config: Config) -> None:
        self.decoders = {(d.kind, d.axle): d for d in decoders(config)}  # axle 0: of the daemon's own
        self.wrong: dict[int, int] = {}  # refused frames by Frame.key, of messages under E2E

    @property
    def keys(self) -> frozenset[int]:
        """Of all of them."""
        return frozenset(d.key for d in self.decoders.values())

    def cycle_us(self, kind: str, axle: int = 0) -> int:
        """How often it is sent; 0: it is not."""
        d = self.decoders.get((kind, axle))
        return 0 if d is None else d.cycle_us

    def _read(self, scan: Scan, kind: str, axle: int) -> tuple[NDArray[np.int64], Mapping[str, Values]] | None:
        d = self.decoders.get((kind, axle))
        if d is None:
            return None
        frames = scan.of(d.key)
        good = good_frames(frames, d.length, d.data_id)
        if d.data_id is not None:
            self.wrong[d.key] = len(frames) - len(good)
        return (good.time_us, d.read(good.data)) if len(good) else None

    def adhesion(self, scan: Scan, axle: int) -> AdhesionRecord | None:
        """Adhesion frames of an axle; None: there is none."""
        read = self._read(scan, "adhesion", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        mu, confidence = _numbers(v, "MuAvailable", n), _places(v, "Confidence", n)
        half = HALF_WIDTHS_PP[confidence.clip(0)]
        return AdhesionRecord(
            time_us, _places(v, "Validity", n), mu, _numbers(v, "MuUsed", n), (mu - half).clip(0), mu + half,
            confidence, _places(v, "ContactState", n), _places(v, "Surface", n), _numbers(v, "SampleAge", n),
        )  # fmt: skip

    def detail(self, scan: Scan, axle: int) -> Detail | None:
        """AdhesionDetail frames."""
        read = self._read(scan, "detail", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        return Detail(
            time_us,
            np.stack([_numbers(v, f"Residual{m}", n) for m in range(1, 5)], axis=1),
            np.nan_to_num(_numbers(v, "WinningModel", n)).astype(np.int8),
            np.nan_to_num(_numbers(v, "DominantRule", n)).astype(np.int16),
            _places(v, "Cause", n),
            np.stack([_numbers(v, f"Stale{name}", n) > 0 for name in INPUTS], axis=1),
        )

    def health(self, scan: Scan, axle: int) -> HealthRecord | None:
        """InputHealth frames."""
        read = self._read(scan, "inputs", axle)
        if read is None:
            return None
        time_us, v = read
        n = len(time_us)
        return HealthRecord(
            time_us,
            np.stack([np.nan_to_num(_numbers(v, f"Reach{name}", n)).astype(np.uint8) for name in INPUTS], axis=1),
            np.stack([_places(v, f"Refused{name}", n) for name in INPUTS], axis=1),
            _places(v, "Plausibility", n),
            _numbers(v, "Outlier", n) > 0,
            _numbers(v, "Unchanged", n) > 0,
        )

    def series(self, scan: Scan, kind: str, axle: int = 0) -> Series | None:
        """A message as numbers; words are their places."""
        read = self._read(scan, kind, axle)
        return None if read is None else Series(read[0], {name: c.astype(np.float64) for name, c in read[1].items()})


def _numbers(values: Mapping[str, Values], name: str, n: int) -> Numbers:
    """A number's column, NaN where the message lacks the signal."""
    return values[name].astype(np.float32) if name in values else np.full(n, np.nan, np.float32)


def _places(values: Mapping[str, Values], name: str, n: int) -> Places:
    """A word's column, -1 where the message lacks the signal."""
    return values[name].astype(np.int8) if name in values else np.full(n, -1, np.int8)
