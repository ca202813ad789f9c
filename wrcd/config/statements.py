"""What the configuration says of one input, before the DBC is asked: a record for each signal."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from wrcd.bus.dbc import DATA_ID, PROFILE, Database, Message, attribute, data_id, e2e_profile, find_message
from wrcd.bus.positions import frame_length, position
from wrcd.bus.units import Quantity
from wrcd.config import declared
from wrcd.config.keys import RawNames, names
from wrcd.config.section import TO_FILL_IN, Section, shown

AXLE_QUANTITIES = (
    Quantity.YAW_RATE,
    Quantity.LAT_ACCEL,
    Quantity.TORQUE,
    Quantity.BRAKE_TORQUE,
    Quantity.AXLE_LOAD,
    Quantity.WHEEL_RADIUS,
)
VEHICLE_QUANTITIES = (Quantity.SPEED, Quantity.DIRECTION)
NEEDED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE)
TORQUES = (Quantity.TORQUE, Quantity.BRAKE_TORQUE)
KEYS = dict.fromkeys((Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS), declared.PLAIN_INPUT) | {
    Quantity.DIRECTION: declared.DIRECTION_INPUT,
    Quantity.TORQUE: declared.TORQUE_INPUT,
    Quantity.BRAKE_TORQUE: declared.TORQUE_INPUT,
}


class StatusStatement(NamedTuple):
    """Which signal says whether the sender is well, and by which values. None: by the words of its value table."""

    message: str
    signal: str
    ok: RawNames | None
    degraded: RawNames | None
    timeout_ms: int | None


class Statement(NamedTuple):
    """One signal that carries a quantity, or a part of it, as the configuration says."""

    table: Section  # for errors
    quantity: Quantity
    axles: tuple[int, ...]
    part: int
    message: str
    signal: str
    given: declared.Given
    status: StatusStatement | None
    status_off: bool  # the message has a status that is not to count
    e2e: str | None
    data_id: int | None
    wrong: bool  # a value is, and that is reported already: what depends on it is not looked at
    status_wrong: bool  # the same of those of its status
    protection_wrong: bool


def statements(section: Section, quantities: Sequence[Quantity], axles: tuple[int, ...]) -> list[Statement]:
    """What a table says of its inputs, of some axles (places 0 … n-1). Mistakes are collected."""
    found = []
    for q in quantities:
        if q in TORQUES:
            tables = section.tables_or_text(q.key, declared.SIGNAL.name)
        else:
            one = section.table_or_text(q.key, declared.SIGNAL.name)
            tables = [] if one is None else [one]
        if q in NEEDED and q.key not in section:
            section.mistake(section.absent(q.key, "name the signal that carries it", "Message.Signal"))
        for part, table in enumerate(tables):
            with table.collected():
                found.append(_statement(table, q, axles, part))
            table.done(names(KEYS.get(q, declared.SIGNED_INPUT)))
    return found


def _statement(table: Section, q: Quantity, axles: tuple[int, ...], part: int) -> Statement:
    message, signal = declared.SIGNAL.named(table)
    before = table.mistakes
    e2e, data_id = declared.E2E.read(table), declared.DATA_ID.read(table)
    protection_wrong, before = table.mistakes > before, table.mistakes
    status_off = table.raw(declared.STATUS.name) is False
    status = None if status_off or declared.STATUS.name not in table else _status(table)
    if status_off or declared.STATUS.name not in table:
        for key in (declared.OK, declared.DEGRADED, declared.STATUS_TIMEOUT):
            if key.name in table:
                table.refuse("says nothing without a status", key.name, table.line(status="Message.Signal"))
    status_wrong, before = table.mistakes > before, table.mistakes
    given, wrong = declared.given_by(table)
    if not wrong & {declared.AT.name, declared.GEAR_RATIO.name}:
        _check_gear(table, given.at, given.gear_ratio)
    return Statement(
        table=table,
        quantity=q,
        axles=axles,
        part=part,
        message=message,
        signal=signal,
        given=given,
        status=status,
        status_off=status_off,
        e2e=e2e,
        data_id=data_id,
        wrong=table.mistakes > before,
        status_wrong=status_wrong,
        protection_wrong=protection_wrong,
    )


def _check_gear(table: Section, at: str, gear_ratio: float | None) -> None:
    key = declared.GEAR_RATIO.name
    if at == "motor" and gear_ratio is None:
        table.mistake(table.absent(key, "the torque at the axle is the motor's times it", TO_FILL_IN))
    elif at != "motor" and gear_ratio is not None:
        table.refuse(f"says nothing of a torque at the {at}", key, f"of a motor's: {table.line(at='motor')}")


def _status(table: Section) -> StatusStatement | None:
    key, given = declared.STATUS.name, table.raw(declared.STATUS.name)
    if type(given) is not str:
        table.refuse(f'takes "Message.Signal" or false, not {shown(given)}', key)
        return None
    with table.collected():
        return StatusStatement(
            *declared.STATUS.named(table),
            declared.OK.read(table),
            declared.DEGRADED.read(table),
            declared.STATUS_TIMEOUT.read(table),
        )
    return None


# A frame is accepted whole or not at all, so what one input says of its message holds for all of them, and two that
# contradict each other are refused.
def by_message(statements: Iterable[Statement]) -> dict[str, list[Statement]]:
    """The statements about each message."""
    found: dict[str, list[Statement]] = {}
    for s in statements:
        found.setdefault(s.message, []).append(s)
    return found


def protection(of_message: Sequence[Statement], database: Database) -> int | None:
    """The data id of one message that carries inputs, by what they say of it, else by the DBC. Raises InputError."""
    if any(s.protection_wrong for s in of_message):
        return None
    message = find_message(database, of_message[0].message)
    identities = {}
    for s in of_message:
        if s.e2e is not None or s.data_id is not None:
            identities[e2e_identity(s.table, message, s.e2e, s.data_id)] = s
    if len(identities) > 1:
        (_, first), (_, second) = list(identities.items())[:2]
        raise second.table.error(
            f"says another E2E protection of {message.name} than {first.table.name}",
            declared.E2E.name if second.e2e is not None else declared.DATA_ID.name,
        )
    if identities:
        return next(iter(identities))
    s = of_message[0]
    return e2e_identity(s.table, message, None, None)


def e2e_identity(table: Section, message: Message, e2e: str | None, stated: int | None) -> int | None:
    """The data id of a message, by what a table says of it, else by the DBC; None: not protected. Raises InputError."""
    if e2e == declared.UNPROTECTED:
        if stated is not None:
            raise table.error('says nothing beside e2e = "none"', declared.DATA_ID.name)
        return None
    if e2e is None:
        try:
            known = data_id(message)
        except ValueError as e:
            raise table.error(str(e), None, f'{table.line(e2e="none")}, or e2e = "P11" and its data_id') from None
        if stated is not None and known is None:
            raise table.error(
                f"message {message.name} is not protected", declared.DATA_ID.name, f"if it is, {table.line(e2e='P11')}"
            )
        return known if stated is None else stated
    if message.length < 2:
        raise table.error(f"message {message.name} has no room for CRC and counter", declared.E2E.name)
    if stated is None:
        known = attribute(message, DATA_ID)
        if (
            not isinstance(known, int)
            or not 0 <= known <= declared.DATA_ID.high
            or not e2e_profile(attribute(message, PROFILE))
        ):
            raise table.error(
                "is missing",
                declared.DATA_ID.name,
                f"the DBC states none for {message.name}: {table.line(data_id=TO_FILL_IN)}",
            )
        return known
    return stated


def check_header(table: Section, key: str, message: Message, names: Iterable[str]) -> None:
    """Raises InputError for a signal within what E2E writes: byte 0 and the low nibble of byte 1."""
    length = frame_length(message)
    for signal in message.signals:
        order, shift, mask, _ = position(signal, length)
        written = int.from_bytes(b"\xff\x0f".ljust(length, b"\0"), order)
        if signal.name in names and mask << max(shift, 0) & written:
            raise table.error(
                f"{message.name}.{signal.name} lies where the E2E CRC and counter of {message.name} are",
                key,
                f"if it is not protected, {table.line(e2e='none', data_id=None)}",
            )
