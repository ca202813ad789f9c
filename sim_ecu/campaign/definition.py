"""CAMPAIGN.toml: what is asked, as jobs whose inputs are checked."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from sim_ecu.campaign.kind import WORDS, Factor, Job, Kind, Scalar, Type
from sim_ecu.campaign.kinds.drive import DRIVE
from sim_ecu.campaign.kinds.log import LOG
from sim_ecu.campaign.kinds.play_kind import PLAY
from sim_ecu.campaign.kinds.score import SCORE
from sim_ecu.jobs.digests import digest, key_of
from sim_ecu.jobs.pool import LIMIT_S
from wrcd.config.keys import Choice, Number, Text, Whole
from wrcd.config.section import Section, suggest
from wrcd.config.settings import read_toml
from wrcd.errors import InputError
from wrcd.progress import Progress

KINDS: tuple[Kind, ...] = (DRIVE, PLAY, SCORE, LOG)
FULL, RANDOM, LATIN = "full", "random", "latin"
SEED = "seed"
MANY = 1_000_000
MAX_SEED = 4_000_000_000  # beyond any that a run is given by hand; the rig takes all from 0 on
TITLE, KIND = Text("title", ""), Text("kind", "", needed=True)
METHOD = Choice("method", "", (FULL, RANDOM, LATIN), FULL)
POINTS, DRAW = Whole("points", "", 1, MANY), Whole("draw", "", 0, MAX_SEED, 1)
SEEDS, FIRST_SEED = Whole("seeds", "", 1, MANY, 1), Whole("first_seed", "", 0, MAX_SEED, 1)
LIMIT = Number("limit_s", "", 0.1, 1e6, LIMIT_S)
STEPS = Whole("steps", "", 2, MANY)
RANGE = ("from", "to", "steps", "log", "whole")
# the type of a factor that is not listed, by those of its values in the file
OPEN = {frozenset({of}): of for of in WORDS} | {frozenset({int, float}): float}
DIGITS = 9  # of a value that is drawn: enough for any quantity, and written the same everywhere
Point: TypeAlias = dict[str, Scalar]


@dataclass(frozen=True, slots=True)
class FactorValues:
    """A factor's values: a list of them, or numbers from low to high, evenly or (log) evenly by their logarithm."""

    type: Type
    values: Sequence[Scalar] = ()
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def at(self, share: float) -> Scalar:
        """Return the value at a share (0 to 1) of the list or the way."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        way = self.high - self.low
        if self.type is int:
            return int(min(np.floor(self.low + share * (way + 1)), self.high))
        exact = self.low * (self.high / self.low) ** share if self.log else self.low + share * way
        return min(max(float(f"{exact:.{DIGITS}g}"), self.low), self.high)


@dataclass(frozen=True, slots=True)
class Campaign:
    """What is asked. columns: the jobs' inputs with their types. drops: rows that are not asked for any more go."""

    title: str
    kind: Kind
    columns: Mapping[str, Type]
    jobs: Sequence[Job]
    folder: Path
    limit_s: float
    drops: bool = False


def load_campaign(file: Path) -> Campaign:
    """Read and check everything: the file, then every point as its kind can. Raises InputError, or InputErrors with all
    mistakes of the file."""
    top, folder = read_toml(file, collect=True), file.parent.resolve()
    name, known = KIND.value(top), {k.name: k for k in KINDS}
    if name not in known:  # nothing else can be read
        raise top.error(f"is {name!r}, which is no kind", "kind", suggest(name, known) or f"kinds: {', '.join(known)}")
    kind, method, title, limit_s = known[name], METHOD.value(top), TITLE.read(top) or file.stem, LIMIT.value(top)
    # what the method or the kind has not is an unknown key
    count, draw = (0, 0) if method == FULL else (POINTS.read(top) or 0, DRAW.value(top))
    first, many = (FIRST_SEED.value(top), SEEDS.value(top)) if kind.seeded else (0, 0)
    if method != FULL and POINTS.name not in top:
        top.mistake(top.absent(POINTS.name, "how many points to draw"))
    fixed, varied = _factors(top, kind, method == FULL)
    top.done()
    top.finish()
    runs = max(many, 1) * (count or math.prod(len(s.values) for s in varied.values()))
    if runs > MANY:
        raise top.error(f"there are {runs} jobs, more than {MANY}", hint="fewer values, or method latin")
    stays = {name: spread.values[0] for name, spread in fixed.items()}
    once = {tuple(p.items()): stays | p for p in _drawn(varied, method, count, draw)}
    jobs: list[Job] = []
    progress = Progress()
    for number, point in enumerate(once.values()):
        progress.at(f"checking point {number} of {len(once)}", number / len(once))
        try:
            for inputs in kind.points(kind.placed(point, folder)):
                jobs += jobs_of(kind, {**inputs, **point}, folder, range(first, first + many))
        except InputError as e:
            progress.end()
            if e.file is not None:
                raise
            table = next((t for t in (top.section("factor"), top.section("fixed")) if e.key in t), top)
            raise table.error(f"{e.reason} (at {as_words(point)})", e.key or None, e.hint) from None
    progress.end()
    types = {f.name: f.type for f in kind.factors} | {SEED: int}
    types |= {name: spread.type for name, spread in (fixed | varied).items()}
    return Campaign(title, kind, {name: types[name] for name in jobs[0].inputs}, jobs, folder, limit_s)


def jobs_of(kind: Kind, point: Point, folder: Path, seeds: Sequence[int] = ()) -> Iterator[Job]:
    """Yield the jobs of a point, one for each seed. It is checked with the first: the others are like it."""
    runs = [{**point, SEED: seed} for seed in seeds] or [point]
    first = kind.placed(runs[0], folder)
    paths = kind.own_files(first) | dict(kind.named(first))
    contents, cost = {name: digest(path) for name, path in paths.items()}, kind.check(first)
    files = {str(path.resolve()): contents[name] for name, path in paths.items()}
    for inputs in runs:
        key = key_of({"kind": kind.name, "inputs": inputs, "files": contents})
        yield Job(key, inputs, kind.placed(inputs, folder), files, cost, kind.function)


def as_words(inputs: Mapping[str, Any]) -> str:
    """Return a job's inputs in a line, for a person."""
    return ", ".join(f"{n} = {v:.6g}" if isinstance(v, float) else f"{n} = {v}" for n, v in inputs.items())


def _drawn(varied: Mapping[str, FactorValues], method: str, count: int, draw: int) -> Iterator[Point]:
    """Yield the points that the method asks for; of all combinations the last factor changes fastest."""
    if method == FULL or not varied:
        for values in itertools.product(*(spread.values for spread in varied.values())):
            yield dict(zip(varied, values, strict=True))
        return
    rng, n = np.random.default_rng(draw), len(varied)
    if method == RANDOM:
        shares = rng.random((count, n))
    else:
        from scipy.stats import qmc  # half a second, here and in every worker

        shares = qmc.LatinHypercube(n, rng=rng).random(count)
    for row in shares.tolist():
        yield {name: spread.at(share) for (name, spread), share in zip(varied.items(), row, strict=True)}


def _factors(top: Section, kind: Kind, stepped: bool) -> tuple[dict[str, FactorValues], dict[str, FactorValues]]:
    """Read those that stay and those that vary, in the file's order. stepped: a range has steps (a full factorial)."""
    found: dict[str, dict[str, FactorValues]] = {"fixed": {}, "factor": {}}
    seen: set[str] = set()
    for table, into in found.items():
        for section, key, name in _keys(top.section(table), kind):
            with section.collected():
                if name in seen:
                    raise section.error("stands there twice", key, "keep one of them")
                seen.add(name)
                factor, value = _factor(section, key, name, kind), section.raw(key)
                if table == "fixed":
                    into[name] = _listed(section, key, factor, [value])
                elif isinstance(value, dict):
                    into[name] = _range(section.section(key), key, section, factor, stepped)
                elif isinstance(value, list) and value:
                    into[name] = _listed(section, key, factor, value)
                else:
                    hint = "what does not vary is of [fixed]"
                    raise section.error("takes a list of values, or { from, to, steps }", key, hint)
    for f in kind.factors:
        if f.needed and f.name not in seen:
            top.mistake(top.error("is missing", f"factor.{f.name}", f"it takes {WORDS[f.type]}"))
    return found["fixed"], found["factor"]


def _keys(table: Section, kind: Kind) -> Iterator[tuple[Section, str, str]]:
    """Table, key there and the factor's name. scenario.speed_m_s may be written without quotes, which TOML nests."""
    for key in table:
        value = table.raw(key)
        if f"{key}." in kind.open_factors and isinstance(value, dict) and not set(value) <= set(RANGE):
            inner = table.section(key)
            yield from ((inner, k, f"{key}.{k}") for k in inner)
        else:
            yield table, key, key


def _factor(section: Section, key: str, name: str, kind: Kind) -> Factor | None:
    """The kind's; None for one that is open. Raises InputError for one that is not known."""
    if name in (SEED, *(f"{prefix}{SEED}" for prefix in kind.open_factors)):
        raise section.error("is the campaign's own", key, "write seeds and first_seed, above the tables")
    known = {f.name: f for f in kind.factors}
    if name not in known and not any(name.startswith(prefix) and name != prefix for prefix in kind.open_factors):
        every = ", ".join([*known, *(f"{prefix}KEY" for prefix in kind.open_factors)])
        raise section.error(f"is no factor of {kind.name}", key, f"it has {every}")
    return known.get(name)


def _listed(section: Section, key: str, factor: Factor | None, values: Sequence[Any]) -> FactorValues:
    of = OPEN.get(frozenset(map(type, values))) if factor is None else factor.type
    if of is None:
        raise section.error("takes numbers, strings or true and false, all of one type", key)
    try:
        found = tuple((factor or Factor(key, of)).check(v) for v in values)
    except InputError as e:
        raise section.error(e.reason, key, e.hint) from None
    if any(isinstance(v, float) and not math.isfinite(v) for v in found) or len(set(found)) < len(found):
        raise section.error("takes finite values, each once", key)
    return FactorValues(of, found)


def _range(table: Section, key: str, around: Section, factor: Factor | None, stepped: bool) -> FactorValues:
    low, high, steps = table.take("from", float), table.take("to", float), STEPS.read(table)
    whole = table.get("whole", bool, factor is not None and factor.type is int)
    log = table.get("log", bool, False)
    if stepped and not steps:
        table.mistake(table.absent(STEPS.name, "how many values from end to end: 2 or more"))
    table.done(RANGE)
    of = int if whole else float
    if factor is not None and factor.type is not of:
        raise around.error(f"takes {WORDS[factor.type]}, and no range of {WORDS[of]}", key, "or list the values")
    if low >= high or (log and low <= 0):
        raise table.error(f"takes from < to, and for a logarithm 0 < from, not {low:g} and {high:g}", "from")
    if whole and (log or not (low.is_integer() and high.is_integer())):
        raise around.error("takes whole ends and no logarithm, being whole", key, "or list the values")
    spread, shares = FactorValues(of, (), low, high, log), np.linspace(0.0, 1.0, steps or 1)
    if not stepped:
        return spread
    if whole:
        return FactorValues(of, [int(v) for v in np.unique(np.round(low + shares * (high - low)))])
    return FactorValues(of, [spread.at(share) for share in shares.tolist()])
