"""The whole train: its axles, what is mapped for them and for the vehicle, what is sent.

What cannot hold at once is refused: one signal for two things, one message for two jobs, one identity for two messages.
"""

from collections.abc import Iterable, Mapping, Sequence

from wrcd.bus.dbc import Database, Message, data_id, find_message
from wrcd.bus.frame import EXTENDED, GROUP, ID_BITS, mask_of
from wrcd.bus.positions import message_key
from wrcd.bus.signals import Output, StatusRule
from wrcd.bus.units import Quantity
from wrcd.config import declared
from wrcd.config.input_mapping import check_pace, resolve
from wrcd.config.keys import names
from wrcd.config.outputs import STATUS_KEYS, STATUS_MESSAGES, output, usual_messages
from wrcd.config.section import Section
from wrcd.config.statements import (
    AXLE_QUANTITIES,
    TORQUES,
    VEHICLE_QUANTITIES,
    Statement,
    by_message,
    check_header,
    protection,
    statements,
)
from wrcd.config.status_rules import status_rules
from wrcd.core.configuration import AXLE_OUTPUTS, AxleConfig, Input
from wrcd.core.design import Design
from wrcd.core.terms import MAX_AXLES, MAX_SIGNALS


class ConfiguredTrain:
    """What the configuration maps. Where mistakes were collected, what they are about is left out."""

    def __init__(self) -> None:
        self.axles: list[AxleConfig] = []
        self.inputs: list[Input] = []
        self.data_ids: dict[str, int | None] = {}
        self.own: list[Output | None] = []  # the daemon's own: status, rejects, link
        self.warnings: list[str] = []


def axle_tables(top: Section) -> list[Section]:
    """The tables of [[axle]], along the train where all say where they stand: two by two they are bogies."""
    tables = list(top.sections("axle"))
    at = [table.raw(declared.POSITION.name) for table in tables]
    if not all(isinstance(x, int | float) for x in at):
        return tables
    return [tables[k] for k in sorted(range(len(tables)), key=lambda k: -float(at[k]))]


def all_statements(tables: Sequence[Section], vehicle: Section) -> list[Statement]:
    """What the tables of [[axle]] and [vehicle] say of the inputs. Mistakes are collected."""
    stated = [s for place, table in enumerate(tables) for s in statements(table, AXLE_QUANTITIES, (place,))]
    return stated + statements(vehicle, VEHICLE_QUANTITIES, tuple(range(len(tables))))


def read_train(top: Section, vehicle: Section, database: Database | None, design: Design | None) -> ConfiguredTrain:
    """Read [vehicle] and [[axle]]. Mistakes are collected.

    Without a database or a design (they have mistakes of their own) only what the configuration says by itself is
    looked at.
    """
    train = ConfiguredTrain()
    tables = axle_tables(top)
    if not 1 <= len(tables) <= MAX_AXLES:
        hint = "write [[axle]] for each wheelset"
        error = top.error(f"takes 1 to {MAX_AXLES} tables, found {len(tables)}", "axle", hint)
        top.mistake(error)
        top.explains("axle", error)
        tables = tables[:MAX_AXLES]
    stated = all_statements(tables, vehicle)
    sent: list[tuple[Section, Output]] = []
    places: set[float] = set()
    known = None if design is None else database
    tick_ms = 0.0 if design is None else 1000 * design.tick_s
    numbers: set[int] = set()
    for table in tables:
        number, position = _number(table, numbers), declared.POSITION.read(table)
        if position in places:
            table.refuse(f"{position:g} m is another axle's already", declared.POSITION.name)
        places |= set() if position is None else {position}
        usual = ("",) * len(AXLE_OUTPUTS) if number is None else usual_messages(number)
        usual = usual if position is not None else (*usual[:-1], "")
        found = [output(table, kind, known, name, tick_ms) for kind, name in zip(AXLE_OUTPUTS, usual, strict=True)]
        sent += [
            (table.place(kind, declared.MESSAGE.name), o)
            for kind, o in zip(AXLE_OUTPUTS, found, strict=True)
            if o is not None
        ]
        if number is not None and found[0] is not None:
            train.axles.append(AxleConfig(number, found[0], found[1], found[2], found[3], position))
        table.done(names(declared.AXLE))
    for kind, name in zip(STATUS_KEYS, STATUS_MESSAGES, strict=True):
        one = output(vehicle, kind, known, name, tick_ms)
        train.own.append(one)
        if one is not None:
            sent.append((vehicle.place(kind, declared.MESSAGE.name), one))
    check_shared_signals(stated)
    if database is not None and design is not None:
        mapped = _resolved(top, stated, database, design, train)
        check_jobs(mapped, sent, database)
    return train


def _number(table: Section, numbers: set[int]) -> int | None:
    """The axle's number, which no other has; None where there is a mistake, which is collected."""
    with table.collected():
        number = declared.NUMBER.read(table)
        if number in numbers:
            raise table.error(f"{number} is there twice", declared.NUMBER.name)
        if number is not None:
            numbers.add(number)
        return number
    return None


def _data_id_of_status(s: Statement, message: Message) -> int | None:
    """Of a message that carries nothing but the status of an input. A mistake is collected."""
    try:
        return data_id(message)
    except ValueError as e:
        s.table.refuse(str(e), declared.STATUS.name, "mend the DBC")
        return None


def _resolved(
    top: Section, stated: Sequence[Statement], database: Database, design: Design, train: ConfiguredTrain
) -> list[tuple[Statement, Input]]:
    rules: dict[str, Mapping[str, tuple[StatusRule, ...]]] = {}
    present = {m.name for m in database.messages} - set(database.unsound)
    for name, group in by_message(stated).items():
        if len(group) > MAX_SIGNALS:
            reason = f"{name} is mapped to {len(group)} inputs, at most {MAX_SIGNALS} are read"
            group[MAX_SIGNALS].table.refuse(reason, declared.SIGNAL.name)
        rules[name] = {}
        if name not in present:
            continue  # stated of the signal, below
        with top.collected():
            rules[name] = status_rules(group, database, train.warnings)
        with top.collected():
            train.data_ids[name] = protection(group, database)
    for s in stated:
        for rule in (rule for group in rules[s.message].values() for rule in group):
            if rule.message not in rules and rule.message not in train.data_ids:
                train.data_ids[rule.message] = _data_id_of_status(s, find_message(database, rule.message))
    mapped = []
    for s in stated:
        with s.table.collected():
            of_group = any(other.given.pgn for other in stated if other.message == s.message)
            found = resolve(s, database, design, rules[s.message].get(s.signal, ()), of_group)
            if found is not None:
                check_pace(s, database, design, train.warnings)
                mapped.append((s, found))
            if train.data_ids.get(s.message) is not None:
                check_header(s.table, declared.SIGNAL.name, find_message(database, s.message), {s.signal})
            if s.status is not None and train.data_ids.get(s.status.message) is not None:
                check_header(s.table, declared.STATUS.name, find_message(database, s.status.message), {s.status.signal})
    train.inputs = [i for _, i in mapped]
    return mapped


OWN = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)  # of one axle each: two that share it are one sensor


def check_shared_signals(statements: Sequence[Statement]) -> None:
    """A gyro or accelerometer of two axles, and a torque that would be counted twice. Mistakes are collected."""
    before: dict[tuple[str, str], list[Statement]] = {}
    for s in statements:
        others = before.setdefault((s.message, s.signal), [])
        reason = next(filter(None, (_why_not_both(s, other) for other in others)), None)
        if reason is not None:
            s.table.refuse(reason, declared.SIGNAL.name)
        others.append(s)


def _why_not_both(s: Statement, other: Statement) -> str | None:
    """Why a signal that is one thing already cannot be another, too; None: it can."""
    named = f"{s.message}.{s.signal}"
    if s.quantity is not other.quantity and not {s.quantity, other.quantity} <= set(TORQUES):
        return f"{named} is {other.table.name} already; one signal measures one thing"
    if s.axles == other.axles:
        return f"{named} is counted in {other.table.name} already"
    if s.quantity in OWN:
        return f"{named} is {other.table.name} already; each wheelset has its own {s.quantity.key}"
    return None


def check_jobs(
    inputs: Iterable[tuple[Statement, Input]], outputs: Iterable[tuple[Section, Output]], database: Database
) -> None:
    """A message for two jobs, and two messages with one identity. Mistakes are collected."""
    jobs: dict[str, tuple[str, bool]] = {}  # by message: what for, whether it is sent
    keys: dict[int, str] = {}

    def take(table: Section, key: str, name: str, sent: bool, group: int = 0) -> None:
        job = jobs.setdefault(name, (table.name, sent))
        if job[0] != table.name and (sent or job[1]):
            table.refuse(f"{name} is {'sent' if job[1] else 'read'} for {job[0]} already", key, "one job a message")
            return
        identity = message_key(find_message(database, name)) | group
        kind = "extended" if identity & EXTENDED else "standard"
        for known, other in keys.items():
            if other != name and not (known ^ identity) & mask_of(known) & mask_of(identity):
                so_has = f"{other} is of its group" if (known | identity) & GROUP else f"so has {other}"
                table.refuse(f"{name} has the {kind} id 0x{identity & ID_BITS:X}, and {so_has}", key)
        keys[identity] = name

    for s, i in inputs:
        take(s.table, declared.SIGNAL.name, s.message, False, GROUP * i.source.pgn)
        for rule in i.source.statuses:
            if rule.message != s.message:
                take(s.table, declared.STATUS.name, rule.message, False)
    for table, sent in outputs:
        take(table, declared.MESSAGE.name, sent.message, True)
