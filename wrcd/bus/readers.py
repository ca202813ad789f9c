"""Frames to samples: the reader of one mapped signal, and of one message."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import Message, Signal, find_signal
from wrcd.bus.e2e import Checker
from wrcd.bus.frame import Frame
from wrcd.bus.positions import Branch, Field, Numbers, Order, common_order, fit_raw, frame_length, is_fd, span
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.statuses import KeptStatus, SenderStatus
from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import is_reverse, no_measurement

MAX_BITS = 52  # of a raw value that a float holds exactly, whatever its scale does
FLOAT_STEP = 1e-6  # of an end: what a number of 32 bits may miss of it
MAX_COMBINED = 64  # sets of good statuses of a message that are recognised at one look
OF_WHOLE_FRAME = frozenset(
    {Reason.KIND, Reason.LENGTH, Reason.CRC, Reason.DATA_ID, Reason.REPEAT, Reason.COUNTER, Reason.TWO_SENDERS}
)


class Sample(NamedTuple):
    """A value in SI units. Degraded if its sender says so, contested if another seems to send it, too."""

    source: int  # place among the receiver's sources
    value: float
    degraded: bool = False
    contested: bool = False


_new_tuple = tuple.__new__  # half of what a NamedTuple's own constructor takes


class SignalReader:
    """One mapped signal: its raw value to SI units, or why it can't be."""

    def __init__(self, number: int, source: Source, message: Message) -> None:
        signal, length = find_signal(message, source.signal), frame_length(message)
        self.number = number
        self.field = Field(signal, length)
        self.branch = Branch(message, signal, length)
        self.position = self.field.position
        _, self.shift, self.mask, self.sign = self.position
        self.scale = signal.conversion.scale if source.scale is None else source.scale
        self.offset = signal.conversion.offset if source.offset is None else source.offset
        self.factor = factor(signal.unit, source.quantity) if source.factor is None else source.factor
        low = signal.minimum if source.low is None else source.low
        high = signal.maximum if source.high is None else source.high
        step = 0.0 if signal.is_float else 0.5 * abs(float(self.scale))
        self.low, self.high = (
            toward if x is None else float(x) + math.copysign(step or FLOAT_STEP * abs(float(x)), toward)
            for x, toward in ((low, -math.inf), (high, math.inf))
        )
        # by what a frame gives: many a value table has the bit patterns of negative values
        self._choices = {fit_raw(signal, int(raw)): label for raw, label in (signal.choices or {}).items()}
        self.unusable = {raw for raw, label in self._choices.items() if no_measurement(label)}
        self.unusable |= {fit_raw(signal, raw) for raw in source.invalid}
        self.ends = (-math.inf, math.inf) if source.quantity is Quantity.DIRECTION else self._ends(signal, low, high)
        self._limit = source.quantity.limit
        self._positive = source.quantity in (Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS)
        self._is_direction, self._reverse = source.quantity is Quantity.DIRECTION, source.reverse
        # every value within the DBC's range is one: no word of it says otherwise, nor does the quantity's own limit
        within = math.isfinite(self.low) and math.isfinite(self.high)
        within = within and max(abs(self.low), abs(self.high)) * abs(self.factor) <= self._limit
        words = any(self.low <= raw * self.scale + self.offset <= self.high for raw in self.unusable)
        self.is_simple = within and not (words or self._is_direction or self._positive)

    def _ends(self, signal: Signal, low: Any, high: Any) -> tuple[float, float]:
        """The SI values from which on one stands at the lower or the upper end of the range, and the truth may lie
        beyond; infinite where there is no end.

        The range is low to high (physical; None: open), or what the field can hold where that is less, words that are
        no measurement aside. An end takes half a step. 0 is none: a train that stands is there.
        """
        first = -math.inf if low is None else float(low)
        last = math.inf if high is None else float(high)
        within_first, within_last = (abs(x) * FLOAT_STEP if math.isfinite(x) else 0.0 for x in (first, last))
        if not signal.is_float:
            lowest, highest = span(signal)
            while lowest in self.unusable:
                lowest += 1
            while highest in self.unusable:
                highest -= 1
            field = sorted(float(raw * self.scale + self.offset) for raw in (lowest, highest))
            first, last = max(first, field[0]), min(last, field[1])
            within_first = within_last = 0.5 * abs(float(self.scale))
        lower, upper = sorted(((first + within_first) * self.factor, (last - within_last) * self.factor))
        return lower if lower < 0.0 else -math.inf, upper if upper > 0.0 else math.inf

    def read(self, raw: Any) -> float | Reason:
        """The value of a raw one."""
        if raw in self.unusable:
            return Reason.STATUS
        physical = float(raw * self.scale + self.offset)
        si = physical * self.factor
        if not (self.low <= physical <= self.high and -self._limit <= si <= self._limit):
            return Reason.RANGE if math.isfinite(si) else Reason.NOT_FINITE
        if self._positive and si <= 0:
            return Reason.RANGE
        return self._direction(raw, physical) if self._is_direction else si

    def _direction(self, raw: Any, physical: float) -> float:
        """-1 in reverse, else 1: by the name in the value table, or by the sign where there is none. A factor below 0
        turns it."""
        choices = self._choices
        if self._reverse is not None:
            reverse = raw in self._reverse
        else:
            reverse = is_reverse(choices[raw]) if raw in choices else physical < 0
        return -1.0 if reverse is (self.factor > 0) else 1.0

    def read_column(self, whole: NDArray[np.uint64]) -> NDArray[np.float64]:
        """The values in plain frames as whole numbers, (n,); NaN where read gives a reason."""
        raw = (whole >> np.uint64(self.shift) & np.uint64(self.mask)).astype(np.int64)
        if self.mask.bit_length() > MAX_BITS or self._is_direction:
            ones = (number >> self.shift & self.mask for number in whole.tolist())
            values = (self.read(one - (one & self.sign) * 2) for one in ones)
            return np.array([v if isinstance(v, float) else np.nan for v in values], dtype=np.float64)
        if self.sign:
            raw -= (raw & self.sign) << 1
        physical = raw * self.scale + self.offset
        si = physical * self.factor
        good = (self.low <= physical) & (physical <= self.high) & (-self._limit <= si) & (si <= self._limit)
        if self._positive:
            good &= si > 0
        if self.unusable:
            good &= ~np.isin(raw, list(self.unusable))
        return np.where(good, si, np.nan)


class MessageReader:
    """Decodes one message and checks all of it.

    Most messages are plain: all that is read lies in one whole number, in every frame. Others go a slower way: with
    multiplexers, both byte orders, floating-point numbers, or statuses that come in other frames.
    """

    checker: Checker | None

    def __init__(
        self,
        message: Message,
        sources: Sequence[tuple[int, Source]],
        identity: int | None,
        others: Sequence[int],
        kept: Mapping[StatusRule, KeptStatus],
    ) -> None:
        """kept: the statuses that come in other frames, by their rule; those of this message get its frames."""
        self.length, self.fd = frame_length(message), is_fd(message)
        self.numbers = tuple(k for k, _ in sources)
        self.name = message.name
        self.signals = [SignalReader(k, s, message) for k, s in sources]
        self.data_id = identity
        self.checker = None if identity is None else Checker(identity, tuple(i for i in others if i != identity))
        self._tells = tuple(status for status in kept.values() if status.rule.message == message.name)
        made: dict[StatusRule, SenderStatus] = {
            r: kept.get(r) or SenderStatus(message, r) for _, s in sources for r in s.statuses
        }
        self._rules = [[made[r] for r in s.statuses] for _, s in sources]
        self.statuses = tuple(made.values())
        self.is_multiplexed = any(s.branch.conditions for s in self.signals)
        fields = [s.field for s in self.signals] + [s.field for s in self.statuses]
        odd = self._tells or self.is_multiplexed or any(f.is_float for f in fields)
        odd = odd or any(isinstance(s, KeptStatus) for s in self.statuses)
        # the byte order of a plain message; None: not plain
        self.order: Order | None = None if odd else common_order([f.position for f in fields])
        self.good_statuses = self._status_bits, self._all_ok = self._combined()

    def _combined(self) -> tuple[int, frozenset[int]]:
        """The bits of all statuses of a plain message, and what they are where each is good. Where there are too many
        of these, or two statuses share bits, none: each is looked at then."""
        bits = [s.bits for s in self.statuses]
        ways = math.prod(len(s.ok) for s in self.statuses)
        if self.order is None or ways > MAX_COMBINED or _overlap(bits):
            return 0, frozenset()
        sets = [[word << s.shift for word in s.ok] for s in self.statuses]
        return sum(bits), frozenset(map(sum, itertools.product(*sets)))

    def reset(self) -> None:
        """Take the next counter as it comes."""
        if self.checker is not None:
            self.checker.reset()

    def read(self, frame: Frame) -> list[Sample] | Reason:
        """The samples of a frame, or why it is refused. A frame of a multiplexed message may carry nothing."""
        if frame.remote or frame.error or frame.fd != self.fd:
            return Reason.KIND
        data = frame.data
        if len(data) != self.length:
            return Reason.LENGTH
        checker = self.checker
        if checker is not None and (reason := checker.check(data, frame.stamp_us)):
            if reason is Reason.TWO_SENDERS:
                for status in self._tells:
                    status.forget()
            return reason
        if self.order is None:
            return self._read_odd(data, frame.stamp_us)
        number = int.from_bytes(data, self.order)
        degraded = False
        if number & self._status_bits not in self._all_ok:
            verdict = self.judge(number)
            if verdict is None:
                return Reason.STATUS
            degraded = verdict
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

    def read_columns(self, data: NDArray[np.uint8]) -> tuple[list[NDArray[np.float64]], NDArray[np.bool_]]:
        """Values of each signal in frames of a plain message, data (n, its length or more), and which frames call
        themselves degraded. NaN where a frame is to be refused for its statuses or the value; E2E is not looked at."""
        assert self.order is not None
        whole = whole_numbers(data, self.length, self.order)
        usable, degraded = np.ones(len(data), dtype=bool), np.zeros(len(data), dtype=bool)
        for status in self.statuses:
            words = whole >> np.uint64(status.shift) & np.uint64(status.field.position.mask)
            ok, less = (np.isin(words, np.array(sorted(x), dtype=np.uint64)) for x in (status.ok, status.degraded))
            usable &= ok | less
            degraded |= ~ok
        return [np.where(usable, s.read_column(whole), np.nan) for s in self.signals], degraded

    def judge(self, number: int) -> bool | None:
        """Of a plain frame as a whole number: whether its sender calls itself degraded; None: not to be believed."""
        verdicts = [s.verdict((number & s.bits) >> s.shift) for s in self.statuses]
        return None if None in verdicts else True in verdicts

    def _read_odd(self, data: bytes, stamp_us: int) -> list[Sample] | Reason:
        """The same of a message that is not plain."""
        numbers = Numbers(data)
        for status in self._tells:
            status.take(numbers, stamp_us)
        carried = [(s, rules) for s, rules in zip(self.signals, self._rules, strict=True) if s.branch.carried(numbers)]
        verdicts = [
            status.judge(numbers, stamp_us) for status in dict.fromkeys(r for _, rules in carried for r in rules)
        ]
        if None in verdicts:
            return Reason.STATUS
        degraded, contested = True in verdicts, self.checker is not None and self.checker.suspect
        samples = []
        for signal, _ in carried:
            value = signal.read(signal.field.raw(numbers))
            if isinstance(value, Reason):
                return value
            samples.append(Sample(signal.number, value, degraded, contested))
        return samples

    def concerned(self, frame: Frame, reason: Reason) -> Sequence[int]:
        """Of which sources a rejected frame is: those that it carries, all where even that is not known."""
        if not self.is_multiplexed or reason in OF_WHOLE_FRAME:
            return self.numbers
        numbers = Numbers(frame.data)
        return [s.number for s in self.signals if s.branch.carried(numbers)]


def whole_numbers(data: NDArray[np.uint8], length: int, order: Order) -> NDArray[np.uint64]:
    """Frames of up to eight bytes, data (n, length or more), as whole numbers, (n,)."""
    padded = np.zeros((len(data), 8), dtype=np.uint8)
    first = 0 if order == "little" else 8 - length
    padded[:, first : first + length] = data[:, :length]
    return padded.view("<u8" if order == "little" else ">u8")[:, 0].astype(np.uint64)


def _overlap(bits: Sequence[int]) -> bool:
    union = 0
    for of_one in bits:
        if union & of_one:
            return True
        union |= of_one
    return False
