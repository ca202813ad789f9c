"""Raw values of a signal: by number, or by a word of its value table."""

import math
from collections.abc import Iterable
from typing import Any

from wrcd.bus.dbc import Signal
from wrcd.bus.positions import MAX_BITS, span
from wrcd.config.section import Section, suggest


def words(signal: Signal) -> dict[int, str]:
    """The value table: raw value to word."""
    return {int(raw): str(word) for raw, word in (signal.choices or {}).items()}


def plain(word: str) -> str:
    """A word as letters and digits in lower case: Not_Available and "not available" are the same."""
    return "".join(c for c in word.casefold() if c.isalnum())


def raw_values(table: Section, key: str, signal: Signal, given: Iterable[int | str]) -> frozenset[int]:
    """The raw values that some numbers and words of the configuration mean. Raises InputError.

    A word may stand for several; a number may be the bit pattern of a negative value.
    """
    return frozenset(raw for one in given for raw in _raws(table, key, signal, one))


def raw_value(table: Section, key: str, signal: Signal, given: int | str) -> int:
    """The same of one that stands for one."""
    found = _raws(table, key, signal, given)
    if len(found) != 1:
        raise table.error(f"the value table of {signal.name} has {given!r} {len(found)} times", key, "give the number")
    return found[0]


def _raws(table: Section, key: str, signal: Signal, given: int | str) -> list[int]:
    known = words(signal)
    if isinstance(given, str):
        found = [raw for raw, word in known.items() if word == given]
        found = found or [raw for raw, word in known.items() if plain(word) == plain(given)]
        if not found:
            has = f"known: {', '.join(known.values())}" if known else "it has no value table: give the raw value"
            raise table.error(
                f"the value table of {signal.name} has no word {given!r}", key, suggest(given, known.values()) or has
            )
        return found
    lowest, highest = span(signal)
    if signal.is_signed and highest < given < 1 << signal.length:
        given -= 1 << signal.length
    if not signal.is_float and not lowest <= given <= highest:
        raise table.error(f"{given} is beyond the {signal.length} bits of {signal.name}", key)
    return [given]


def finite(x: Any) -> bool:
    """Whether a number of a DBC is one that can be used."""
    try:
        return math.isfinite(x)
    except OverflowError:  # a whole number beyond all floats
        return False


def usable_field(signal: Signal) -> bool:
    """Whether a frame can hold the signal, 64 bits at most, and its numbers are such."""
    numbers = (signal.scale, signal.offset, signal.minimum, signal.maximum, signal.raw_initial)
    return (
        signal.start >= 0
        and 1 <= signal.length <= MAX_BITS
        and bool(signal.scale)
        and all(x is None or finite(x) for x in numbers)
    )
