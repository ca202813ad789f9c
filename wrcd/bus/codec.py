"""Any DBC to quantities and back. A frame is accepted whole or not at all, and every rejection has its reason."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from wrcd.bus.dbc import Database, Message, Signal, data_id, find_message, find_signal
from wrcd.bus.e2e import COUNTER_MODULO, Checker, protect
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity, factor

# Words of value tables, letters only. A Status that is none of the usable words is refused.
USABLE = {"ok", "okay", "valid", "normal", "good", "noerror", "available", "active"}
# A named value of a measured signal with one of these in its name is no measurement ("Signal_Not_Available").
UNUSABLE = (
    "notavail", "unavail", "sna", "invalid", "notvalid", "error", "fault", "fail", "init", "undefined", "notdefined",
    "nodata", "nosignal", "unknown", "reserved",
)  # fmt: skip
STATUS = "Status"


@dataclass(frozen=True, slots=True)
class Source:
    """Which signal carries a quantity, of which axles (places 0 … n-1, all of them for the vehicle's own)."""

    message: str
    signal: str
    quantity: Quantity
    axles: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Sample:
    """A value in SI units, for each of the axles. Degraded if its sender says so, contested if another seems to send
    it, too."""

    quantity: Quantity
    axles: tuple[int, ...]
    value: float
    degraded: bool
    contested: bool = False


def plain(label: object) -> str:
    """A word of a value table as lower-case letters: Not_Available and "not available" are the same."""
    return "".join(c for c in str(label).lower() if c.isalpha())


def unusable(label: object) -> bool:
    """Whether a word of a value table says that there is no measurement."""
    word = plain(label)
    return word == "na" or any(part in word for part in UNUSABLE)


class SignalReader:
    """One mapped signal: its raw value to SI units, or why it can't be."""

    def __init__(self, source: Source, signal: Signal) -> None:
        self.source = source
        self.name = signal.name
        self._signal = signal
        self._factor = factor(signal.unit, source.quantity)
        slack = 0.5 * abs(float(signal.scale))
        self._low = -math.inf if signal.minimum is None else float(signal.minimum) - slack
        self._high = math.inf if signal.maximum is None else float(signal.maximum) + slack
        self._unusable = {raw for raw, label in (signal.choices or {}).items() if unusable(label)}
        self._positive = source.quantity in (Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS)

    def read(self, raw: Any) -> float | Reason:
        """The value of a raw one."""
        if raw in self._unusable:
            return Reason.STATUS
        scaled: Any = self._signal.conversion.raw_to_scaled(raw, decode_choices=False)
        physical = float(scaled)
        si = physical * self._factor
        if not math.isfinite(si):
            return Reason.NOT_FINITE
        if not self._low <= physical <= self._high or abs(si) > self.source.quantity.limit:
            return Reason.RANGE
        if self._positive and si <= 0:
            return Reason.RANGE
        return _direction(self._signal, raw, physical) if self.source.quantity is Quantity.DIRECTION else si


class MessageReader:
    """Decodes one message and checks all of it."""

    STATE = ("_checker",)

    def __init__(self, message: Message, sources: Sequence[Source], others: Sequence[int]) -> None:
        self._message = message
        self.sources = tuple(sources)
        self._signals = [SignalReader(s, find_signal(message, s.signal)) for s in sources]
        identity = data_id(message)
        self._checker = None if identity is None else Checker(identity, tuple(i for i in others if i != identity))
        status = next((s for s in message.signals if s.name == STATUS), None)
        # without a value table only 0 is taken for good
        self._status = {} if status is None else self._labels(status) or {0: "ok"}

    @staticmethod
    def _labels(signal: Signal | None) -> dict[int, str]:
        choices = signal.choices if signal is not None else None
        return {int(raw): plain(label) for raw, label in (choices or {}).items()}

    def reset(self) -> None:
        """Take the next counter as it comes."""
        if self._checker is not None:
            self._checker.reset()

    def read(self, frame: Frame) -> list[Sample] | Reason:
        """The samples of a frame, or why it is refused."""
        m = self._message
        if not frame.plain or frame.extended != m.is_extended_frame:
            return Reason.KIND
        if len(frame.data) != m.length:
            return Reason.LENGTH
        if self._checker is not None and (reason := self._checker.check(frame.data)):
            return reason
        raw: Any = m.decode(frame.data, decode_choices=False, scaling=False)
        status = self._status.get(int(raw[STATUS]), "error") if self._status else "ok"
        if status not in USABLE and status != "degraded":
            return Reason.STATUS
        degraded, contested = status == "degraded", self._checker is not None and self._checker.suspect
        samples = []
        for signal in self._signals:
            value = signal.read(raw[signal.name])
            if isinstance(value, Reason):
                return value
            samples.append(Sample(signal.source.quantity, signal.source.axles, value, degraded, contested))
        return samples


class Receiver:
    """All mapped messages by id."""

    STATE = ("_readers",)

    def __init__(self, database: Database, sources: Sequence[Source]) -> None:
        by_message: dict[str, list[Source]] = {}
        for s in sources:
            by_message.setdefault(s.message, []).append(s)
        self._readers: dict[int, MessageReader] = {}
        messages = {name: find_message(database, name) for name in by_message}
        ids = [i for m in messages.values() if (i := data_id(m)) is not None]
        for name, group in by_message.items():
            self._readers[messages[name].frame_id] = MessageReader(messages[name], group, ids)

    @property
    def ids(self) -> tuple[int, ...]:
        """The ids of all mapped messages."""
        return tuple(sorted(self._readers))

    def sources(self, can_id: int) -> tuple[Source, ...]:
        """What a mapped message carries."""
        return self._readers[can_id].sources

    def reset(self) -> None:
        """After a step of time or a long silence: take every counter as it comes."""
        for reader in self._readers.values():
            reader.reset()

    def maps(self, frame: Frame) -> bool:
        """Whether a frame is of a mapped message. An error frame's class looks like an id, and never is."""
        return not frame.error and frame.can_id in self._readers

    def read(self, frame: Frame) -> list[Sample] | Reason | None:
        """Samples, the reason of a refusal, or None for a frame that is not mapped."""
        return self._readers[frame.can_id].read(frame) if self.maps(frame) else None


Value = float | str | None  # a number in the signal's own unit, a label of its value table, or not available


class Writer:
    """Encodes one outgoing message, whatever its DBC calls not available, and protects it where the DBC says so."""

    def __init__(self, message: Message, needed: Sequence[str]) -> None:
        for name in needed:
            find_signal(message, name)
        self._message = message
        self._data_id = data_id(message)
        self._labels = {
            s.name: {str(label): int(raw) for raw, label in (s.choices or {}).items()} for s in message.signals
        }
        self._rest = {s.name: int(s.raw_initial or 0) for s in message.signals}
        self.can_id = message.frame_id

    def frame(self, stamp_us: int, slot: int, values: Mapping[str, Value]) -> Frame:
        """The frame of a slot. Values of signals that the message lacks are left out."""
        raw = dict(self._rest)
        for s in self._message.signals:
            if s.name in values:
                raw[s.name] = self._raw(s, values[s.name])
        data = self._message.encode(raw, scaling=False, strict=False)
        if self._data_id is not None:
            data = protect(data, self._data_id, slot % COUNTER_MODULO)
        return Frame(stamp_us, self.can_id, data, extended=self._message.is_extended_frame)

    def _raw(self, s: Signal, value: Value) -> int:
        labels = self._labels[s.name]
        if isinstance(value, str):
            return labels.get(value, 0)
        if value is None or not math.isfinite(value):
            return labels.get("NotAvailable", _all_ones(s))
        if s.minimum is not None:
            value = max(value, float(s.minimum))
        if s.maximum is not None:
            value = min(value, float(s.maximum))
        lowest, highest = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.is_signed else (0, (1 << s.length) - 1)
        return min(max(round((value - float(s.offset)) / float(s.scale)), lowest), highest)


def _direction(s: Signal, raw: Any, physical: float) -> float:
    """-1 in reverse, else 1: by the name in the value table, or by the sign where there is none."""
    label = str(s.choices[raw]).lower() if s.choices and raw in s.choices else ""
    return -1.0 if any(word in label for word in ("rev", "back")) or (not label and physical < 0) else 1.0


def _all_ones(s: Signal) -> int:
    """What "not available" is where the DBC gives it no name: all bits set (the most positive of a signed field)."""
    return (1 << (s.length - (1 if s.is_signed else 0))) - 1
