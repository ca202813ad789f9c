"""Messages that are sent: which signals carry what, under which names and words, and whether they can."""

from collections.abc import Mapping, Sequence

from wrcd.bus.dbc import CLASSICAL_BYTES, Database, Message, Signal, cycle_ms, find_message
from wrcd.bus.positions import span
from wrcd.bus.signals import Output, OutputSignal
from wrcd.config import declared
from wrcd.config.keys import Key, RawValue, names
from wrcd.config.raw_values import plain, raw_value, usable_field, words
from wrcd.config.section import TO_FILL_IN, Section, nearest, suggest
from wrcd.config.statements import check_header, e2e_identity
from wrcd.core.vocabulary import MESSAGES, Numeric, Words, snake

NEEDS: Mapping[str, tuple[str, ...]] = {"adhesion": ("Validity", "MuAvailable")}
ADHESION_MS, DETAIL_MS, STATUS_MS = 20, 100, 1000  # cycles where nobody says one
CYCLES_MS = {"adhesion": ADHESION_MS, "detail": DETAIL_MS, "inputs": DETAIL_MS, "own": DETAIL_MS}
STATUS_MESSAGES = ("WrcdStatus", "WrcdRejects", "WrcdLink")
STATUS_KEYS = ("status_message", "rejects_message", "link_message")


def usual_messages(number: int) -> tuple[str, ...]:
    """Names of what is sent for an axle unless the configuration names others, in the order of AXLE_OUTPUTS."""
    return tuple(f"{name}_A{number}" for name in ("Adhesion", "AdhesionDetail", "InputHealth", "AdhesionOwn"))


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
    tables = {ours: one for key, ours in keys.items() if (one := table.table_or_text(key, declared.FIELD.name))}
    table.done(names(declared.output_keys(kind)))
    sound = {ours: one for ours, one in tables.items() if _is_sound(one, declared.field_keys(MESSAGES[kind][ours]))}
    if database is None:
        return None
    message = _message(table, database, name)
    _check_sendable(table, message)
    before = table.mistakes
    signals = _signals(table, kind, message, tables, sound)
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
        table.refuse(f"{cycle} ms is shorter than the design's tick of {tick_ms:g} ms", key)
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
        copied = f", or copy {name} from wrcd.dbc into it" if name.startswith("Adhesion_A") else ""
        hint = suggest(name, [m.name for m in database.messages]) or table.line(message=TO_FILL_IN) + copied
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
    table: Section, kind: str, message: Message, tables: Mapping[str, Section], sound: Mapping[str, Section]
) -> dict[str, OutputSignal]:
    """Which of the message's signals carry what, by our names; tables: as configured, sound: those without a
    mistake. Mistakes are collected."""
    found: dict[str, OutputSignal] = {}
    fields = {s.name: s for s in message.signals}
    for ours, carried in MESSAGES[kind].items():
        key = snake(ours)
        if key in table and ours not in sound:
            continue
        if ours not in tables and ours not in fields:
            if ours in NEEDS.get(kind, ()):
                near = nearest(ours, fields) or TO_FILL_IN
                hint = f"name the one that carries it: {table.line(**{key: near})}"
                table.refuse(f"message {message.name} has no signal {ours!r}", key, hint)
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
    if not found and not tables and not NEEDS.get(kind):
        table.refuse(
            f"message {message.name} has none of the signals {', '.join(MESSAGES[kind])}",
            declared.MESSAGE.name,
            f"name those that carry them: {table.line(**{snake(next(iter(MESSAGES[kind]))): TO_FILL_IN})}",
        )
    return found


# Units of what is sent: theirs in ours.
UNITS = {
    "%": {"%": 1.0, "percent": 1.0, "pct": 1.0, "1": 100.0},
    "ms": {"ms": 1.0, "s": 1000.0},
    "dB": {"db": 1.0},
    "": {"": 1.0, "1": 1.0},
}
# A word of a value table that says that there is no value; letters and digits only.
NO_VALUE = ("notavail", "unavail", "nichtverf", "nondisponible", "nodisponible")
NO_VALUES = ("na", "sna", "nv")
EPSILON = 1e-6  # of a step: what is lost in the conversion of a range


def numeric_field(table: Section, ours: str, carried: Numeric, message: Message, signal: Signal) -> OutputSignal:
    """A field for a number. Raises InputError where it cannot say a value in its range, with its resolution, or that
    there is none."""
    where, key = f"{message.name}.{signal.name}", declared.FIELD.name
    if signal.is_float:
        raise table.error(f"{where} is coded as a float; only whole numbers are sent", key)
    in_ours = _unit(table, where, carried, signal)
    scale, offset = float(signal.scale), float(signal.offset)
    step = abs(scale) * in_ours
    if scale < 0:
        raise table.error(f"{where} counts downwards, by {scale:g}; nothing is sent so", key)
    if step > carried.step * (1 + EPSILON) or (carried.exact and abs(round(1 / step) - 1 / step) > EPSILON):
        raise table.error(
            f"{where} has steps of {step:g}{_blank(carried.unit)}; {ours} needs {carried.step:g} or finer", key
        )
    low, high = _range(table, carried, signal, in_ours)
    lowest, highest = span(signal)
    no_value = _no_value(table, ours, carried, signal, where)
    if no_value is not None:
        first, last = (low - offset) / scale, (high - offset) / scale
        if first - 0.5 <= no_value <= last + 0.5:
            raise table.error(
                f"{no_value} is {no_value * scale + offset:g}{_blank(signal.unit)} to {where}, a value within its "
                f"range {low:g} … {high:g}, and can't say that there is none",
                declared.NO_VALUE.name if declared.NO_VALUE.name in table else key,
                f"another raw value, or a range without it: {table.line(range=[TO_FILL_IN, TO_FILL_IN])}",
            )
    # what the field itself can hold
    low, high = max(low, lowest * scale + offset), min(high, highest * scale + offset)
    slack = EPSILON * scale
    if low * in_ours > carried.low + slack * in_ours or high * in_ours < carried.high - slack * in_ours:
        raise table.error(
            f"{where} says {low * in_ours:g} … {high * in_ours:g}{_blank(carried.unit)}; "
            f"{ours} needs {carried.low:g} … {carried.high:g}",
            key if declared.FIELD_RANGE.name not in table else declared.FIELD_RANGE.name,
        )
    stated = signal.minimum is not None and signal.maximum is not None and declared.FIELD_RANGE.name not in table
    return OutputSignal(
        signal.name,
        factor=1.0 / in_ours,
        not_available=no_value,
        round_down=carried.round_down,
        low=None if stated else low,
        high=None if stated else high,
    )


def _blank(unit: str | None) -> str:
    return f" {unit}" if unit else ""


def _unit(table: Section, where: str, carried: Numeric, signal: Signal) -> float:
    """The weight of the signal's unit in ours."""
    stated = declared.FIELD_UNIT.read(table)
    unit = (signal.unit or "") if stated is None else stated
    known = UNITS[carried.unit]
    found = known.get(unit.strip().lower())
    if found is None:
        usable = {"%": ("%", "1"), "": ("1",), "ms": ("ms", "s")}.get(carried.unit, (carried.unit,))
        raise table.error(
            f"{where} is in {unit!r}, not in {' or '.join(usable)}" if unit else f"the DBC states no unit of {where}",
            declared.FIELD.name if stated is None else declared.FIELD_UNIT.name,
            table.line(unit=usable[0]) + "".join(f', or unit = "{u}"' for u in usable[1:]),
        )
    return found


def _range(table: Section, carried: Numeric, signal: Signal, in_ours: float) -> tuple[float, float]:
    """What may be sent, in the signal's unit."""
    stated = declared.FIELD_RANGE.read(table)
    if stated is not None:
        return stated
    usual = carried.limits or (carried.low, carried.high)
    low = usual[0] / in_ours if signal.minimum is None else float(signal.minimum)
    high = usual[1] / in_ours if signal.maximum is None else float(signal.maximum)
    return low, high


def _no_value(table: Section, ours: str, carried: Numeric, signal: Signal, where: str) -> int | None:
    """The raw value that says that there is none; None where there is always one."""
    if not carried.absent:
        return None
    stated = declared.NO_VALUE.read(table)
    if stated is not None:
        return raw_value(table, declared.NO_VALUE.name, signal, stated)
    for raw, word in words(signal).items():
        text = plain(word)
        if text in NO_VALUES or any(part in text for part in NO_VALUE):
            return raw
    _, highest = span(signal)
    raise table.error(
        f'{where} has no word for "not available", and {ours} is not always there',
        declared.FIELD.name,
        f"say which raw value means it: {table.line(not_available=highest)}",
    )


def words_field(table: Section, carried: Words, message: Message, signal: Signal) -> OutputSignal:
    """A field for one of some words. Raises InputError where it lacks one, or one claims what another does not."""
    where, key = f"{message.name}.{signal.name}", declared.FIELD.name
    if signal.is_float:
        raise table.error(f"{where} is coded as a float; only whole numbers are sent", key)
    theirs = {plain(word): raw for raw, word in reversed(words(signal).items())}
    found: dict[str, int] = {}
    missing = []
    for word in (*carried.words, *carried.extra):
        value = RawValue(snake(word), "").read(table)
        if value is not None:
            found[word] = raw_value(table, snake(word), signal, value)
        elif plain(word) in theirs:
            found[word] = theirs[plain(word)]
        elif word in carried.words:
            missing.append(word)
    if missing:
        raise table.error(
            f"the value table of {where} lacks {', '.join(missing)}",
            key,
            f"say by which of its words or raw values: {table.line(**{snake(w): TO_FILL_IN for w in missing})}",
        )
    for claim, other in carried.apart:
        if claim in found and other in found and found[claim] == found[other]:
            at = snake(other) if snake(other) in table else snake(claim) if snake(claim) in table else key
            raise table.error(f"{where} says {other} by the same raw value as {claim}, {found[claim]}", at)
    return OutputSignal(signal.name, words=found)
