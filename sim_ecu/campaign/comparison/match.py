"""Which rows of two campaigns belong to each other: inputs that differ as wholes, pairs, and what shares a world."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

from sim_ecu.campaign.comparison.read import Campaign
from wrcd.errors import InputError

Rows: TypeAlias = Sequence[Mapping[str, Any]]
_Made: TypeAlias = "tuple[Suite, list[list[Mapping[str, Any]]]]"
WHOLE = "all"  # the suite of a kind that has none


@dataclass(frozen=True, slots=True)
class Pair:
    """Rows of the same inputs, nearly always one of each side; of several the means are compared."""

    first: Rows
    second: Rows


@dataclass(frozen=True, slots=True)
class Suite:
    """What is compared together. pairs: empty where the sides share no world; then first and second are the worlds of
    each, with their rows. clusters: of each pair, which pairs share a world. by: what a world is, in words."""

    name: str
    pairs: Sequence[Pair]
    clusters: Sequence[int]
    first: Sequence[Rows]
    second: Sequence[Rows]
    by: str


@dataclass(frozen=True, slots=True)
class Match:
    """differ: inputs of which no value is on both sides, with the values of each. only: inputs that one side has.
    suites: those that both have. alone: rows of each side without any of the other beside them."""

    differ: Mapping[str, tuple[tuple[Any, ...], tuple[Any, ...]]]
    only: tuple[tuple[str, ...], tuple[str, ...]]
    suites: tuple[Suite, ...]
    alone: tuple[Rows, Rows]


def match(first: Campaign, second: Campaign) -> Match:
    """Raises InputError for campaigns that cannot be compared."""
    if first.kind != second.kind:
        raise InputError(f"is of the kind {second.kind}, and {first.folder} of {first.kind}", file=second.folder,
                         hint="compare two of one kind")  # fmt: skip
    both = [name for name in first.inputs if name in second.inputs]
    values = {n: (_values(first, n), _values(second, n)) for n in both if n != first.suite}
    differ = {n: v for n, v in values.items() if not set(v[0]) & set(v[1])}
    shared = [n for n in both if n not in differ]
    sides = [_by_suite(c.rows, first.suite) for c in (first, second)]
    names = [name for name in sides[0] if name in sides[1]]
    if not names:
        raise InputError(f"shares no {first.suite} with {first.folder}", file=second.folder,
                         hint=f"compare campaigns that have some {first.suite} in common")  # fmt: skip
    worlds = [n for n in first.cluster if n in both]
    maker = _samples if _separate(worlds, shared, first.suite) else _pairs
    made = [maker(name, sides[0][name], sides[1][name], shared, worlds) for name in names]
    alone = [[r for n, rows in side.items() if n not in names for r in rows] for side in sides]
    for _, left in made:
        for k in range(2):
            alone[k] += left[k]
    only = tuple(tuple(n for n in c.inputs if n not in both) for c in (first, second))
    return Match(differ, (only[0], only[1]), tuple(s for s, _ in made), (alone[0], alone[1]))


def _separate(worlds: Sequence[str], shared: Sequence[str], suite: str) -> bool:
    """Whether no world of one side is beside one of the other."""
    if worlds:
        return not any(n in shared for n in worlds)
    return not any(n != suite for n in shared)


def _pairs(name: str, first: Rows, second: Rows, shared: Sequence[str], worlds: Sequence[str]) -> _Made:
    sides = [_by(rows, shared) for rows in (first, second)]
    keys = [k for k in sides[0] if k in sides[1]]
    pairs = [Pair(sides[0][k], sides[1][k]) for k in keys]
    kept = [n for n in worlds if n in shared]
    place: dict[Any, int] = {}
    clusters = [place.setdefault(tuple(p.first[0][n] for n in kept), len(place)) for p in pairs]
    by = ", ".join(kept)
    if not worlds:
        clusters, by = list(range(len(pairs))), "pair"
    left = [[r for k, rows in side.items() if k not in set(keys) for r in rows] for side in sides]
    return Suite(name, pairs, clusters, (), (), by), left


def _samples(name: str, first: Rows, second: Rows, shared: Sequence[str], worlds: Sequence[str]) -> _Made:
    """Only points that both sides have; of a kind without worlds every row is one."""
    sides = [_by(rows, shared) for rows in (first, second)]
    kept = [[r for k, rows in sides[i].items() if k in sides[1 - i] for r in rows] for i in range(2)]
    left = [[r for k, rows in sides[i].items() if k not in sides[1 - i] for r in rows] for i in range(2)]
    units = [list(_by(rows, worlds).values()) if worlds else [[r] for r in rows] for rows in kept]
    return Suite(name, (), (), units[0], units[1], ", ".join(worlds) or "row"), left


def _values(c: Campaign, name: str) -> tuple[Any, ...]:
    return tuple(dict.fromkeys(r[name] for r in c.rows))


def _by_suite(rows: Rows, suite: str) -> dict[str, Rows]:
    return {WHOLE: rows} if not suite else {str(k[0]): v for k, v in _by(rows, [suite]).items()}


def _by(rows: Rows, names: Iterable[str]) -> dict[tuple[Any, ...], Rows]:
    out: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    names = list(names)
    for row in rows:
        out.setdefault(tuple(row[n] for n in names), []).append(row)
    return dict(out)
