"""What the receiver must know of each Adhesion message of a configuration, as whole numbers."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from wrcd.bus.dbc import Message, Signal, find_message, find_signal, timeout_ms
from wrcd.bus.positions import fit_raw, frame_length, is_fd
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.tools.kit.weights import MAX_BITS, Weights, exact, weights

# Our words of each signal, the most cautious first: where several share a raw value, the first of them is what it says.
VALIDITY = ("Error", "NotAvailable", "Degraded", "Valid")
CONFIDENCE = ("None", "Wider", "Within12pp", "Within8pp", "Within5pp", "Within3pp", "Within2pp", "Within1pp")
SURFACE = ("Unknown", "VeryLow", "Low", "Reduced", "Wet", "Dry")
CONTACT = ("Unknown", "Saturated", "Adhering")
# What a step of a number is, how it is rounded, and up to what it is one.
CENTIPERCENT, MS = 100, 1
DOWN, NEAREST, UP = Fraction(0), Fraction(1, 2), Fraction(1)
MAX_PCT, MAX_MS = 100, 65_534
SLACK = Fraction(1, 1_000_000)  # of a raw value: what is lost in the conversion of a range


@dataclass(frozen=True, slots=True)
class Field:
    """The bits of a signal. first: as adhesion.c counts them; a Motorola signal's from its highest on."""

    signal: Signal
    first: int

    @property
    def motorola(self) -> bool:
        """Whether its highest bit comes first."""
        return self.signal.byte_order != "little_endian"


@dataclass(frozen=True, slots=True)
class Number:
    """Raw values from lowest to highest, but none, are a number in 0.01 % or ms."""

    field: Field
    sent: OutputSignal
    lowest: int
    highest: int
    none: tuple[int, ...]
    weights: Weights
    per_raw: Fraction  # exactly, in 0.01 % or ms
    at_zero: Fraction


@dataclass(frozen=True, slots=True)
class Words:
    """Our word of each raw value."""

    field: Field
    by_raw: dict[int, str]


@dataclass(frozen=True, slots=True)
class KitMessage:
    """An axle's Adhesion. None: it has no such signal."""

    axle: int
    message: Message
    output: Output
    length: int
    is_fd: bool
    timeout_us: int
    validity: Words
    mu_available: Number
    mu_used: Number | None
    sample_age: Number | None
    surface: Words | None
    contact: Words | None
    confidence: Words | None

    @property
    def name(self) -> str:
        """Its name in the DBC."""
        return self.message.name

    @property
    def id_text(self) -> str:
        """Its id in hexadecimal; an extended one has eight digits."""
        return f"0x{self.message.frame_id:08X}" if self.message.is_extended_frame else f"0x{self.message.frame_id:03X}"

    @property
    def fields(self) -> list[tuple[str, Number | Words]]:
        """Its signals by our names."""
        every: list[tuple[str, Number | Words | None]] = [
            ("Validity", self.validity), ("MuAvailable", self.mu_available), ("Confidence", self.confidence),
            ("MuUsed", self.mu_used), ("SampleAge", self.sample_age), ("Surface", self.surface),
            ("ContactState", self.contact),
        ]  # fmt: skip
        return [(ours, one) for ours, one in every if one is not None]


def messages(config: Config) -> tuple[KitMessage, ...]:
    """Every axle's Adhesion message. Raises InputError for one that no receiver can be made for."""
    return tuple(
        kit_message(find_message(config.database, a.adhesion.message), a.adhesion, a.number, config.file)
        for a in config.axles
    )


def kit_message(message: Message, output: Output, axle: int, file: str) -> KitMessage:
    """One of them."""
    length, sent = frame_length(message), output.signals

    def number(ours: str, step: int, rounding: Fraction, most: int) -> Number | None:
        return _number(message, sent[ours], step, rounding, most, file) if ours in sent else None

    def words(ours: str, order: Sequence[str]) -> Words | None:
        return _words(message, sent[ours], order, file) if ours in sent else None

    validity, mu_available = words("Validity", VALIDITY), number("MuAvailable", CENTIPERCENT, DOWN, MAX_PCT)
    assert validity is not None, "the configuration refuses a message without it"
    assert mu_available is not None, "likewise"
    return KitMessage(
        axle,
        message,
        output,
        length,
        is_fd(message),
        _timeout_us(message, output, file),
        validity,
        mu_available,
        number("MuUsed", CENTIPERCENT, NEAREST, MAX_PCT),
        number("SampleAge", MS, UP, MAX_MS),
        words("Surface", SURFACE),
        words("ContactState", CONTACT),
        words("Confidence", CONFIDENCE),
    )


def _timeout_us(message: Message, output: Output, file: str) -> int:
    """The shortest time-out that the DBC states of a mapped signal, else three cycles."""
    stated = []
    for sent in output.signals.values():
        signal = find_signal(message, sent.name)
        try:
            ms = timeout_ms(message, signal) if _states_timeout(signal) else None
        except ValueError as e:
            raise InputError(str(e), file=file, hint="mend the DBC") from None
        stated += [] if ms is None else [1000 * ms]
    found = min(stated, default=3 * output.cycle_us)
    if found <= output.cycle_us:
        raise InputError(
            f"the time-out of {message.name}, {found / 1000:g} ms, is not longer than its cycle of "
            f"{output.cycle_us / 1000:g} ms: every second frame would come too late",
            file=file,
            hint="mend GenSigTimeoutTime in the DBC, or give a shorter cycle_ms",
        )
    return found


def _states_timeout(signal: Signal) -> bool:
    attributes = signal.dbc.attributes if signal.dbc is not None else {}
    return "GenSigTimeoutTime" in attributes and bool(attributes["GenSigTimeoutTime"].value)


def _field(message: Message, sent: OutputSignal, file: str) -> Field:
    signal = find_signal(message, sent.name)
    if signal.length > MAX_BITS or signal.is_float:
        raise InputError(
            f"{message.name}.{signal.name} has {signal.length} bits, or is a float",
            file=file,
            hint=f"the receiver reads whole numbers of at most {MAX_BITS} bits",
        )
    motorola = signal.byte_order != "little_endian"
    return Field(signal, 8 * (signal.start // 8) + 7 - signal.start % 8 if motorola else signal.start)


def _number(message: Message, sent: OutputSignal, step: int, rounding: Fraction, most: int, file: str) -> Number:
    field = _field(message, sent, file)
    s = field.signal
    # our unit's weight in the signal's: 1, 100 or 1000, or one by that
    factor = Fraction(sent.factor).limit_denominator(1_000_000)
    scale, offset = exact(s.scale), exact(s.offset)
    per_raw, at_zero = scale / factor * step, offset / factor * step
    low, high = s.minimum if sent.low is None else sent.low, s.maximum if sent.high is None else sent.high
    lowest, highest = _span(s)
    # values that are below 0 or beyond the most are none that anybody sends
    bottom = max(Fraction(0), *([] if low is None else [exact(low) / factor]), Fraction(0))
    top = min(Fraction(most), *([] if high is None else [exact(high) / factor]), Fraction(most))
    lowest = max(lowest, math.ceil((bottom * factor - offset) / scale - SLACK))
    highest = min(highest, math.floor((top * factor - offset) / scale + SLACK))
    named = {int(raw) for raw in s.choices or {}}
    if sent.not_available is not None:
        named.add(fit_raw(s, sent.not_available))
    none = tuple(sorted(raw for raw in named if lowest <= raw <= highest))
    up = per_raw.denominator * at_zero.denominator
    added = rounding - Fraction(1, up) if rounding == UP else rounding
    return Number(field, sent, lowest, highest, none, weights(per_raw, at_zero, added), per_raw, at_zero)


def _words(message: Message, sent: OutputSignal, order: Sequence[str], file: str) -> Words:
    field = _field(message, sent, file)
    labels = {str(label): int(raw) for raw, label in (field.signal.choices or {}).items()}
    known = labels if sent.words is None else sent.words
    raws = {word: fit_raw(field.signal, known[word]) for word in reversed(order) if word in known}
    return Words(field, dict(sorted({raw: word for word, raw in raws.items()}.items())))


def _span(s: Signal) -> tuple[int, int]:
    bits = s.length - s.is_signed
    return (-(1 << bits) if s.is_signed else 0), (1 << bits) - 1
