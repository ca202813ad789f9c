"""What is mapped of a DBC: where each signal, status and multiplexer lies, and how its raw value becomes a quantity.

Made once, from the DBC and what the configuration says over it; the core's tables are filled from it.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.dbc import DEFAULT_TIMEOUT_MS, Database, Message, Signal, data_id, find_message, find_signal, timeout_ms
from wrcd.bus.frame import GROUP, mask_of
from wrcd.bus.positions import Branch, Field, fit_raw, frame_length, is_fd, message_key, span
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import is_reverse, no_measurement

STATUS = "Status"
FLOAT_STEP = 1e-6  # of an end: what a number of 32 bits may miss of it


class MappedSignal:
    """One signal of a mapped message: its raw value to SI units. number: its place among the sources."""

    def __init__(self, number: int, source: Source, message: Message) -> None:
        signal, length = find_signal(message, source.signal), frame_length(message)
        self.number, self.source = number, source
        self.field = Field(signal, length)
        self.branch = Branch(message, signal, length)
        self.scale = float(signal.conversion.scale if source.scale is None else source.scale)
        self.offset = float(signal.conversion.offset if source.offset is None else source.offset)
        self.factor = factor(signal.unit, source.quantity) if source.factor is None else source.factor
        low = signal.minimum if source.low is None else source.low
        high = signal.maximum if source.high is None else source.high
        step = 0.0 if signal.is_float else 0.5 * abs(self.scale)
        self.low, self.high = (
            toward if x is None else float(x) + math.copysign(step or FLOAT_STEP * abs(float(x)), toward)
            for x, toward in ((low, -math.inf), (high, math.inf))
        )
        # by what a frame gives: many a value table has the bit patterns of negative values
        choices = {fit_raw(signal, int(raw)): label for raw, label in (signal.choices or {}).items()}
        choices = {raw: label for raw, label in choices.items() if self.field.holds(raw)}
        self.unusable = {raw for raw, label in choices.items() if no_measurement(label)}
        self.unusable |= {raw for given in source.invalid if self.field.holds(raw := fit_raw(signal, given))}
        # of a direction: which raw values are reverse; of others the sign says so, unless the configuration names all
        self.only_words = source.reverse is not None
        self.words: Mapping[int, bool] = {}
        if source.quantity is Quantity.DIRECTION:
            self.words = {raw: is_reverse(label) for raw, label in choices.items()}
            self.words = self.words if source.reverse is None else dict.fromkeys(source.reverse, True)
        self.ends = (-math.inf, math.inf) if source.quantity is Quantity.DIRECTION else self._ends(signal, low, high)

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
            within_first = within_last = 0.5 * abs(self.scale)
        lower, upper = sorted(((first + within_first) * self.factor, (last - within_last) * self.factor))
        return lower if lower < 0.0 else -math.inf, upper if upper > 0.0 else math.inf


class MappedStatus:
    """What a sender says of itself. A kept one comes in other frames than what it is about: the newest counts until it
    is too old."""

    def __init__(self, message: Message, rule: StatusRule, is_kept: bool = False) -> None:
        signal, length = find_signal(message, rule.signal), frame_length(message)
        self.rule, self.is_kept = rule, is_kept
        self.field, self.branch = Field(signal, length), Branch(message, signal, length)
        self.ok, self.degraded = self._bits(rule.ok), self._bits(rule.degraded)
        stated_ms = timeout_ms(message, signal) if is_kept else 0
        self.timeout_us = rule.timeout_us or 1000 * (stated_ms or DEFAULT_TIMEOUT_MS)

    def _bits(self, raws: frozenset[int]) -> frozenset[int]:
        """Raw values as they lie in a frame: those of a signed signal without their sign."""
        return raws if self.field.is_float else frozenset(raw & self.field.position.mask for raw in raws)


class MappedMessage:
    """A message that carries inputs, or a status of others. identity: of E2E, None: not protected; others: those of
    other mapped messages."""

    def __init__(
        self, message: Message, sources: Sequence[tuple[int, Source]], identity: int | None, others: Sequence[int]
    ) -> None:
        self.name, self.key = message.name, message_key(message)
        self.wanted = self.key | GROUP * any(s.pgn for _, s in sources)
        self.length, self.fd = frame_length(message), is_fd(message)
        self.data_id, self.others = identity, tuple(i for i in others if i != identity)
        self.signals = [MappedSignal(k, s, message) for k, s in sources]
        self.is_multiplexed = any(s.branch.conditions for s in self.signals)


class Mapped:
    """All mapped messages, sorted by key, and the statuses of their signals, by rule.

    data_ids: of E2E, by message (None: not protected); of a message that is not among them, the DBC's.
    """

    def __init__(
        self, database: Database, sources: Sequence[Source], data_ids: Mapping[str, int | None] | None = None
    ) -> None:
        by_message: dict[str, list[tuple[int, Source]]] = {}
        for number, s in enumerate(sources):
            by_message.setdefault(s.message, []).append((number, s))
        self.statuses = dict(self._statuses(database, sources))
        for status in self.statuses.values():
            by_message.setdefault(status.rule.message, [])
        messages = {name: find_message(database, name) for name in by_message}
        given = {} if data_ids is None else data_ids
        known = {name: given[name] if name in given else data_id(m) for name, m in messages.items()}
        every = [i for i in known.values() if i is not None]
        found = (MappedMessage(messages[name], group, known[name], every) for name, group in by_message.items())
        self.messages = sorted(found, key=lambda m: m.key)

    @staticmethod
    def _statuses(database: Database, sources: Sequence[Source]) -> Iterator[tuple[StatusRule, MappedStatus]]:
        """Kept for one message, a status is for all."""
        of = [(rule, s.message) for s in sources for rule in s.statuses]
        kept = {rule for rule, message in of if comes_in_other_frames(database, rule, message)}
        for rule in dict.fromkeys(rule for rule, _ in of):
            yield rule, MappedStatus(find_message(database, rule.message), rule, rule in kept)

    @property
    def keys(self) -> tuple[int, ...]:
        """The identities of all messages (Frame.key), with GROUP where they are groups."""
        return tuple(m.wanted for m in self.messages)

    def named(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Frames' keys, those of a group as its message's own."""
        for m in self.messages:
            if m.wanted & GROUP:
                keys = np.where((keys ^ m.key) & mask_of(m.wanted), keys, m.key)
        return keys

    @property
    def fd(self) -> bool:
        """Whether any of them is CAN FD."""
        return any(m.fd for m in self.messages)

    @property
    def signals(self) -> list[MappedSignal]:
        """Of all messages, one message behind the other: the order of the core's inputs."""
        return [s for m in self.messages for s in m.signals]


def comes_in_other_frames(database: Database, rule: StatusRule, message: str) -> bool:
    """Whether a status may come in other frames of a message, or of another one, than what it is about."""
    return rule.message != message or bool(MappedStatus(find_message(database, rule.message), rule).branch.conditions)
