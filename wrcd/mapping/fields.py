"""One signal that is sent: whether its field can carry what is meant, and how."""

from wrcd import declared
from wrcd.bus.dbc import Message, Signal
from wrcd.bus.signals import OutputSignal
from wrcd.core.vocabulary import Numeric, Words, snake
from wrcd.keys import RawValue
from wrcd.mapping.values import plain, raw_value, span, words
from wrcd.section import TO_FILL_IN, Section

# Units of what is sent: theirs in ours.
UNITS = {
    "%": {"%": 1.0, "percent": 1.0, "pct": 1.0, "1": 100.0},
    "ms": {"ms": 1.0, "s": 1000.0},
    "dB": {"db": 1.0},
    "m": {"m": 1.0},
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
        usable = {"%": ("%", "1"), "": ("1",)}.get(carried.unit, (carried.unit, "s"))
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
        said = RawValue(snake(word), "").read(table)
        if said is not None:
            found[word] = raw_value(table, snake(word), signal, said)
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
