"""Any DBC to quantities and back. A frame is accepted whole or not at all, and every rejection has its reason.

Where a signal lies in a frame is worked out once; a frame is then one whole number that is shifted and masked. cantools
reads and writes what is not so plain: signals coded as floating-point numbers.
"""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from wrcd.bus.dbc import Database, Message, Signal, data_id, find_message, find_signal
from wrcd.bus.e2e import COUNTER_MODULO, Checker, protect
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Output, OutputSignal, Source
from wrcd.bus.units import Quantity, factor

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# Words of value tables, letters only. A Status that is none of the usable words is refused.
USABLE = {"ok", "okay", "valid", "normal", "good", "noerror", "available", "active"}
# A named value of a measured signal with one of these in its name is no measurement ("Signal_Not_Available").
UNUSABLE = (
    "notavail", "unavail", "sna", "invalid", "notvalid", "error", "fault", "fail", "init", "undefined", "notdefined",
    "nodata", "nosignal", "unknown", "reserved",
)  # fmt: skip
STATUS = "Status"


class Sample(NamedTuple):
    """A value in SI units. Degraded if its sender says so, contested if another seems to send it, too."""

    source: int  # place among the receiver's sources
    value: float
    degraded: bool = False
    contested: bool = False


_new_tuple = tuple.__new__  # half of what a NamedTuple's own constructor takes


class Position(NamedTuple):
    """Where a signal's bits lie: shift and mask of the frame as one whole number, and its sign bit (0: none)."""

    order: Literal["little", "big"]
    shift: int
    mask: int
    sign: int

    def raw(self, frame: int) -> int:
        """The raw value."""
        raw = (frame >> self.shift) & self.mask
        return raw - ((raw & self.sign) << 1)


def position(signal: Signal, length: int) -> Position:
    """Of a signal in a message of so many bytes."""
    mask = (1 << signal.length) - 1
    sign = 1 << signal.length - 1 if signal.is_signed else 0
    if signal.byte_order == "little_endian":
        return Position("little", signal.start, mask, sign)
    first = 8 * (signal.start // 8) + 7 - signal.start % 8  # of its highest bit, counted from the frame's first
    return Position("big", 8 * length - first - signal.length, mask, sign)


def message_key(message: Message) -> int:
    """Identity of a message, as Frame.key."""
    return message.frame_id | EXTENDED if message.is_extended_frame else message.frame_id


def normalise_label(label: object) -> str:
    """A word of a value table as lower-case letters: Not_Available and "not available" are the same."""
    return "".join(c for c in str(label).lower() if c.isalpha())


def unusable(label: object) -> bool:
    """Whether a word of a value table says that there is no measurement."""
    word = normalise_label(label)
    return word == "na" or any(part in word for part in UNUSABLE)


class SignalReader:
    """One mapped signal: its raw value to SI units, or why it can't be."""

    def __init__(self, number: int, source: Source, signal: Signal, length: int) -> None:
        self.number = number
        self.name = signal.name
        self.position = position(signal, length)
        _, self.shift, self.mask, self.sign = self.position
        self._signal = signal
        self.scale = signal.conversion.scale if source.scale is None else source.scale
        self.offset = signal.conversion.offset if source.offset is None else source.offset
        self.factor = factor(signal.unit, source.quantity) if source.factor is None else source.factor
        low = signal.minimum if source.low is None else source.low
        high = signal.maximum if source.high is None else source.high
        slack = 0.5 * abs(float(self.scale))
        self.low = -math.inf if low is None else float(low) - slack
        self.high = math.inf if high is None else float(high) + slack
        self._unusable = {raw for raw, label in (signal.choices or {}).items() if unusable(label)} | source.invalid
        self._limit = source.quantity.limit
        self._positive = source.quantity in (Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS)
        self._is_direction = source.quantity is Quantity.DIRECTION
        # every value within the DBC's range is one: no word of it says otherwise, nor does the quantity's own limit
        within = math.isfinite(self.low) and math.isfinite(self.high)
        within = within and max(abs(self.low), abs(self.high)) * abs(self.factor) <= self._limit
        words = any(self.low <= raw * self.scale + self.offset <= self.high for raw in self._unusable)
        self.is_simple = within and not (words or self._is_direction or self._positive)

    def read(self, raw: Any) -> float | Reason:
        """The value of a raw one."""
        if raw in self._unusable:
            return Reason.STATUS
        physical = float(raw * self.scale + self.offset)
        si = physical * self.factor
        if not (self.low <= physical <= self.high and -self._limit <= si <= self._limit):
            return Reason.RANGE if math.isfinite(si) else Reason.NOT_FINITE
        if self._positive and si <= 0:
            return Reason.RANGE
        return _direction(self._signal, raw, physical) if self._is_direction else si

    def read_column(self, raw: "NDArray[np.int64]") -> list[float] | None:
        """The values of many raw ones, if every one of them has one and none is a direction."""
        if self._is_direction or (self._unusable and not self._unusable.isdisjoint(raw.tolist())):
            return None
        physical = raw * self.scale + self.offset
        si = physical * self.factor
        within = (self.low <= physical) & (physical <= self.high) & (-self._limit <= si) & (si <= self._limit)
        if not within.all() or (self._positive and (si <= 0).any()):
            return None
        values: list[float] = si.tolist()
        return values


class MessageReader:
    """Decodes one message and checks all of it."""

    STATE = {"checker": "checker"}

    def __init__(
        self, message: Message, sources: Sequence[tuple[int, Source]], identity: int | None, others: Sequence[int]
    ) -> None:
        self._message = message
        self.length, self.extended = message.length, message.is_extended_frame
        self.sources = tuple(s for _, s in sources)
        self.numbers = tuple(k for k, _ in sources)
        self.name = message.name
        self.signals = [SignalReader(k, s, find_signal(message, s.signal), message.length) for k, s in sources]
        self.checker = None if identity is None else Checker(identity, tuple(i for i in others if i != identity))
        status = next((s for s in message.signals if s.name == STATUS), None)
        # without a value table only 0 is taken for good
        words = {} if status is None else self._labels(status) or {0: "ok"}
        self.usable_words = {raw for raw, word in words.items() if word in USABLE}
        self.degraded_words = {raw for raw, word in words.items() if word == "degraded"}
        self.status = None if status is None else position(status, message.length)
        self._status_shift, self._status_mask = (0, 0) if self.status is None else self.status[1:3]
        used = [find_signal(message, s.signal) for s in self.sources] + ([status] if status is not None else [])
        self._by_cantools = any(s.is_float for s in used)
        orders = {r.position.order for r in self.signals} | ({self.status.order} if self.status else set())
        self.order: Literal["little", "big"] | None = orders.pop() if len(orders) == 1 else None

    @property
    def is_plain(self) -> bool:
        """Whether all that is read of it lies in one whole number."""
        return self.order is not None and not self._by_cantools and self.length <= 8

    @staticmethod
    def _labels(signal: Signal | None) -> dict[int, str]:
        choices = signal.choices if signal is not None else None
        return {int(raw): normalise_label(label) for raw, label in (choices or {}).items()}

    def reset(self) -> None:
        """Take the next counter as it comes."""
        if self.checker is not None:
            self.checker.reset()

    def read(self, frame: Frame) -> list[Sample] | Reason:
        """The samples of a frame, or why it is refused."""
        if frame.remote or frame.error or frame.fd or frame.extended != self.extended:
            return Reason.KIND
        data = frame.data
        if len(data) != self.length:
            return Reason.LENGTH
        checker = self.checker
        if checker is not None and (reason := checker.check(data)):
            return reason
        if self.order is None or self._by_cantools:
            return self._read_mixed(data)
        number = int.from_bytes(data, self.order)
        degraded = False
        if self.status is not None:
            status = number >> self._status_shift & self._status_mask
            if status not in self.usable_words:
                if status not in self.degraded_words:
                    return Reason.STATUS
                degraded = True
        contested = checker is not None and checker.suspect
        samples = []
        for signal in self.signals:
            raw = number >> signal.shift & signal.mask
            if raw & signal.sign:
                raw -= signal.sign << 1
            physical = raw * signal.scale + signal.offset
            if signal.is_simple and signal.low <= physical <= signal.high:
                value: float | Reason = float(physical) * signal.factor
            else:
                value = signal.read(raw)
                if value.__class__ is not float:
                    assert isinstance(value, Reason)
                    return value
            samples.append(_new_tuple(Sample, (signal.number, value, degraded, contested)))
        return samples

    def _read_mixed(self, data: bytes) -> list[Sample] | Reason:
        """The same of a message with both byte orders, or with signals coded as floating-point numbers."""
        raw: Any = self._message.decode(data, decode_choices=False, scaling=False)
        degraded = False
        if self.status is not None and (status := int(raw[STATUS])) not in self.usable_words:
            if status not in self.degraded_words:
                return Reason.STATUS
            degraded = True
        contested = self.checker is not None and self.checker.suspect
        samples = []
        for signal in self.signals:
            value = signal.read(raw[signal.name])
            if isinstance(value, Reason):
                return value
            samples.append(Sample(signal.number, value, degraded, contested))
        return samples


class Receiver:
    """All mapped messages by their identity. data_ids: of E2E, by message (None: not protected); default: the DBC's."""

    STATE = {"readers": "readers"}

    def __init__(
        self, database: Database, sources: Sequence[Source], data_ids: Mapping[str, int | None] | None = None
    ) -> None:
        by_message: dict[str, list[tuple[int, Source]]] = {}
        for number, s in enumerate(sources):
            by_message.setdefault(s.message, []).append((number, s))
        self.readers: dict[int, MessageReader] = {}
        messages = {name: find_message(database, name) for name in by_message}
        known = {name: data_id(m) for name, m in messages.items()} if data_ids is None else data_ids
        every = [i for name in messages if (i := known[name]) is not None]
        for name, group in by_message.items():
            self.readers[message_key(messages[name])] = MessageReader(messages[name], group, known[name], every)

    @property
    def keys(self) -> tuple[int, ...]:
        """The identities of all mapped messages (Frame.key)."""
        return tuple(sorted(self.readers))

    def reset(self) -> None:
        """After a step of time or a long silence: take every counter as it comes."""
        for reader in self.readers.values():
            reader.reset()

    def reader(self, frame: Frame) -> MessageReader | None:
        """The reader of a frame's message, None if it is not mapped. An error frame's class looks like an id, and never
        is."""
        return None if frame.error else self.readers.get(frame.can_id | EXTENDED if frame.extended else frame.can_id)

    def read(self, frame: Frame) -> list[Sample] | Reason | None:
        """Samples, the reason of a rejection, or None for a frame that is not mapped."""
        reader = self.reader(frame)
        return None if reader is None else reader.read(frame)


Value = float | str | None  # a number in the signal's own unit, a label of its value table, or not available


class SignalWriter:
    """One signal that is sent: a value to its raw one, in its place in the frame."""

    def __init__(self, s: Signal, length: int, sent: OutputSignal) -> None:
        labels = {str(label): int(raw) for raw, label in (s.choices or {}).items()}
        self.labels = labels if sent.words is None else sent.words
        usual = labels.get("NotAvailable", _all_ones(s))
        self._not_available = usual if sent.not_available is None else sent.not_available
        self._factor, self._round = sent.factor, math.floor if sent.round_down else round
        self._low = -math.inf if s.minimum is None else float(s.minimum)
        self._high = math.inf if s.maximum is None else float(s.maximum)
        self._scale, self._offset = float(s.scale), float(s.offset)
        self._lowest, self._highest = (
            (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.is_signed else (0, (1 << s.length) - 1)
        )
        # whichever byte order, the frame is one whole number with its first byte lowest or highest
        self.order, self.shift, self.mask, _ = position(s, length)
        self.others = ~(self.mask << self.shift)
        self.words: dict[Value, int] = {word: (raw & self.mask) << self.shift for word, raw in self.labels.items()}

    def raw(self, value: Value) -> int:
        """A label's raw value, a number's nearest within the signal's range, or not available."""
        if isinstance(value, str):
            return self.labels.get(value, 0)
        if value is None or not math.isfinite(value):
            return self._not_available
        value *= self._factor
        if value < self._low:
            value = self._low
        elif value > self._high:
            value = self._high
        raw = self._round((value - self._offset) / self._scale)
        return self._lowest if raw < self._lowest else min(raw, self._highest)


class Writer:
    """Encodes one outgoing message. Without an Output its signals have our names, and the DBC says the rest."""

    TRANSIENT = ("_start",)

    def __init__(self, message: Message, output: Output | None = None) -> None:
        self._message = message
        self._data_id = data_id(message) if output is None else output.data_id
        self._rest = {s.name: int(s.raw_initial or 0) for s in message.signals}
        sent = {s.name: OutputSignal(s.name) for s in message.signals} if output is None else output.signals
        self._writers = {
            name: SignalWriter(find_signal(message, s.name), message.length, s) for name, s in sent.items()
        }
        self._names = {name: s.name for name, s in sent.items()}
        orders = {position(s, message.length).order for s in message.signals}
        plain = len(orders) == 1 and not any(s.is_float for s in message.signals)
        self._order: Literal["little", "big"] | None = orders.pop() if plain else None
        self._start: int | None = None  # what the frame is before the values are put in; made when it is first needed
        self.can_id = message.frame_id

    def frame(self, stamp_us: int, slot: int, values: Mapping[str, Value]) -> Frame:
        """The frame of a slot. Values of signals that the message lacks are left out."""
        if self._order is None:
            raw = dict(self._rest)
            for name, writer in self._writers.items():
                if name in values:
                    raw[self._names[name]] = writer.raw(values[name])
            data = self._message.encode(raw, scaling=False, strict=False)
        else:
            if self._start is None:
                self._start = int.from_bytes(self._message.encode(self._rest, scaling=False, strict=False), self._order)
            number = self._start
            for name, value in values.items():
                found = self._writers.get(name)
                if found is not None:
                    bits = found.words.get(value) if value.__class__ is str else None
                    if bits is None:
                        bits = (found.raw(value) & found.mask) << found.shift
                    number = number & found.others | bits
            data = number.to_bytes(self._message.length, self._order)
        if self._data_id is not None:
            data = protect(data, self._data_id, slot % COUNTER_MODULO)
        return Frame(stamp_us, self.can_id, data, extended=self._message.is_extended_frame)


def _direction(s: Signal, raw: Any, physical: float) -> float:
    """-1 in reverse, else 1: by the name in the value table, or by the sign where there is none."""
    label = str(s.choices[raw]).lower() if s.choices and raw in s.choices else ""
    return -1.0 if any(word in label for word in ("rev", "back")) or (not label and physical < 0) else 1.0


def _all_ones(s: Signal) -> int:
    """What "not available" is where the DBC gives it no name: all bits set (the most positive of a signed field)."""
    return (1 << (s.length - (1 if s.is_signed else 0))) - 1
