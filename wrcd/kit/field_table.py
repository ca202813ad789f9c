"""fields.md: what is where in each Adhesion message, and what to do with it."""

from collections.abc import Iterator, Sequence
from decimal import Context, Decimal
from fractions import Fraction

from wrcd.bus.dbc import Signal
from wrcd.bus.frame import id_text
from wrcd.bus.positions import message_key
from wrcd.kit.receiver import CONFIDENCE, KitMessage, NumberSignal, WordSignal, exact
from wrcd.kit.vectors import FOLLOWS_FROM_PP, HALF_WIDTHS_PP

# Of what is read: the unit that is written, and its weight in the receiver's.
UNITS = {"MuAvailable": ("%", 100), "MuUsed": ("%", 100), "SampleAge": ("ms", 1)}
DIGITS = 40
WITHOUT = {
    "SampleAge": "step 7 is left out: nobody says how old the inputs are",
    "Confidence": "no interval: `limit` is always `ADHESION_LIMIT_NONE`, and nothing may be limited",
}


def fields(messages: Sequence[KitMessage]) -> str:
    """A table of the message and one of its signals, for each message."""
    return "\n".join(line for m in messages for line in _message(m))


def warnings(messages: Sequence[KitMessage]) -> list[str]:
    """What a receiver of these messages cannot do, a line each."""
    found = []
    for m in messages:
        if m.output.data_id is None:
            found.append(
                f"{m.name} has no E2E: flipped bits, repeats and a second sender are not found. Without "
                "`accept_unprotected` in the settings it is never used."
            )
        found += [f"{m.name} has no {name}: {WITHOUT[name]}." for name in WITHOUT if name not in m.fields]
    return found


def _message(m: KitMessage) -> Iterator[str]:
    kind = ("CAN FD, " if m.is_fd else "") + f"{29 if m.message.is_extended_frame else 11} bits"
    yield f"## {m.name}: axle {m.axle}\n"
    yield "| id | kind | bytes | cycle | time-out | E2E data id |"
    yield "|---|---|---|---|---|---|"
    data_id = "none: not protected" if m.output.data_id is None else f"0x{m.output.data_id:04X}"
    times = f"{_number(Fraction(m.output.cycle_us, 1000))} ms | {_number(Fraction(m.timeout_us, 1000))} ms"
    yield f"| {id_text(message_key(m.message))} | {kind} | {m.length} | {times} | {data_id} |"
    yield ""
    yield "| signal | is | start, bits | byte order | sign | scale, offset | numbers | raw values |"
    yield "|---|---|---|---|---|---|---|---|"
    if m.output.data_id is not None:
        yield "| – | Crc | 0, 8 | – | unsigned | 1, 0 | 0 … 255 | |"
        yield "| – | Counter | 8, 4 | – | unsigned | 1, 0 | 0 … 14 | |"
    for ours, one in m.fields.items():
        yield _field(ours, one)
    yield ""


def _field(ours: str, one: NumberSignal | WordSignal) -> str:
    s = one.signal
    numbers, raws = ("", _words(one)) if isinstance(one, WordSignal) else (_range(ours, one), _none(one))
    order = "Intel" if s.byte_order == "little_endian" else "Motorola"
    sign = "signed" if s.is_signed else "unsigned"
    scale = f"{_number(exact(s.scale))}, {_number(exact(s.offset))}"
    return f"| {s.name} | {ours} | {s.start}, {s.length} | {order} | {sign} | {scale} | {numbers} | {raws} |"


def _words(w: WordSignal) -> str:
    labels = _labels(w.signal)
    theirs = {raw: f" (“{label}”)" for raw, label in labels.items() if label != w.by_raw.get(raw)}
    return ", ".join(f"{raw} {word}{theirs.get(raw, '')}" for raw, word in w.by_raw.items()) + "; any other: fall back"


def _range(ours: str, n: NumberSignal) -> str:
    unit, step = UNITS[ours]
    low, high = ((n.per_raw * raw + n.at_zero) / step for raw in (n.lowest, n.highest))
    return f"{_number(low)} … {_number(high)} {unit} (raw {n.lowest} … {n.highest})"


def _none(n: NumberSignal) -> str:
    labels = _labels(n.signal)
    if n.sent.not_available is not None:
        labels.setdefault(n.sent.not_available, "not available")
    named = ", ".join(f"{raw} {label}" for raw, label in sorted(labels.items()))
    return f"{named}; beyond the range: none" if named else "beyond the range: none"


def _labels(signal: Signal) -> dict[int, str]:
    """The DBC's words, as a table's cell can hold them."""
    return {int(raw): str(label).replace("|", "\\|") for raw, label in (signal.choices or {}).items()}


def _number(value: Fraction) -> str:
    """All its digits; DIGITS of them where it has no end."""
    digits = Context(prec=DIGITS)
    return f"{digits.divide(Decimal(value.numerator), Decimal(value.denominator)).normalize(digits):f}"


def levels() -> str:
    """The rows of Confidence's levels, the widest first."""
    rows = []
    for word in CONFIDENCE[2:]:
        width = HALF_WIDTHS_PP[word]
        limit = "FOLLOW`" if width <= FOLLOWS_FROM_PP else "ABOVE`: only a demand above it"
        rows.append(f"| {word} | {width} | `ADHESION_LIMIT_{limit} | MuAvailable less {width}, at least 0 |")
    return "\n".join(rows)
