"""Inputs: what the configuration says of them, over what the DBC says; whether a train fits into their ranges."""

import math

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
from wrcd.bus.positions import MAX_BITS, Branch, branch, span
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import Quantity, factor
from wrcd.bus.words import is_reverse
from wrcd.config import declared
from wrcd.config.raw_values import raw_values, usable_field, words
from wrcd.config.section import TO_FILL_IN, Section, suggest
from wrcd.config.statements import TORQUES, Statement
from wrcd.core.configuration import LOAD_SHARES, RADIUS_SHARES, Input
from wrcd.core.design import Design

FLOAT_BITS = (32, 64)
STALE_TICKS = 3  # of gyro and accelerometer: two may be missing
MEASURED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)


def resolve(
    s: Statement, database: Database, design: Design, statuses: tuple[StatusRule, ...], pgn: bool
) -> Input | None:
    """One input; None where a value of its table is wrong, which is reported already. pgn: its message is a group.
    Raises InputError."""
    key = declared.SIGNAL.name
    message, signal = find(s.table, key, database, s.message, s.signal)
    try:
        check_readable(message, signal)
    except ValueError as e:
        raise s.table.error(str(e), key) from None
    if s.given.pgn and not message.is_extended_frame:
        raise s.table.error(f"{s.message} has a standard id, which is of no parameter group", declared.PGN.name)
    if s.wrong:
        return None
    to_si = _factor(s, signal, design)
    low, high = physical_range(s, message, signal, to_si, design)
    resolved = {
        "factor": to_si if _is_own(s) else None, "low": low, "high": high, "statuses": statuses,
        "invalid": raw_values(s.table, declared.INVALID.name, signal, s.given.invalid or ()),
        "reverse": _reverse(s, signal), "pgn": pgn and message.is_extended_frame,
    }  # fmt: skip
    as_given = {name: value for name, value in s.given._asdict().items() if name in Source.__slots__}
    source = Source(s.message, s.signal, s.quantity, s.axles, part=s.part, **(as_given | resolved))
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
    selecting = [find_signal(message, name) for name, _, _ in branch(message, signal.name).conditions]
    for s in (signal, *selecting):
        if s.length > MAX_BITS:
            raise ValueError(f"{message.name}.{s.name} has {s.length} bits, at most {MAX_BITS} are read")
    if not usable_field(signal):
        raise ValueError(f"{message.name}.{signal.name} has bits that no frame has, or numbers that are none")


def _factor(s: Statement, signal: Signal, design: Design) -> float:
    """From the signal's unit to SI units at the axle."""
    unit = signal.unit if s.given.unit is None else s.given.unit
    to_si = _at_rim(s, unit) * design.r_0 if s.given.at == "rim" else _to_si(s, unit)
    return to_si * s.given.sign * (s.given.gear_ratio or 1.0) * s.given.share


def _is_own(s: Statement) -> bool:
    """Whether the configuration says more of the factor than the DBC's unit."""
    return s.given.unit is not None or s.given.sign != 1 or s.given.at != "axle" or s.given.share != 1.0


def _to_si(s: Statement, unit: str | None) -> float:
    try:
        return factor(unit, s.quantity)
    except ValueError as e:
        if s.given.unit is not None:
            raise s.table.error(str(e), declared.UNIT.name) from None
        hint = "" if s.quantity not in TORQUES else ', or at = "rim" for a force'
        what = str(e) if unit else "the DBC states no unit" + str(e)[str(e).rindex(" (known") :]
        raise s.table.error(
            f"{s.message}.{s.signal}: {what}",
            declared.SIGNAL.name,
            f"{s.table.line(unit=TO_FILL_IN)}{hint}",
        ) from None


def _at_rim(s: Statement, unit: str | None) -> float:
    key = declared.SIGNAL.name if s.given.unit is None else declared.UNIT.name
    try:
        return factor(unit, Quantity.AXLE_LOAD)
    except ValueError as e:
        raise s.table.error(str(e), key, f"a force at the rim is in N or kN: {s.table.line(unit='kN')}") from None


def _reverse(s: Statement, signal: Signal) -> frozenset[int] | None:
    """The raw values of a direction that mean reverse; None: by the DBC's words, or by the sign where it has none."""
    if s.quantity is not Quantity.DIRECTION:
        return None
    if s.given.reverse is not None:
        return raw_values(s.table, declared.REVERSE.name, signal, s.given.reverse)
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
    scale = signal.scale if s.given.scale is None else s.given.scale
    offset = signal.offset if s.given.offset is None else s.given.offset
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
        if s.given.timeout_ms is None:
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
    if s.given.timeout_ms is None:
        return most_us if measured else 1000 * stated
    if measured and 1000 * s.given.timeout_ms > most_us:
        raise s.table.error(
            f"{s.given.timeout_ms} ms is longer than three ticks of the design, {most_us / 1000:g} ms", key
        )
    if cycle is not None and s.given.timeout_ms <= cycle:
        raise s.table.error(f"{s.given.timeout_ms} ms is not longer than the cycle of {s.message}, {cycle} ms", key)
    return 1000 * s.given.timeout_ms


YAW_RAD_S, LAT_M_S2 = 0.35, 20.0  # what a wheelset that hunts reaches: 20 deg/s, 2 g
EPSILON = 1e-6  # of a step: what is lost in the division
MU = 0.5  # adhesion that a torque may use


def physical_range(
    s: Statement, message: Message, signal: Signal, to_si: float, design: Design
) -> tuple[float | None, float | None]:
    """Return the physical range where it is not the DBC's, else (None, None).

    Raises InputError for one of the DBC's that shuts out most raw values, and values that a train reaches.
    """
    scale = float(signal.scale if s.given.scale is None else s.given.scale)
    offset = float(signal.offset if s.given.offset is None else s.given.offset)
    own_scale = s.given.scale is not None or s.given.offset is not None
    low, high = s.given.range or (signal.minimum, signal.maximum)
    if s.given.range is None and own_scale:
        # the DBC's range is in its own unit: of the same raw values
        ends = [None if x is None else float((x - signal.offset) / signal.scale * scale + offset) for x in (low, high)]
        low, high = ends if scale * signal.scale > 0 else ends[::-1]
    given = (low, high) if s.given.range or own_scale else (None, None)
    if signal.is_float or s.quantity is Quantity.DIRECTION:
        return given
    if low is not None and high is not None and low > high:
        raise s.table.error(
            f"the DBC's range of {s.message}.{s.signal} is empty, [{signal.minimum}|{signal.maximum}]",
            declared.SIGNAL.name,
            f"mend the DBC, or say what it measures: {s.table.line(range=[TO_FILL_IN, TO_FILL_IN])}",
        )
    lowest, highest = span(signal)
    share = _inside(signal, scale, offset, low, high) / (highest - lowest + 1)
    if s.given.range is not None:
        if not share:
            raise s.table.error(
                f"no raw value of {s.message}.{s.signal} lies within {low:g} … {high:g}", declared.RANGE.name
            )
        return given
    if share < 0.5:
        needed = _needed(s, signal, design)
        if not _reaches(low, high, to_si, needed):
            reached = [float(f"{x / abs(to_si):.3g}") for x in needed]
            raise s.table.error(
                f"the DBC's range of {s.message}.{s.signal}, [{signal.minimum}|{signal.maximum}], shuts out "
                f"{math.floor(100 * (1 - share))} % of its raw values, and values that a train reaches",
                declared.SIGNAL.name,
                f"mend the DBC, or say what it measures, at least this: {s.table.line(range=reached)}",
            )
    return given


def _needed(s: Statement, signal: Signal, d: Design) -> tuple[float, float]:
    """What a train reaches of a quantity, in SI units. A torque that is never negative drives or brakes only."""
    torque = MU * 2 * d.normal_N * d.r_0 * s.given.share
    load, radius = 2 * d.normal_N, d.r_0
    return {
        Quantity.YAW_RATE: (-YAW_RAD_S, YAW_RAD_S),
        Quantity.LAT_ACCEL: (-LAT_M_S2, LAT_M_S2),
        Quantity.TORQUE: (-torque if signal.is_signed else 0.0, torque),
        Quantity.BRAKE_TORQUE: (0.0, torque),
        Quantity.SPEED: (0.0, float(d.speeds_m_s[-1])),
        Quantity.AXLE_LOAD: (load * LOAD_SHARES[0], load * LOAD_SHARES[1]),
        Quantity.WHEEL_RADIUS: (radius * RADIUS_SHARES[0], radius * RADIUS_SHARES[1]),
    }[s.quantity]


def _reaches(low: float | None, high: float | None, to_si: float, needed: tuple[float, float]) -> bool:
    """Whether a range holds what is needed, either way round: a brake's sign is not known here."""
    if low is None or high is None:
        return False
    first, last = sorted((low * to_si, high * to_si))
    return any(first <= a and b <= last for a, b in (needed, (-needed[1], -needed[0])))


def _inside(signal: Signal, scale: float, offset: float, low: float | None, high: float | None) -> int:
    """How many raw values of a field are within a physical range, or half a step beyond."""
    lowest, highest = span(signal)
    ends = []
    for x, end in ((low, lowest if scale > 0 else highest), (high, highest if scale > 0 else lowest)):
        raw = float(end) if x is None else (x - offset) / scale
        ends.append(
            min(max(raw, lowest - 1.0), highest + 1.0)
        )  # a raw value beyond the field may be beyond all numbers
    first, last = math.ceil(min(ends) - 0.5 - EPSILON), math.floor(max(ends) + 0.5 + EPSILON)
    return max(min(last, highest) - max(first, lowest) + 1, 0)


def check_pace(s: Statement, database: Database, design: Design, warnings: list[str]) -> None:
    """A gyro or accelerometer is needed in every tick. Of a multiplexed one that is reported, with what the DBC's cycle
    makes of it: whether its branches take turns or all come in each cycle, no DBC says."""
    message = find_message(database, s.message)
    of = branch(message, s.signal)
    if s.quantity not in MEASURED or not of.conditions:
        return
    tick_ms = 1000 * design.tick_s
    cycle, frames = cycle_ms(message), frames_for_one(message, of)
    name = f"{s.message}.{s.signal}"
    turns = f" ({cycle * frames:g} ms where they take turns)" if cycle is not None and cycle * frames > tick_ms else ""
    warnings.append(
        f"{name} is multiplexed: it comes only in frames with {of}{turns}, and is needed every {tick_ms:g} ms"
    )


def frames_for_one(message: Message, of: Branch) -> float:
    """Of how many frames one is of a branch, where the multiplexers' values take turns."""
    return math.prod(len(_values(message, name)) / max(1, len(ids)) for name, _, ids in of.conditions)


def _values(message: Message, multiplexer: str) -> set[int]:
    """The values of a multiplexer that have signals."""
    return {k for x in message.signals if x.multiplexer_signal == multiplexer for k in x.multiplexer_ids or ()}
