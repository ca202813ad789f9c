"""[fixed] and [factor] of a campaign's file: what each factor may be, checked against its kind."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from sim_ecu.campaign import keys
from sim_ecu.campaign.job import Scalar
from sim_ecu.campaign.kind import Factor, Kind, Type
from sim_ecu.campaign.points import Range, Spread, Values
from wrcd.errors import InputError
from wrcd.keys import names
from wrcd.section import Section, nearest

SEED = "seed"
RANGE_KEYS = names(keys.RANGE)
_OF = {bool: Type.FLAG, int: Type.WHOLE, float: Type.NUMBER, str: Type.TEXT}


@dataclass(frozen=True, slots=True)
class Given:
    """A factor as a campaign gives it: its type, and the values or the range that it takes."""

    type: Type
    spread: Spread


def read_factors(top: Section, kind: Kind, stepped: bool) -> tuple[dict[str, Given], dict[str, Given]]:
    """Those that stay and those that vary, in the file's order. stepped: a range has steps (a full factorial).

    Mistakes are collected; a factor that has one is left out.
    """
    fixed_table, varied_table = top.section("fixed"), top.section("factor")
    fixed: dict[str, Given] = {}
    for section, key, name in _keys(fixed_table, kind):
        with section.collected():
            if name in fixed:
                raise _twice(section, key, name)
            fixed[name] = _values(section, key, _factor(section, key, name, kind), [section.raw(key)])
    varied: dict[str, Given] = {}
    for section, key, name in _keys(varied_table, kind):
        with section.collected():
            if name in fixed:
                raise section.error("stands in [fixed], too", key, "keep one of them")
            if name in varied:
                raise _twice(section, key, name)
            varied[name] = _varied(section, key, _factor(section, key, name, kind), stepped)
    given = {name for t in (fixed_table, varied_table) for _, _, name in _keys(t, kind)}
    for factor in kind.factors:
        if factor.needed and factor.name not in given:
            top.mistake(
                top.error("is missing", f"factor.{factor.name}", f"it takes {factor.type.value}: {factor.words}")
            )
    return fixed, varied


def _twice(section: Section, key: str, name: str) -> InputError:
    return section.error(f"stands in this table twice, as {name} and with quotes", key, "keep one of them")


def _keys(table: Section, kind: Kind) -> Iterator[tuple[Section, str, str]]:
    """Table, key there and the factor's name. scenario.speed_m_s may be written without quotes, which TOML nests."""
    for key in table:
        prefix = f"{key}."
        value = table.raw(key)
        if prefix in kind.open_factors and isinstance(value, dict) and not set(value) <= set(RANGE_KEYS):
            inner = table.section(key)
            yield from ((inner, k, prefix + k) for k in inner)
        else:
            yield table, key, key


def _factor(section: Section, key: str, name: str, kind: Kind) -> Factor | None:
    """The kind's; None for one that is open. Raises InputError for one that is not known."""
    if name == SEED:
        raise section.error("is the campaign's own", key, "write seeds and first_seed, above the tables")
    found = kind.factor(name)
    if found is None and not any(name.startswith(prefix) and name != prefix for prefix in kind.open_factors):
        known = [f.name for f in kind.factors]
        near = nearest(name, known)
        also = f", and {', '.join(p + 'KEY' for p in kind.open_factors)}" if kind.open_factors else ""
        hint = f"did you mean {near!r}?" if near else f"{kind.name} has {', '.join(known)}{also}"
        raise section.error(f"is no factor of {kind.name}", key, hint)
    return found


def _varied(section: Section, key: str, factor: Factor | None, stepped: bool) -> Given:
    value = section.raw(key)
    if isinstance(value, dict):
        return _range(section.section(key), key, section, factor, stepped)
    if not isinstance(value, list):
        raise section.error("takes a list of values, or { from, to, steps }", key, "what does not vary is of [fixed]")
    if not value:
        raise section.error("takes one value at least, not an empty list", key)
    found = _values(section, key, factor, value)
    every = found.spread.every()
    twice = next((v for k, v in enumerate(every) if v in every[:k]), None)
    if twice is not None:
        raise section.error(f"has {twice!r} twice", key, "each value once")
    return found


def _values(section: Section, key: str, factor: Factor | None, values: Iterable[Any]) -> Given:
    every = list(values)
    if factor is not None:
        try:
            return Given(factor.type, Values(tuple(_finite(factor.check(v)) for v in every)))
        except InputError as e:
            raise section.error(e.reason, key, e.hint) from None
    types = {type(v) for v in every}
    if types == {int, float}:
        types, every = {float}, [float(v) for v in every]
    if len(types) != 1 or not types <= set(_OF):
        raise section.error("takes numbers, strings or true and false, all of one type", key)
    try:
        return Given(_OF[types.pop()], Values(tuple(_finite(v) for v in every)))
    except InputError as e:
        raise section.error(e.reason, key) from None


def _finite(value: Scalar) -> Scalar:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"takes a finite number, not {value}")
    return value


def _range(table: Section, key: str, around: Section, factor: Factor | None, stepped: bool) -> Given:
    low, high = table.take(keys.LOW.name, float), table.take(keys.HIGH.name, float)
    whole = table.get(keys.WHOLE.name, bool, factor is not None and factor.type is Type.WHOLE)
    log = table.get(keys.LOG.name, bool, False)
    steps = keys.STEPS.read(table)
    if stepped and keys.STEPS.name not in table:
        table.mistake(table.absent(keys.STEPS.name, "how many values from end to end: 2 or more"))
    table.done(RANGE_KEYS)
    if factor is not None and factor.type not in (Type.NUMBER, Type.WHOLE):
        raise around.error(f"takes {factor.type.value}, and no range", key, "list the values")
    if factor is not None and whole != (factor.type is Type.WHOLE):
        raise table.error(f"{around.name}.{key} takes {factor.type.value}", "whole")
    if low >= high:
        raise table.error(f"takes more than from ({low:g}), not {high:g}", "to")
    if log and low <= 0:
        raise table.error(f"of a logarithm takes more than 0, not {low:g}", "from")
    if whole and not (low.is_integer() and high.is_integer()):
        raise around.error("takes whole ends, being whole", key)
    if whole and log:
        raise table.error("goes not with whole", "log", "list the values")
    return Given(Type.WHOLE if whole else Type.NUMBER, Range(low, high, steps or 0, log, whole))


def spreads(given: Mapping[str, Given]) -> dict[str, Spread]:
    """By name, for the points."""
    return {name: g.spread for name, g in given.items()}
