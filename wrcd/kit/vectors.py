"""Known-good frames with what a receiver must make of each, worked out here and not by the receiver's own tables."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from wrcd.bus.e2e import COUNTER_MODULO
from wrcd.bus.positions import span
from wrcd.bus.writers import Value, Writer
from wrcd.core.vocabulary import CONFIDENCES
from wrcd.kit.c_tables import SAYS, byte_list, flag
from wrcd.kit.receiver import KitMessage, NumberSignal, WordSignal, exact

NO_VALUE = "ADHESION_NO_VALUE"
HALF_WIDTHS_PP = {word: int(most) for most, word in reversed(CONFIDENCES) if word != "Wider"}  # the widest first
FOLLOWS_FROM_PP = 5
MAX_SAMPLE_AGE_MS, TOO_OLD_MS = 60, 255
MAX_PCT = 100
VALID: dict[str, Value] = {
    "Validity": "Valid", "MuAvailable": 23.45, "MuUsed": 6.78, "SampleAge": 5.0, "Surface": "Wet",
    "ContactState": "Adhering", "Confidence": "Within3pp",
}  # fmt: skip


def _with(ours: str, *values: Value) -> list[tuple[str, dict[str, Value]]]:
    """A vector for each value of one signal."""
    return [(f"{ours} {value}", {ours: value}) for value in values]


# What each vector has otherwise.
SAID: tuple[tuple[str, dict[str, Value]], ...] = (
    ("Valid", {}),
    *_with("Confidence", "Wider", *HALF_WIDTHS_PP, "None"),
    *_with("Surface", "Unknown", "Dry", "Reduced", "Low", "VeryLow"),
    *_with("ContactState", "Unknown", "Saturated"),
    ("Degraded", {"Validity": "Degraded", "Confidence": "None"}),
    ("NotAvailable", {"Validity": "NotAvailable", "MuAvailable": None, "SampleAge": 255.0, "Surface": "Unknown"}),
    ("Error", {"Validity": "Error"}),
    *_with("MuAvailable", None, 0.0, 2.0, 12.34, 50.0, 100.0),
    *_with("MuUsed", None, 0.0, 50.0),
    *_with("SampleAge", 0.0, 60.0, 80.0, 255.0),
)


@dataclass(frozen=True, slots=True)
class Vector:
    """A frame, and what it says by our names: a number in the receiver's unit, a word, or None."""

    what: str
    data: bytes
    says: Mapping[str, int | str | None]


def vectors(m: KitMessage) -> list[Vector]:
    """Frames of all words and of edges of the numbers, as wrcd sends them."""
    writer = Writer(m.message, m.output)
    found = []
    for slot, (what, other) in enumerate(SAID):
        values = VALID | other
        if "Error" in values.values() and "Error" not in (m.output.signals["Validity"].words or {}):
            continue
        frame = writer.frame(0, slot, {ours: values[ours] for ours in m.output.signals})
        found.append(Vector(what, frame.data, raw_values(m, frame.data)))
    valid: Any = m.message.decode(turn(m)[0], decode_choices=False, scaling=False)
    for ours, one in m.fields.items():
        for raw in _edges(one) if isinstance(one, NumberSignal) else ():
            data = writer.raw_frame(0, len(found), {**valid, one.signal.name: raw}).data
            found.append(Vector(f"{ours} raw {raw}", data, raw_values(m, data)))
    return found


def _edges(n: NumberSignal) -> list[int]:
    """Raw values at the ends of what is a number, beyond them, and within them those that have a word."""
    first, last = span(n.signal)
    edges = (first, n.lowest - 1, n.lowest, *n.none, n.highest, n.highest + 1, last)
    return sorted({raw for raw in edges if first <= raw <= last})


def turn(m: KitMessage) -> list[bytes]:
    """A Valid frame with each counter."""
    writer = Writer(m.message, m.output)
    values = {ours: VALID[ours] for ours in m.output.signals}
    return [writer.frame(0, slot, values).data for slot in range(COUNTER_MODULO)]


def raw_values(m: KitMessage, data: bytes) -> dict[str, int | str | None]:
    """What a frame says, by cantools."""
    raws = m.message.decode(data, decode_choices=False, scaling=False)
    assert isinstance(raws, dict)
    out: dict[str, int | str | None] = {}
    for ours, one in m.fields.items():
        raw = raws[one.signal.name]
        assert isinstance(raw, int)
        out[ours] = one.by_raw.get(raw) if isinstance(one, WordSignal) else _number(ours, one, raw)
    return out


def _number(ours: str, n: NumberSignal, raw: int) -> int | None:
    s, factor = n.signal, Fraction(n.sent.factor).limit_denominator(1_000_000)
    low, high = s.minimum if n.sent.low is None else n.sent.low, s.maximum if n.sent.high is None else n.sent.high
    physical = exact(s.scale) * raw + exact(s.offset)
    value = physical / factor
    beyond = (low is not None and physical < exact(low)) or (high is not None and physical > exact(high))
    if raw == n.sent.not_available or raw in (s.choices or {}) or beyond or value < 0:
        return None
    if ours == "SampleAge":
        return min(math.ceil(value), TOO_OLD_MS)
    if value > MAX_PCT:
        return None
    return math.floor(100 * value)


def expected(m: KitMessage, says: Mapping[str, int | str | None]) -> dict[str, str]:
    """What adhesion_poll must give of a fresh frame, with the default settings but for a message without E2E."""
    mu, age, level = says["MuAvailable"], says.get("SampleAge"), says.get("Confidence")
    reason = _reason(m, says)
    out = {
        "state": "ADHESION_FALL_BACK" if reason else "ADHESION_FRESH_VALID", "reason": reason or "ADHESION_NO_REASON",
        "limit": "ADHESION_LIMIT_NONE", "mu_available": NO_VALUE, "half_width": NO_VALUE, "lower_end": NO_VALUE,
        "mu_used": _or_none(says.get("MuUsed")), "mu_shown": _or_none(mu), "sample_age_ms": _or_none(age),
        "surface": "ADHESION_SURFACE_UNKNOWN", "contact": "ADHESION_CONTACT_UNKNOWN",
    }  # fmt: skip
    if reason:
        return out
    assert isinstance(mu, int)
    out["mu_available"] = f"{mu}U"
    width = HALF_WIDTHS_PP.get(str(level))
    if width is not None:
        out["half_width"], out["lower_end"] = f"{100 * width}U", f"{max(mu - 100 * width, 0)}U"
        out["limit"] = f"ADHESION_LIMIT_{'FOLLOW' if width <= FOLLOWS_FROM_PP else 'ABOVE'}"
    for key, ours in (("surface", "Surface"), ("contact", "ContactState")):
        if ours in says:
            out[key] = SAYS[ours][str(says[ours])]
    return out


def _reason(m: KitMessage, says: Mapping[str, int | str | None]) -> str | None:
    """Return why it is a fall-back, None if it is none."""
    validity, age = says["Validity"], says.get("SampleAge")
    if validity != "Valid":
        return {"Degraded": "ADHESION_DEGRADED", "NotAvailable": "ADHESION_NOT_AVAILABLE"}.get(
            str(validity), "ADHESION_VALIDITY"
        )
    if says["MuAvailable"] is None:
        return "ADHESION_MU"
    if "SampleAge" in m.fields and not (isinstance(age, int) and age <= MAX_SAMPLE_AGE_MS):
        return "ADHESION_SAMPLE_AGE"
    if "Confidence" in m.fields and says["Confidence"] in ("None", None):
        return "ADHESION_CONFIDENCE"
    classes = [says[ours] for ours in ("Surface", "ContactState") if ours in says]
    return "ADHESION_NO_CLASS" if {None, "Unknown"} & {*classes} else None


def _or_none(value: int | str | None) -> str:
    return NO_VALUE if value is None else f"{value}U"


def vectors_header(messages: Sequence[KitMessage]) -> str:
    """vectors.h: what test_adhesion.c feeds and expects."""
    found = [(place, m, v) for place, m in enumerate(messages) for v in vectors(m)]
    rows = [line for place, m, v in found for line in _row(place, m, v)]
    turns = [line for m in messages for line in _turn(m)]
    kinds = [
        f"    {{{m.axle}U, 0x{m.message.frame_id:X}U, {_flags(m)}, {m.length}U, "
        f"{flag(m.output.data_id is not None)}, {m.timeout_us}U, {m.output.cycle_us}U, "
        f"{flag('SampleAge' in m.fields)}}},"
        for m in messages
    ]
    return "\n".join(
        [
            f"#define VECTORS {len(found)}U", "#define TURN 15U", "",
            "static const kind_t KINDS[ADHESION_MESSAGES] = {", *kinds, "};", "",
            "/* a Valid frame of each message with each counter */",
            "static const uint8_t TURNS[ADHESION_MESSAGES][TURN][ADHESION_MAX_BYTES] = {", *turns, "};", "",
            "static const vector_t KNOWN[VECTORS] = {", *rows, "};",
        ]
    )  # fmt: skip


def _flags(m: KitMessage) -> str:
    flags = ["ADHESION_EXTENDED"] if m.message.is_extended_frame else []
    flags += ["ADHESION_FD"] if m.is_fd else []
    return " | ".join(flags) or "0U"


def _turn(m: KitMessage) -> Iterator[str]:
    yield "    {"
    for data in turn(m):
        yield f"        {{{byte_list(data)}}},"
    yield "    },"


def _row(place: int, m: KitMessage, v: Vector) -> Iterator[str]:
    yield f'    {{"{m.name}: {v.what}", {place}U, {{{byte_list(v.data)}}},'
    members = ", ".join(f".{key} = {value}" for key, value in expected(m, v.says).items())
    yield f"     {{{members}}}}},"
