"""The configuration's messages as constant tables in C."""

from collections.abc import Sequence

from wrcd.bus.dbc import Signal
from wrcd.core.vocabulary import snake
from wrcd.kit.receiver import CONFIDENCE, CONTACT, SURFACE, KitMessage, NumberSignal, WordSignal

# Places in the enumerations of adhesion.h and adhesion.c.
SAYS = {
    "Validity": {
        "Error": "SAYS_OTHER", "NotAvailable": "SAYS_NOT_AVAILABLE", "Degraded": "SAYS_DEGRADED",
        "Valid": "SAYS_VALID",
    },
    "Confidence": {word: f"{place}U" for place, word in enumerate(CONFIDENCE)},  # in HALF_WIDTHS
    "Surface": {word: f"ADHESION_SURFACE_{snake(word).upper()}" for word in SURFACE},
    "ContactState": {word: f"ADHESION_CONTACT_{word.upper()}" for word in CONTACT},
}  # fmt: skip
_MEMBERS = (
    ("validity", "Validity"), ("confidence", "Confidence"), ("surface", "Surface"), ("contact", "ContactState"),
    ("mu_available", "MuAvailable"), ("mu_used", "MuUsed"), ("sample_age", "SampleAge"),
)  # fmt: skip


def tables(messages: Sequence[KitMessage]) -> str:
    """The definitions of MESSAGES and of the lists that it points to. Equal lists are defined once."""
    lists: dict[str, str] = {}  # body to name
    rows = [_row(m, lists) for m in messages]
    defined = [f"static const {body.replace('@', name)};" for body, name in lists.items()]
    return "\n".join([*defined, "", "static const message_t MESSAGES[ADHESION_MESSAGES] = {", *rows, "};"])


def byte_list(data: bytes) -> str:
    """Bytes as C has them."""
    return ", ".join(f"0x{b:02X}U" for b in data)


def flag(value: bool) -> str:
    """A bool as C has it."""
    return "true" if value else "false"


def _row(m: KitMessage, lists: dict[str, str]) -> str:
    data_id = m.output.data_id
    lines = [
        f"    {{ /* {m.name} */",
        f"        .id = 0x{m.message.frame_id:X}U,",
        f"        .timeout_us = {m.timeout_us}U,",
        f"        .cycle_us = {m.output.cycle_us}U,",
        f"        .data_id = 0x{data_id or 0:X}U,",
        f"        .axle = {m.axle}U,",
        f"        .length = {m.length}U,",
        f"        .is_extended = {flag(m.message.is_extended_frame)},",
        f"        .is_fd = {flag(m.is_fd)},",
        f"        .is_protected = {flag(data_id is not None)},",
    ]
    for member, ours in _MEMBERS:
        one = m.fields.get(ours)
        if isinstance(one, NumberSignal):
            lines += _number(member, one, lists)
        elif isinstance(one, WordSignal):
            words = _words(ours, one, lists)
            lines.append(f"        .{member} = {{{_bits(one.signal)}, {len(one.by_raw)}U, {words}}},")
    return "\n".join([*lines, "    },"])


def _bits(s: Signal) -> str:
    """Where a signal is, as adhesion.c counts bits: a Motorola signal's from its highest on."""
    motorola = s.byte_order != "little_endian"
    first = 8 * (s.start // 8) + 7 - s.start % 8 if motorola else s.start
    return f"{{{first}U, {s.length}U, {flag(motorola)}, {flag(s.is_signed)}}}"


def _number(member: str, n: NumberSignal, lists: dict[str, str]) -> list[str]:
    none = "NULL"
    if n.none:
        body = f"int64_t @[] = {{{', '.join(map(_int64, n.none))}}}"
        none = lists.setdefault(body, f"NONE_{len(lists)}")
    return [
        f"        .{member} = {{{_bits(n.signal)}, {len(n.none)}U, {none},",
        f"            {_int64(n.lowest)}, {_int64(n.highest)},",
        f"            {', '.join(map(_int64, n.weights))}}},",
    ]


def _words(ours: str, w: WordSignal, lists: dict[str, str]) -> str:
    items = "".join(
        f"\n    {{{_int64(raw)}, (uint8_t){SAYS[ours][word]}}}, /* {word} */" for raw, word in w.by_raw.items()
    )
    return lists.setdefault(f"word_t @[] = {{{items}\n}}", f"{ours.upper()}_{len(lists)}")


def _int64(value: int) -> str:
    return f"INT64_C({value})"
