"""Values to frames: what is sent, in the words and units of its DBC."""

import math
from collections.abc import Mapping

from wrcd.bus.dbc import Message, Signal, data_id, find_signal
from wrcd.bus.e2e import COUNTER_MODULO, protect
from wrcd.bus.frame import Frame
from wrcd.bus.positions import fit_raw, frame_length, is_fd, position, span
from wrcd.bus.signals import Output, OutputSignal

Value = float | str | None  # a number in our own unit, a word of ours, or not available
NOT_AVAILABLE = "NotAvailable"


class SignalWriter:
    """One signal that is sent: a value to its raw one, in its place in the frame."""

    def __init__(self, s: Signal, length: int, sent: OutputSignal) -> None:
        labels = {str(label): int(raw) for raw, label in (s.choices or {}).items()}
        self.labels: Mapping[str, int] = labels if sent.words is None else sent.words
        self._lowest, self._highest = span(s)
        low, high = s.minimum if sent.low is None else sent.low, s.maximum if sent.high is None else sent.high
        self._low = -math.inf if low is None else float(low)
        self._high = math.inf if high is None else float(high)
        self._scale, self._offset = float(s.scale), float(s.offset)
        self._factor = sent.factor
        self.rounds_down = sent.round_down
        # a raw value that is rounded down is a smaller number, where the scale turns the sign a greater one
        down = -1 if self._scale * self._factor > 0 else 1
        self.rounds = down if sent.round_down else 0
        self._round = (round, math.ceil, math.floor)[self.rounds]
        self._not_available = self._raw_of_not_available(s, labels, sent)
        self.order, self.shift, self.mask, _ = position(s, length)

    @property
    def numbers(self) -> tuple[float, float, float, float, float]:
        """Of a number: factor, lowest and highest, then scale and offset of its raw value."""
        return self._factor, self._low, self._high, self._scale, self._offset

    @property
    def raws(self) -> tuple[int, int, int]:
        """The lowest and the highest raw value of a number, and that of none."""
        return self._lowest, self._highest, self._not_available

    def _raw_of_not_available(self, s: Signal, labels: Mapping[str, int], sent: OutputSignal) -> int:
        """What says so; a number is kept off it."""
        named = sent.not_available
        if named is None:
            named = self.labels.get(NOT_AVAILABLE, labels.get(NOT_AVAILABLE))
        if named is None:  # all bits set (the most positive of a signed field): a number may be there, too
            return self._highest
        named = fit_raw(s, named)
        if named == self._highest:
            self._highest -= 1
        elif named == self._lowest:
            self._lowest += 1
        return named

    def raw(self, value: Value) -> int:
        """A word's raw value, a number's nearest within the signal's range, or not available, which a word that the
        signal lacks is, too."""
        if isinstance(value, str):
            return self.labels.get(value, self._not_available)
        if value is None or not math.isfinite(value):
            return self._not_available
        value *= self._factor
        if value < self._low:
            if self.rounds_down and self._low > 0:  # the least that can be sent would be more than it is
                return self._not_available
            value = self._low
        elif value > self._high:
            value = self._high
        raw = self._round((value - self._offset) / self._scale)
        return self._lowest if raw < self._lowest else min(raw, self._highest)


class Writer:
    """Encodes one outgoing message. Without an Output its signals have our names, and the DBC says the rest."""

    def __init__(self, message: Message, output: Output | None = None) -> None:
        self._message = message
        self.data_id = data_id(message) if output is None else output.data_id
        self.length, self.fd = frame_length(message), is_fd(message)
        self._rest = {s.name: int(s.raw_initial or 0) for s in message.signals}
        sent = {s.name: OutputSignal(s.name) for s in message.signals} if output is None else output.signals
        self.writers = {name: SignalWriter(find_signal(message, s.name), self.length, s) for name, s in sent.items()}
        self._names = {name: s.name for name, s in sent.items()}
        self.can_id, self.extended = message.frame_id, message.is_extended_frame

    @property
    def start(self) -> bytes:
        """What the frame is before the values are put in."""
        return self._encoded({})

    def frame(self, stamp_us: int, slot: int, values: Mapping[str, Value]) -> Frame:
        """The frame of a slot. Values of signals that the message lacks are left out."""
        raw = {self._names[name]: w.raw(values[name]) for name, w in self.writers.items() if name in values}
        return self.raw_frame(stamp_us, slot, raw)

    def raw_frame(self, stamp_us: int, slot: int, raw: Mapping[str, float]) -> Frame:
        """The same of raw values by the DBC's names; multiplexers among them say which signals the frame carries."""
        data = self._encoded(raw)
        if self.data_id is not None:
            data = protect(data, self.data_id, slot % COUNTER_MODULO)
        return Frame(stamp_us, self.can_id, data, extended=self.extended, fd=self.fd)

    def _encoded(self, raw: Mapping[str, float]) -> bytes:
        """Raw values, and the DBC's start values of all other signals, by cantools."""
        data = self._message.encode({**self._rest, **raw}, scaling=False, strict=False)
        return data.ljust(self.length, b"\0")
