"""What a train's own adhesion message says, read by its own names: the demo's view, by cantools alone."""

import math
from typing import Any

from cantools.database.can import Message, Signal

from wrcd.bus.dbc import find_signal
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.vocabulary import MESSAGES, Numeric

Said = dict[str, float | str | None]  # by the daemon's own names; a number in its unit, a word of its own, or nothing


class AdhesionReader:
    """Reads frames of an output."""

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

    def read(self, data: bytes) -> Said:
        """What a frame says, of the signals that are mapped."""
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
