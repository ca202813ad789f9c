"""What the configuration says of one input, before the DBC is asked: a record for each signal."""

from collections.abc import Sequence
from typing import NamedTuple

from wrcd import declared
from wrcd.bus.units import Quantity
from wrcd.keys import SignalName, message_and_signal, names
from wrcd.section import TO_FILL_IN, Section, shown

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

Values = tuple[int | str, ...]  # raw ones, or words of a value table


class StatusStatement(NamedTuple):
    """Which signal says whether the sender is well, and by which values. None: by the words of its value table."""

    message: str
    signal: str
    ok: Values | None
    degraded: Values | None
    timeout_ms: int | None


class Statement(NamedTuple):
    """One signal that carries a quantity, or a part of it, as the configuration says. None: as the DBC says."""

    table: Section  # for errors
    quantity: Quantity
    axles: tuple[int, ...]
    part: int
    message: str
    signal: str
    sign: int
    unit: str | None
    scale: float | None
    offset: float | None
    range: tuple[float, float] | None
    timeout_ms: int | None
    invalid: Values
    status: StatusStatement | None
    status_off: bool  # the message has a status that is not to count
    e2e: str | None
    data_id: int | None
    at: str
    gear_ratio: float | None
    share: float
    reverse: Values | None
    wrong: bool  # a value is, and that is said already: what depends on it is not looked at
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
    message, signal = _named(table, declared.SIGNAL)
    before = table.mistakes
    e2e, data_id = declared.E2E.read(table), declared.DATA_ID.read(table)
    protection_wrong, before = table.mistakes > before, table.mistakes
    status_off = table.raw(declared.STATUS.name) is False
    status = None if status_off or declared.STATUS.name not in table else _status(table)
    if status_off or declared.STATUS.name not in table:
        for key in (declared.OK, declared.DEGRADED, declared.STATUS_TIMEOUT):
            if key.name in table:
                table.mistake(
                    table.error("says nothing without a status", key.name, table.line(status="Message.Signal"))
                )
    status_wrong, before = table.mistakes > before, table.mistakes
    at = declared.AT.value(table)
    gear_ratio = declared.GEAR_RATIO.read(table)
    if table.mistakes == before:
        _check_gear(table, at, gear_ratio)
    return Statement(
        table=table,
        quantity=q,
        axles=axles,
        part=part,
        message=message,
        signal=signal,
        sign=declared.SIGN.read(table),
        unit=declared.UNIT.read(table),
        scale=declared.SCALE.read(table),
        offset=declared.OFFSET.read(table),
        range=declared.RANGE.read(table),
        timeout_ms=declared.TIMEOUT.read(table),
        invalid=declared.INVALID.read(table) or (),
        status=status,
        status_off=status_off,
        e2e=e2e,
        data_id=data_id,
        at=at,
        gear_ratio=gear_ratio,
        share=declared.SHARE.value(table),
        reverse=declared.REVERSE.read(table),
        wrong=table.mistakes > before,
        status_wrong=status_wrong,
        protection_wrong=protection_wrong,
    )


def _check_gear(table: Section, at: str, gear_ratio: float | None) -> None:
    key = declared.GEAR_RATIO.name
    if at == "motor" and gear_ratio is None:
        table.mistake(table.absent(key, "the torque at the axle is the motor's times it", TO_FILL_IN))
    elif at != "motor" and gear_ratio is not None:
        table.mistake(
            table.error(f"says nothing of a torque at the {at}", key, f"of a motor's: {table.line(at='motor')}")
        )


def _named(table: Section, key: SignalName) -> tuple[str, str]:
    return message_and_signal(table, key.name, table.take(key.name, str))


def _status(table: Section) -> StatusStatement | None:
    key, given = declared.STATUS.name, table.raw(declared.STATUS.name)
    if type(given) is not str:
        table.mistake(table.error(f'takes "Message.Signal" or false, not {shown(given)}', key))
        return None
    with table.collected():
        return StatusStatement(
            *_named(table, declared.STATUS),
            declared.OK.read(table),
            declared.DEGRADED.read(table),
            declared.STATUS_TIMEOUT.read(table),
        )
    return None
