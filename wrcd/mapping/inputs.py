"""Inputs: what the configuration says of them, over what the DBC says."""

from wrcd import declared
from wrcd.bus.dbc import (
    DEFAULT_TIMEOUT_MS,
    FD_BYTES,
    Database,
    Message,
    Signal,
    cycle_ms,
    find_message,
    find_signal,
    timeout_ms,
)
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import is_reverse
from wrcd.core.configuration import Input
from wrcd.estimator.design import Design
from wrcd.mapping.ranges import physical_range
from wrcd.mapping.statements import TORQUES, Statement
from wrcd.mapping.values import raw_values, span, usable_field, words
from wrcd.section import TO_FILL_IN, Section, suggest

FLOAT_BITS = (16, 32, 64)
STALE_TICKS = 3  # of gyro and accelerometer: two may be missing
MEASURED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)


def resolve(s: Statement, database: Database, design: Design, statuses: tuple[StatusRule, ...]) -> Input | None:
    """One input; None where a value of its table is wrong, which is said already. Raises InputError."""
    key = declared.SIGNAL.name
    message, signal = find(s.table, key, database, s.message, s.signal)
    try:
        check_readable(message, signal)
    except ValueError as e:
        raise s.table.error(str(e), key) from None
    if s.wrong:
        return None
    to_si = _factor(s, signal, design)
    low, high = physical_range(s, message, signal, to_si, design)
    source = Source(
        s.message,
        s.signal,
        s.quantity,
        s.axles,
        scale=s.scale,
        offset=s.offset,
        factor=to_si if _is_own(s) else None,
        low=low,
        high=high,
        invalid=raw_values(s.table, declared.INVALID.name, signal, s.invalid),
        statuses=statuses,
        reverse=_reverse(s, signal),
        part=s.part,
    )
    return Input(source, _timeout_us(s, message, signal, design))


def find(table: Section, key: str, database: Database, message: str, signal: str) -> tuple[Message, Signal]:
    """A signal and its message. Raises InputError that names the nearest one."""
    try:
        found = find_message(database, message)
        return found, find_signal(found, signal)
    except KeyError as e:
        every = {f"{m.name}.{s.name}" for m in database.messages for s in m.signals}
        raise table.error(str(e.args[0]), key, suggest(f"{message}.{signal}", every)) from None
    except ValueError as e:
        raise table.error(str(e), key, "mend the DBC, or map another message") from None


def check_readable(message: Message, signal: Signal) -> None:
    """Raises ValueError for a signal that nothing here reads, or that no frame can hold: cantools loads it and fails
    on the first frame."""
    if signal.is_multiplexer:
        raise ValueError(f"{message.name}.{signal.name} says which signals a frame carries; it measures nothing")
    if message.length > FD_BYTES:
        raise ValueError(f"message {message.name} has {message.length} bytes; a frame has {FD_BYTES} at the most")
    if signal.is_float and signal.length not in FLOAT_BITS:
        raise ValueError(f"{message.name}.{signal.name} is coded as a float of {signal.length} bits; there is none")
    if not usable_field(signal):
        raise ValueError(f"{message.name}.{signal.name} has bits that no frame has, or numbers that are none")


def _factor(s: Statement, signal: Signal, design: Design) -> float:
    """From the signal's unit to SI units at the axle."""
    unit = signal.unit if s.unit is None else s.unit
    to_si = _at_rim(s, unit) * design.r_0 if s.at == "rim" else _to_si(s, unit)
    return to_si * s.sign * (s.gear_ratio or 1.0) * s.share


def _is_own(s: Statement) -> bool:
    """Whether the configuration says more of the factor than the DBC's unit."""
    return s.unit is not None or s.sign != 1 or s.at != "axle" or s.share != 1.0


def _to_si(s: Statement, unit: str | None) -> float:
    try:
        return factor(unit, s.quantity)
    except ValueError as e:
        if s.unit is not None:
            raise s.table.error(str(e), declared.UNIT.name) from None
        hint = "" if s.quantity not in TORQUES else ', or at = "rim" for a force'
        what = "the DBC states no unit" if not unit else str(e)
        raise s.table.error(
            f"{s.message}.{s.signal}: {what}", declared.SIGNAL.name, f"{s.table.line(unit=s.quantity.unit)}{hint}"
        ) from None


def _at_rim(s: Statement, unit: str | None) -> float:
    key = declared.SIGNAL.name if s.unit is None else declared.UNIT.name
    try:
        return factor(unit, Quantity.AXLE_LOAD)
    except ValueError as e:
        raise s.table.error(str(e), key, f"a force at the rim is in N or kN: {s.table.line(unit='kN')}") from None


def _reverse(s: Statement, signal: Signal) -> frozenset[int] | None:
    """The raw values of a direction that mean reverse; None: by the DBC's words, or by the sign where it has none."""
    if s.quantity is not Quantity.DIRECTION:
        return None
    if s.reverse is not None:
        return raw_values(s.table, declared.REVERSE.name, signal, s.reverse)
    known = words(signal).values()
    if known and not any(is_reverse(word) for word in known):
        raise s.table.error(
            f"{s.message}.{s.signal} has no word that is known to mean reverse ({', '.join(known)})",
            declared.SIGNAL.name,
            f"say which: {s.table.line(reverse=[TO_FILL_IN])}",
        )
    if not known and not _has_two_signs(s, signal):
        raise s.table.error(
            f"{s.message}.{s.signal} has neither words nor two signs to tell reverse by",
            declared.SIGNAL.name,
            f"say which of its values mean it: {s.table.line(reverse=[TO_FILL_IN])}",
        )
    return None


def _has_two_signs(s: Statement, signal: Signal) -> bool:
    """Whether a signal's field reaches below 0 and above it."""
    scale = signal.scale if s.scale is None else s.scale
    offset = signal.offset if s.offset is None else s.offset
    low, high = sorted(raw * scale + offset for raw in span(signal))
    return signal.is_float or low < 0 < high


def _timeout_us(s: Statement, message: Message, signal: Signal, design: Design) -> int:
    """After how long it is stale. Gyro and accelerometer run with the ticks: past three of them they are stale,
    whatever the DBC says."""
    key = declared.TIMEOUT.name
    cycle, stated = None, DEFAULT_TIMEOUT_MS
    try:
        cycle = cycle_ms(message)
        stated = timeout_ms(message, signal) or DEFAULT_TIMEOUT_MS
    except ValueError as e:
        if s.timeout_ms is None:
            raise s.table.error(
                str(e), declared.SIGNAL.name, f"mend the DBC, or {s.table.line(**{key: TO_FILL_IN})}"
            ) from None
    tick_ms = 1000 * design.tick_s
    measured = s.quantity in MEASURED
    if measured and cycle is not None and cycle > tick_ms:
        raise s.table.error(
            f"message {s.message} comes every {cycle} ms, slower than the design's tick of {tick_ms:g} ms",
            declared.SIGNAL.name,
            "a faster sensor, or a design of that tick by `sim-ecu design`",
        )
    most_us = round(STALE_TICKS * design.tick_s * 1e6)
    if s.timeout_ms is None:
        return most_us if measured else 1000 * stated
    if measured and 1000 * s.timeout_ms > most_us:
        raise s.table.error(f"{s.timeout_ms} ms is longer than three ticks of the design, {most_us / 1000:g} ms", key)
    if cycle is not None and s.timeout_ms <= cycle:
        raise s.table.error(f"{s.timeout_ms} ms is not longer than the cycle of {s.message}, {cycle} ms", key)
    return 1000 * s.timeout_ms
