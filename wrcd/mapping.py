"""The names that a configuration gives, found in the DBC: which signals carry what, which messages to send."""

from wrcd.bus.codec import Writer
from wrcd.bus.dbc import (
    Database,
    check_encodable,
    check_readable,
    cycle_ms,
    data_id,
    find_message,
    find_signal,
    timeout_ms,
)
from wrcd.bus.signals import Output, OutputSignal, Source
from wrcd.bus.units import Quantity, factor
from wrcd.core.configuration import MAX_AXLES, AxleConfig, Input
from wrcd.core.messages import sendable
from wrcd.settings import Section, suggest

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
DEFAULT_TIMEOUT_MS = 100
ADHESION_NEEDS = ("Validity", "MuAvailable")
ADHESION_MS, DETAIL_MS, STATUS_MS = 20, 100, 1000  # cycles where the DBC says none
ROUNDED_DOWN = ("MuAvailable",)
STATUS_MESSAGES = ("WrcdStatus", "WrcdRejects", "WrcdLink")


def usual_messages(number: int) -> tuple[str, str, str]:
    """Names of what is sent for an axle unless the configuration names others: adhesion, detail, inputs."""
    return f"Adhesion_A{number}", f"AdhesionDetail_A{number}", f"InputHealth_A{number}"


def axle(table: Section, database: Database) -> AxleConfig:
    """One [[axle]]: its number, and what it sends. Raises InputError."""
    number = table.take("number", int)
    if not 1 <= number <= MAX_AXLES:
        raise table.error(f"takes 1 … {MAX_AXLES}, not {number}", "number")
    usual_adhesion, usual_detail, usual_inputs = usual_messages(number)
    adhesion = table.get("adhesion", str, usual_adhesion)
    return AxleConfig(
        number,
        _output(table, "adhesion", database, adhesion, ADHESION_MS, ADHESION_NEEDS),
        detail=optional(table, "detail", database, usual_detail, DETAIL_MS),
        inputs=optional(table, "inputs", database, usual_inputs, DETAIL_MS),
    )


def optional(section: Section, key: str, database: Database, usual: str, usual_ms: int) -> Output | None:
    """A message to send that may be left out: named, or the usual one where the DBC has it."""
    name = section.maybe(key, str)
    if name is None and any(m.name == usual for m in database.messages):
        name = usual
    return None if name is None else _output(section, key, database, name, usual_ms, ())


def inputs(
    section: Section, database: Database, quantities: tuple[Quantity, ...], axles: tuple[int, ...]
) -> list[Input]:
    """The quantities that a table maps, of some axles (places 0 … n-1). Raises InputError."""
    out = []
    for q in quantities:
        named = section.maybe(q.key, str)
        if named is None:
            if q in NEEDED:
                raise section.error("is missing", q.key, 'name the signal that carries it: "Message.Signal"')
            continue
        message_name, dot, signal_name = named.partition(".")
        if not dot:
            raise section.error(f"{named!r} is not of the form Message.Signal", q.key)
        try:
            message = find_message(database, message_name)
            signal = find_signal(message, signal_name)
            factor(signal.unit, q)
            data_id(message)
            timeout = timeout_ms(message, signal) or DEFAULT_TIMEOUT_MS
            check_readable(message)
        except KeyError as e:
            raise section.error(str(e.args[0]), q.key, _nearest(database, message_name, signal_name)) from None
        except ValueError as e:
            raise section.error(str(e), q.key, "map a signal with another unit, or mend the DBC") from None
        out.append(Input(Source(message_name, signal_name, q, axles), timeout * 1000))
    return out


def _nearest(database: Database, message: str, signal: str) -> str:
    every = {f"{m.name}.{s.name}" for m in database.messages for s in m.signals}
    return suggest(f"{message}.{signal}", every)


def _output(section: Section, key: str, database: Database, name: str, usual_ms: int, needs: tuple[str, ...]) -> Output:
    try:
        message = find_message(database, name)
        for needed in needs:
            find_signal(message, needed)
        signals = {s.name: OutputSignal(s.name, round_down=s.name in ROUNDED_DOWN) for s in message.signals}
        output = Output(name, 1000 * (cycle_ms(message) or usual_ms), data_id(message), signals)
        Writer(message, output)
        sendable(message)
        check_encodable(message)
        return output
    except KeyError as e:
        hint = suggest(name, [m.name for m in database.messages]) or f'give [[axle]] {key} = "…"'
        raise section.error(str(e.args[0]), key, hint) from None
    except ValueError as e:
        raise section.error(str(e), key) from None
