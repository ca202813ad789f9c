"""What each factor of CAMPAIGN.toml may be, checked against its kind; and which points of their space are requested."""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.stats import qmc

from sim_ecu.campaign.kind import Factor, Kind, Type
from sim_ecu.jobs.job import Scalar
from wrcd.config.keys import Choice, Flag, Key, Number, Text, Whole, names
from wrcd.config.section import Section, nearest
from wrcd.errors import InputError

FULL, RANDOM, LATIN = "full", "random", "latin"
METHODS = (FULL, RANDOM, LATIN)
MAX_POINTS, MAX_SEEDS, MAX_STEPS = 1_000_000, 1_000_000, 1_000_000
MAX_SEED = 4_000_000_000  # beyond any that a run is given by hand; the rig takes all from 0 on
MIN_LIMIT_S, MAX_LIMIT_S = 0.1, 1e6

TITLE = Text("title", "one line, for summary and comparison; default: the file's name")
KIND = Text("kind", "the kind of job, see below", needed=True)
METHOD = Choice(
    "method", "which points: `full` all combinations of the factors, `random` each drawn by itself, `latin` a Latin "
    "hypercube: every factor's values spread evenly", METHODS, FULL,
)  # fmt: skip
POINTS = Whole("points", "how many points `random` and `latin` draw; not of `full`", 1, MAX_POINTS)
DRAW = Whole(
    "draw", "which ones those are: another number draws others, whatever the seeds; not of `full`", 0, MAX_SEED, 1
)
SEEDS = Whole("seeds", "runs of each point, each with a seed of its own", 1, MAX_SEEDS, 1)
FIRST_SEED = Whole(
    "first_seed", "the seed of a point's first run; the next have the next. The points stay the same", 0, MAX_SEED, 1
)
LIMIT = Number("limit_s", "a job that takes longer, in seconds, is ended and reported", MIN_LIMIT_S, MAX_LIMIT_S)
HEAD: tuple[Key, ...] = (TITLE, KIND, METHOD, POINTS, DRAW, SEEDS, FIRST_SEED, LIMIT)

LOW = Number("from", "the first value", -math.inf, math.inf)
HIGH = Number("to", "the last value", -math.inf, math.inf)
STEPS = Whole("steps", "needed with `full`: how many values, both ends among them", 2, MAX_STEPS)
LOG = Flag("log", "evenly by their logarithm", False)
WHOLE = Flag("whole", "whole numbers; a factor that takes whole numbers has no others", False)
RANGE: tuple[Key, ...] = (LOW, HIGH, STEPS, LOG, WHOLE)

Point: TypeAlias = dict[str, Scalar]
DIGITS = 9  # of a value that is drawn: enough for any quantity, and written the same everywhere


@dataclass(frozen=True, slots=True)
class Values:
    """A factor's values, listed."""

    type: Type
    values: tuple[Scalar, ...]

    def at(self, share: float) -> Scalar:
        """The value of a share (0 to 1, 1 not among them) of the list: each as likely."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def every(self) -> tuple[Scalar, ...]:
        """All."""
        return self.values


@dataclass(frozen=True, slots=True)
class Range:
    """A factor's numbers between two ends, evenly or (log) evenly by their logarithm. steps: of a full factorial."""

    low: float
    high: float
    steps: int = 0
    log: bool = False
    type: Type = Type.NUMBER

    def at(self, share: float) -> Scalar:
        """The value of a share (0 to 1) of the way."""
        if self.type is Type.WHOLE:
            return int(min(np.floor(self.low + share * (self.high - self.low + 1)), self.high))
        way = self.high - self.low
        exact = self.low * (self.high / self.low) ** share if self.log else self.low + share * way
        return min(max(float(f"{exact:.{DIGITS}g}"), self.low), self.high)

    def every(self) -> tuple[Scalar, ...]:
        """The steps, both ends among them."""
        shares = np.linspace(0.0, 1.0, self.steps)
        if self.type is Type.WHOLE:
            return tuple(int(v) for v in np.unique(np.round(self.low + shares * (self.high - self.low))))
        return tuple(self.at(float(s)) for s in shares)


Spread: TypeAlias = Values | Range


def full(factors: Mapping[str, Spread]) -> Iterator[Point]:
    """Every combination; the last factor changes fastest."""
    names = list(factors)
    for values in itertools.product(*(factors[n].every() for n in names)):
        yield dict(zip(names, values, strict=True))


def drawn(factors: Mapping[str, Spread], method: str, count: int, seed: int) -> Iterator[Point]:
    """So many points: each by itself (RANDOM), or such that every factor's values are spread evenly (LATIN)."""
    rng, names = np.random.default_rng(seed), list(factors)
    n = len(names)
    shares = rng.random((count, n)) if method == RANDOM else qmc.LatinHypercube(n, rng=rng).random(count)
    for row in shares.tolist():
        yield {name: factors[name].at(share) for name, share in zip(names, row, strict=True)}


SEED = "seed"
RANGE_KEYS = names(RANGE)
_OF = {bool: Type.FLAG, int: Type.WHOLE, float: Type.NUMBER, str: Type.TEXT}


def read_factors(top: Section, kind: Kind, stepped: bool) -> tuple[dict[str, Spread], dict[str, Spread]]:
    """Those that stay and those that vary, in the file's order. stepped: a range has steps (a full factorial).

    Mistakes are collected; a factor that has one is left out.
    """
    fixed_table, varied_table = top.section("fixed"), top.section("factor")
    fixed: dict[str, Spread] = {}
    for section, key, name in _keys(fixed_table, kind):
        with section.collected():
            if name in fixed:
                raise _twice(section, key, name)
            fixed[name] = _values(section, key, _factor(section, key, name, kind), [section.raw(key)])
    varied: dict[str, Spread] = {}
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


def _varied(section: Section, key: str, factor: Factor | None, stepped: bool) -> Spread:
    value = section.raw(key)
    if isinstance(value, dict):
        return _range(section.section(key), key, section, factor, stepped)
    if not isinstance(value, list):
        raise section.error("takes a list of values, or { from, to, steps }", key, "what does not vary is of [fixed]")
    if not value:
        raise section.error("takes one value at least, not an empty list", key)
    found = _values(section, key, factor, value)
    every = found.every()
    twice = next((v for k, v in enumerate(every) if v in every[:k]), None)
    if twice is not None:
        raise section.error(f"has {twice!r} twice", key, "each value once")
    return found


def _values(section: Section, key: str, factor: Factor | None, values: Iterable[Any]) -> Spread:
    every = list(values)
    if factor is not None:
        try:
            return Values(factor.type, tuple(_finite(factor.check(v)) for v in every))
        except InputError as e:
            raise section.error(e.reason, key, e.hint) from None
    types = {type(v) for v in every}
    if types == {int, float}:
        types, every = {float}, [float(v) for v in every]
    if len(types) != 1 or not types <= set(_OF):
        raise section.error("takes numbers, strings or true and false, all of one type", key)
    try:
        return Values(_OF[types.pop()], tuple(_finite(v) for v in every))
    except InputError as e:
        raise section.error(e.reason, key) from None


def _finite(value: Scalar) -> Scalar:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"takes a finite number, not {value}")
    return value


def _range(table: Section, key: str, around: Section, factor: Factor | None, stepped: bool) -> Spread:
    low, high = table.take(LOW.name, float), table.take(HIGH.name, float)
    whole = table.get(WHOLE.name, bool, factor is not None and factor.type is Type.WHOLE)
    log = table.get(LOG.name, bool, False)
    steps = STEPS.read(table)
    if stepped and STEPS.name not in table:
        table.mistake(table.absent(STEPS.name, "how many values from end to end: 2 or more"))
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
    return Range(low, high, steps or 0, log, Type.WHOLE if whole else Type.NUMBER)
