"""What a receiver must know of a configuration's Adhesion messages, as whole numbers: no floating point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

from wrcd.bus.dbc import Message, Signal, find_message, find_signal, shortest_timeout_us
from wrcd.bus.positions import fit_raw, frame_length, is_fd, span
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.configuration import Config
from wrcd.errors import InputError

# Our words of each signal, the most cautious first: where several share a raw value, the first of them is what it says.
VALIDITY = ("Error", "NotAvailable", "Degraded", "Valid")
CONFIDENCE = ("None", "Wider", "Within12pp", "Within8pp", "Within5pp", "Within3pp", "Within2pp", "Within1pp")
SURFACE = ("Unknown", "VeryLow", "Low", "Reduced", "Wet", "Dry")
CONTACT = ("Unknown", "Saturated", "Adhering")
# What a step of a number is, how it is rounded, and up to what it is one.
CENTIPERCENT, MS = 100, 1
DOWN, UP = Fraction(0), Fraction(1)
MAX_PCT, MAX_MS = 100, 65_534
SLACK = Fraction(1, 1_000_000)  # of a raw value: what is lost in the conversion of a range
MAX_BITS = 32  # of a signal; a weight and an offset below these bounds then overflow no 64 bits
MAX_WEIGHT, MAX_DIVISOR, MAX_OFFSET = 1 << 30, 1 << 60, 1 << 61


class Weights(NamedTuple):
    """(raw * weight + offset) / divisor, rounded towards zero."""

    weight: int
    offset: int
    divisor: int


@dataclass(frozen=True, slots=True)
class NumberSignal:
    """A signal whose raw values from lowest to highest, but none, are a number in 0.01 % or ms."""

    signal: Signal
    sent: OutputSignal
    lowest: int
    highest: int
    none: tuple[int, ...]
    weights: Weights
    per_raw: Fraction  # exactly, in that unit
    at_zero: Fraction


@dataclass(frozen=True, slots=True)
class WordSignal:
    """A signal with our word of each raw value."""

    signal: Signal
    by_raw: dict[int, str]


@dataclass(frozen=True, slots=True)
class KitMessage:
    """An axle's Adhesion; fields: its signals by our names."""

    axle: int
    message: Message
    output: Output
    length: int
    is_fd: bool
    timeout_us: int
    fields: dict[str, NumberSignal | WordSignal]

    @property
    def name(self) -> str:
        """Its name in the DBC."""
        return self.message.name


def messages(config: Config) -> tuple[KitMessage, ...]:
    """Return every axle's Adhesion message. Raises InputError for one that has no receiver."""
    outputs = [(a.adhesion, a.number) for a in config.axles]
    return tuple(kit_message(find_message(config.database, o.message), o, n, config.file) for o, n in outputs)


def kit_message(message: Message, output: Output, axle: int, file: str) -> KitMessage:
    """Return one of them."""
    fields: dict[str, NumberSignal | WordSignal] = {}
    numbers = {
        "MuAvailable": (CENTIPERCENT, DOWN, MAX_PCT), "MuUsed": (CENTIPERCENT, DOWN, MAX_PCT),
        "SampleAge": (MS, UP, MAX_MS),
    }  # fmt: skip
    words = {"Validity": VALIDITY, "Confidence": CONFIDENCE, "Surface": SURFACE, "ContactState": CONTACT}
    for ours in ("Validity", "MuAvailable", "Confidence", "MuUsed", "SampleAge", "Surface", "ContactState"):
        if ours not in output.signals:
            continue
        sent = output.signals[ours]
        signal = find_signal(message, sent.name)
        if signal.length > MAX_BITS or signal.is_float:
            raise InputError(
                f"{message.name}.{signal.name} has {signal.length} bits, or is a float",
                file=file,
                hint=f"the receiver reads whole numbers of at most {MAX_BITS} bits",
            )
        fields[ours] = _words(signal, sent, words[ours]) if ours in words else _number(signal, sent, *numbers[ours])
    signals = [find_signal(message, sent.name) for sent in output.signals.values()]
    try:
        timeout_us = shortest_timeout_us(message, signals, output.cycle_us)
    except ValueError as e:
        raise InputError(str(e), file=file, hint="mend the DBC") from None
    if timeout_us <= output.cycle_us:
        raise InputError(
            f"the time-out of {message.name}, {timeout_us / 1000:g} ms, is not longer than its cycle of "
            f"{output.cycle_us / 1000:g} ms: every second frame would come too late",
            file=file,
            hint="mend GenSigTimeoutTime in the DBC, or give a shorter cycle_ms",
        )
    return KitMessage(axle, message, output, frame_length(message), is_fd(message), timeout_us, fields)


def _number(s: Signal, sent: OutputSignal, step: int, rounding: Fraction, most: int) -> NumberSignal:
    # our unit's weight in the signal's: 1, 100 or 1000, or one by that
    factor = Fraction(sent.factor).limit_denominator(1_000_000)
    scale, offset = exact(s.scale), exact(s.offset)
    per_raw, at_zero = scale / factor * step, offset / factor * step
    low, high = s.minimum if sent.low is None else sent.low, s.maximum if sent.high is None else sent.high
    # values that are below 0 or beyond the most are none that anybody sends
    bottom = max(Fraction(0), Fraction(0) if low is None else exact(low) / factor)
    top = min(Fraction(most), Fraction(most) if high is None else exact(high) / factor)
    first, last = span(s)
    lowest = max(first, math.ceil((bottom * factor - offset) / scale - SLACK))
    highest = min(last, math.floor((top * factor - offset) / scale + SLACK))
    named = {int(raw) for raw in s.choices or {}}
    if sent.not_available is not None:
        named.add(fit_raw(s, sent.not_available))
    none = tuple(sorted(raw for raw in named if lowest <= raw <= highest))
    up = per_raw.denominator * at_zero.denominator
    added = rounding - Fraction(1, up) if rounding == UP else rounding
    return NumberSignal(s, sent, lowest, highest, none, weights(per_raw, at_zero, added), per_raw, at_zero)


def _words(s: Signal, sent: OutputSignal, order: Sequence[str]) -> WordSignal:
    known = {str(label): int(raw) for raw, label in (s.choices or {}).items()} if sent.words is None else sent.words
    raws = {word: fit_raw(s, known[word]) for word in reversed(order) if word in known}
    return WordSignal(s, dict(sorted({raw: word for word, raw in raws.items()}.items())))


def exact(number: float) -> Fraction:
    """Return the number that a DBC's text says: 0.01 is a hundredth."""
    return Fraction(Decimal(str(number)))


def weights(scale: Fraction, offset: Fraction, rounding: Fraction) -> Weights:
    """Return whole numbers for raw * scale + offset + rounding; scale is positive.

    Exact where they fit. Else the divisor is a power of two, and the result at most 0.001 too small.
    """
    added = offset + rounding
    divisor = math.lcm(scale.denominator, added.denominator)
    fits = scale * divisor < MAX_WEIGHT and abs(math.floor(added * divisor)) < MAX_OFFSET and divisor < MAX_DIVISOR
    if not fits:
        bits = 0
        while scale * (2 << bits) < MAX_WEIGHT and abs(offset) * (2 << bits) < MAX_OFFSET and bits < MAX_BITS + 10:
            bits += 1
        divisor = 1 << bits
    return Weights(math.floor(scale * divisor), math.floor(added * divisor), divisor)
