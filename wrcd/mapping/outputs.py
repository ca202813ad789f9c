"""Messages that are sent: which of their signals carry what, under which names and words."""

from collections.abc import Mapping, Sequence

from wrcd import declared
from wrcd.bus.dbc import CLASSICAL_BYTES, Database, Message, cycle_ms, find_message
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.vocabulary import MESSAGES, Numeric, snake
from wrcd.keys import Key, names
from wrcd.mapping.fields import numeric_field, words_field
from wrcd.mapping.message_facts import check_header, e2e_identity
from wrcd.mapping.values import span, usable_field
from wrcd.section import TO_FILL_IN, Section, nearest, suggest

NEEDS: Mapping[str, tuple[str, ...]] = {"adhesion": ("Validity", "MuAvailable")}
ADHESION_MS, DETAIL_MS, STATUS_MS = 20, 100, 1000  # cycles where nobody says one
CYCLES_MS = {"adhesion": ADHESION_MS, "detail": DETAIL_MS, "inputs": DETAIL_MS, "ahead": ADHESION_MS}
STATUS_MESSAGES = ("WrcdStatus", "WrcdRejects", "WrcdLink")
STATUS_KEYS = ("status_message", "rejects_message", "link_message")


def usual_messages(number: int) -> tuple[str, str, str, str]:
    """Names of what is sent for an axle unless the configuration names others: adhesion, detail, inputs and, with
    fusion, what lies ahead."""
    return f"Adhesion_A{number}", f"AdhesionDetail_A{number}", f"InputHealth_A{number}", f"AdhesionAhead_A{number}"


def output(section: Section, kind: str, database: Database | None, usual: str, tick_ms: float) -> Output | None:
    """A message to send: named, or the usual one. None: nobody needs it, or it has a mistake, which is collected.

    Without a database only what the configuration says by itself is looked at.
    """
    table = section.table_or_text(kind, declared.MESSAGE.name)
    needed = kind in NEEDS
    if table is None:
        if kind in section or database is None or not usual or not (needed or _has(database, usual)):
            return None
        table = section.usual(kind, declared.MESSAGE.name, usual)
    with table.collected():
        return _output(table, kind, database, usual, tick_ms)


def _output(table: Section, kind: str, database: Database | None, usual: str, tick_ms: float) -> Output | None:
    name = declared.MESSAGE.read(table)
    if name is None and declared.MESSAGE.name in table:
        return None
    name = usual if name is None else name
    before = table.mistakes
    cycle = declared.CYCLE.read(table)
    e2e, identity = declared.E2E.read(table), declared.DATA_ID.read(table)
    wrong = table.mistakes > before
    keys = {snake(ours): ours for ours in MESSAGES[kind]}
    said = {ours: one for key, ours in keys.items() if (one := table.table_or_text(key, declared.FIELD.name))}
    table.done(names(declared.output_keys(kind)))
    sound = {ours: one for ours, one in said.items() if _is_sound(one, declared.field_keys(MESSAGES[kind][ours]))}
    if database is None:
        return None
    message = _message(table, database, name)
    _check_sendable(table, message)
    before = table.mistakes
    signals = _signals(table, kind, message, said, sound)
    if wrong:
        return None
    if cycle is None:
        try:
            cycle = cycle_ms(message) or CYCLES_MS.get(kind, STATUS_MS)
        except ValueError as e:
            raise table.error(
                str(e), declared.MESSAGE.name, f"mend the DBC, or {table.line(cycle_ms=TO_FILL_IN)}"
            ) from None
    if cycle < tick_ms:
        key = declared.CYCLE.name if declared.CYCLE.name in table else declared.MESSAGE.name
        table.mistake(table.error(f"{cycle} ms is shorter than the design's tick of {tick_ms:g} ms", key))
    data_id = e2e_identity(table, message, e2e, identity)
    if data_id is not None:
        check_header(table, declared.MESSAGE.name, message, {s.name for s in signals.values()})
    return Output(message.name, 1000 * cycle, data_id, signals) if table.mistakes == before else None


def _is_sound(table: Section, keys: Sequence[Key]) -> bool:
    """Whether the values of a signal's table are what its keys take. Mistakes are collected."""
    before = table.mistakes
    for key in keys:
        with table.collected():
            key.read(table)
    table.done(names(keys))
    return table.mistakes == before


def _has(database: Database, name: str) -> bool:
    return any(m.name == name for m in database.messages)


def _message(table: Section, database: Database, name: str) -> Message:
    try:
        return find_message(database, name)
    except KeyError as e:
        hint = suggest(name, [m.name for m in database.messages]) or table.line(message=TO_FILL_IN)
        raise table.error(str(e.args[0]), declared.MESSAGE.name, hint) from None
    except ValueError as e:
        raise table.error(str(e), declared.MESSAGE.name, "mend the DBC, or send another message") from None


def _check_sendable(table: Section, message: Message) -> None:
    """Raises InputError for a message that is not a plain classical one, and for a field, a start value or a word that
    no frame can hold."""
    key = declared.MESSAGE.name
    if message.is_fd or message.is_multiplexed() or message.length > CLASSICAL_BYTES:
        raise table.error(f"message {message.name} is CAN FD or multiplexed; only plain classical ones are sent", key)
    for s in message.signals:
        if not usable_field(s):
            raise table.error(f"{message.name}.{s.name} has bits that no frame has, or numbers that are none", key)
        lowest, highest = span(s)
        raws = [*(s.choices or {}), int(s.raw_initial or 0)]
        if not s.is_float and not all(lowest <= raw <= highest for raw in raws):
            raise table.error(
                f"{message.name}.{s.name} has a start value or a named value beyond its {s.length} bits", key
            )


def _signals(
    table: Section, kind: str, message: Message, said: Mapping[str, Section], sound: Mapping[str, Section]
) -> dict[str, OutputSignal]:
    """Which of the message's signals carry what, by our names; said: as the configuration has it, sound: where that is
    no mistake. Mistakes are collected."""
    found: dict[str, OutputSignal] = {}
    fields = {s.name: s for s in message.signals}
    for ours, carried in MESSAGES[kind].items():
        key = snake(ours)
        if key in table and ours not in sound:
            continue
        if ours not in said and ours not in fields:
            if ours in NEEDS.get(kind, ()):
                near = nearest(ours, fields) or TO_FILL_IN
                hint = f"name the one that carries it: {table.line(**{key: near})}"
                table.mistake(table.error(f"message {message.name} has no signal {ours!r}", key, hint))
            continue
        one = sound.get(ours) or table.usual(key, declared.FIELD.name, ours)
        with table.collected():
            name = one.take(declared.FIELD.name, str)
            if name not in fields:
                raise one.error(
                    f"message {message.name} has no signal {name!r}", declared.FIELD.name, suggest(name, fields)
                )
            taken = next((other for other, s in found.items() if s.name == name), None)
            if taken is not None:
                raise one.error(f"{message.name}.{name} carries {taken} already", declared.FIELD.name)
            if isinstance(carried, Numeric):
                found[ours] = numeric_field(one, ours, carried, message, fields[name])
            else:
                found[ours] = words_field(one, carried, message, fields[name])
    if not found and not said and not NEEDS.get(kind):
        table.mistake(
            table.error(
                f"message {message.name} has none of the signals {', '.join(MESSAGES[kind])}",
                declared.MESSAGE.name,
                f"name those that carry them: {table.line(**{snake(next(iter(MESSAGES[kind]))): TO_FILL_IN})}",
            )
        )
    return found
