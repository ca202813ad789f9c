"""The configuration's messages as constant tables in C."""

from collections.abc import Mapping, Sequence

from wrcd.tools.kit.model import CONFIDENCE, Field, KitMessage, Number, Words

# Places in the enumerations of adhesion.h and adhesion.c.
SAYS = {
    "Validity": {
        "Error": "SAYS_OTHER", "NotAvailable": "SAYS_NOT_AVAILABLE", "Degraded": "SAYS_DEGRADED",
        "Valid": "SAYS_VALID",
    },
    "Confidence": {word: f"{place}U" for place, word in enumerate(CONFIDENCE)},  # in HALF_WIDTHS
    "Surface": {
        word: f"ADHESION_SURFACE_{name}"
        for word, name in (
            ("Unknown", "UNKNOWN"), ("Dry", "DRY"), ("Wet", "WET"), ("Reduced", "REDUCED"), ("Low", "LOW"),
            ("VeryLow", "VERY_LOW"),
        )
    },
    "ContactState": {word: f"ADHESION_CONTACT_{word.upper()}" for word in ("Unknown", "Adhering", "Saturated")},
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
    fields: Mapping[str, Number | Words] = dict(m.fields)
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
        one = fields.get(ours)
        if isinstance(one, Number):
            lines += _number(member, one, lists)
        elif isinstance(one, Words):
            words = _words(ours, one, lists)
            lines.append(f"        .{member} = {{{_field(one.field)}, {len(one.by_raw)}U, {words}}},")
    return "\n".join([*lines, "    },"])


def _field(field: Field) -> str:
    s = field.signal
    return f"{{{field.first}U, {s.length}U, {flag(field.motorola)}, {flag(s.is_signed)}}}"


def _number(member: str, n: Number, lists: dict[str, str]) -> list[str]:
    none = "NULL"
    if n.none:
        body = f"int64_t @[] = {{{', '.join(map(_int64, n.none))}}}"
        none = lists.setdefault(body, f"NONE_{len(lists)}")
    return [
        f"        .{member} = {{{_field(n.field)}, {len(n.none)}U, {none},",
        f"            {_int64(n.lowest)}, {_int64(n.highest)},",
        f"            {', '.join(map(_int64, n.weights))}}},",
    ]


def _words(ours: str, w: Words, lists: dict[str, str]) -> str:
    items = "".join(
        f"\n    {{{_int64(raw)}, (uint8_t){SAYS[ours][word]}}}, /* {word} */" for raw, word in w.by_raw.items()
    )
    return lists.setdefault(f"word_t @[] = {{{items}\n}}", f"{ours.upper()}_{len(lists)}")


def _int64(value: int) -> str:
    return f"INT64_C({value})"
