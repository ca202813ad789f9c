"""A train's messages: who encodes them, which of them carry what a fault is of, and how its adhesion is read."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sim_ecu.play.encoder import Encoder, data_id, databases, message_key
from sim_ecu.play.faults import message_of
from sim_ecu.play.mapped_message import FAILED, says
from sim_ecu.play.scenario import Scenario
from wrcd.bus.dbc import Message, Signal, find_signal
from wrcd.bus.signals import Output, OutputSignal
from wrcd.config.config import load_packaged
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.vocabulary import MESSAGES, Numeric

USABLE_STATUS, PACKAGED_ERROR = frozenset({0, 1}), 14  # of the packaged DBC: Ok, Degraded; Error


@dataclass(frozen=True, slots=True)
class Carrier:
    """A message that carries what a fault is of.

    not_available: by signal, the raw value that says so, None where it has none. status: the signal that says how its
    sender is, and the raw values of it that are usable.
    """

    message: Message
    data_id: int | None
    not_available: Mapping[str, float | None]
    status: Signal | None = None
    usable: frozenset[int] = frozenset()

    @property
    def key(self) -> int:
        """The identity of its frames."""
        return message_key(self.message)

    @property
    def failed(self) -> int | None:
        """A status that says so, or one that is not usable. None: all that the field holds are."""
        if self.status is None:
            return None
        named = {int(raw): label for raw, label in (self.status.choices or {}).items() if raw not in self.usable}
        failed = sorted(raw for raw, label in named.items() if says(label, FAILED)) or sorted(named)
        if not failed and self.status.length > 3 and PACKAGED_ERROR not in self.usable:
            return PACKAGED_ERROR
        free = failed or [raw for raw in range(min(1 << self.status.length, 256)) if raw not in self.usable]
        return next(iter(free), None)


class PackagedTrain:
    """The train of the packaged DBC."""

    has_fd = False  # whether any of its messages is a CAN FD one
    idle_id = 0x000  # the standard id of the highest priority that no message has

    def encoder(self, numbers: Sequence[int], truth: bool = True, counter: int = 0) -> Encoder:
        """Of so many axles. Their E2E counters begin at `counter`."""
        return Encoder(list(numbers), truth, counter)

    def carriers(self, signals: Sequence[str], axle: int) -> list[Carrier]:
        """The messages that carry signals of an axle, one for each."""
        return [_packaged(_message(signal, axle)) for signal in signals]

    def statuses(self, signals: Sequence[str], axle: int) -> list[Carrier]:
        """Return the messages with the status of these signals' senders: the same."""
        return self.carriers(signals, axle)

    def cycle_us(self, signal: str, axle: int) -> int:
        """Return the cycle of a signal of an axle."""
        return 1000 * int(_message(signal, axle).cycle_time or 0)


PACKAGED = PackagedTrain()


def _message(signal: str, axle: int) -> Message:
    production, _ = databases()
    return production.get_message_by_name(message_of(signal, axle))


@functools.cache
def _packaged(message: Message) -> Carrier:
    (signal,) = (s for s in message.signals if s.name not in ("Crc", "Counter", "Status"))
    status = message.get_signal_by_name("Status")
    return Carrier(message, data_id(message), {signal.name: end_of_field(signal)}, status, USABLE_STATUS)


def end_of_field(s: Signal) -> int:
    """What stands for not available where nothing else is given: the lowest value of a signed field, all ones of an
    unsigned one."""
    return -(1 << s.length - 1) if s.is_signed else (1 << s.length) - 1


# By the daemon's own names: a number in its unit, a word of its own, or nothing.
MessageValues = dict[str, float | str | None]


class AdhesionReader:
    """Reads frames of an axle's Adhesion."""

    def __init__(self, message: Message, output: Output) -> None:
        self._message = message
        self._numbers: dict[str, tuple[Signal, OutputSignal]] = {}
        self._words: dict[str, tuple[str, dict[int, str]]] = {}
        for ours, sent in output.signals.items():
            signal = find_signal(message, sent.name)
            if isinstance(MESSAGES["adhesion"].get(ours), Numeric):
                self._numbers[ours] = (signal, sent)
            else:
                labels = {str(label): int(raw) for raw, label in (signal.choices or {}).items()}
                words = labels if sent.words is None else sent.words
                self._words[ours] = (signal.name, {raw: word for word, raw in words.items()})

    def read(self, data: bytes) -> MessageValues:
        """Return a frame's values of the mapped signals."""
        raw: Any = self._message.decode(data, decode_choices=False, scaling=False)
        numbers = {ours: _number(signal, sent, raw[signal.name]) for ours, (signal, sent) in self._numbers.items()}
        return numbers | {ours: words.get(raw[name], str(raw[name])) for ours, (name, words) in self._words.items()}


def _number(s: Signal, sent: OutputSignal, raw: int) -> float | None:
    """The value in the daemon's unit; None where the raw value says that there is none, or no signal can mean it."""
    physical = raw * float(s.scale) + float(s.offset)
    low = -math.inf if s.minimum is None else float(s.minimum)
    high = math.inf if s.maximum is None else float(s.maximum)
    named = raw in (s.choices or {})
    return None if raw == sent.not_available or named or not low <= physical <= high else physical / sent.factor


def placed(config: Config, played: Scenario) -> Config:
    """The packaged configuration, with its axles where a scenario has them, if these are on one rail and track."""
    first = played.axles[0]
    is_one = all(a.track_seed == first.track_seed and np.array_equal(a.rail, first.rail) for a in played.axles)
    if len(played.axles) == 1 or first.track_seed is None or not is_one:
        return config
    at = {a.number: a.position_m for a in played.axles}
    axles = _placed_axles(tuple(at.get(n) for n in range(1, max(a.number for a in config.axles) + 1)))
    return replace(config, axles=tuple(axles[a.number - 1] for a in config.axles), fuses=True)


@functools.lru_cache(16)
def _placed_axles(positions_m: tuple[float | None, ...]) -> tuple[AxleConfig, ...]:
    """Of the packaged configuration, in the order of their numbers."""
    return tuple(sorted(load_packaged(len(positions_m), positions_m=positions_m).axles, key=lambda a: a.number))
