"""The jobs that differ most, each way, and how to run them again."""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim_ecu.campaign.comparison.compare import Comparison, Result
from sim_ecu.campaign.comparison.match import Pair, Suite
from sim_ecu.campaign.comparison.read import Campaign
from sim_ecu.campaign.job import Ending, Scalar

MAX_JOBS = 10
SEED = "seed"


@dataclass(frozen=True, slots=True)
class Worst:
    """A job that is worse on one side. figure: by which; "ending" where only one side is done. size: the difference,
    in the figure's spread over the suite. first, second: NaN, or "" of endings, where there is no row of that side.

    inputs: of the worse side; others: those of the other side that differ. toml: a CAMPAIGN.toml of this job alone.
    """

    suite: str
    figure: str
    first: float | str
    second: float | str
    size: float
    inputs: Mapping[str, Scalar]
    toml: str


def worst(result: Result) -> tuple[list[Worst], list[Worst]]:
    """Those that the second has worse, and those that the first has worse; the worst first, each job once."""
    every = [w for suite in result.matched.suites for w in _of_suite(result, suite)]
    ways = [[w for w in every if w.size > 0], [w for w in every if w.size < 0]]
    second, first = (_ten(way) for way in ways)
    return second, first


def _ten(every: Sequence[Worst]) -> list[Worst]:
    """Each job by what it is worst in."""
    out: dict[str, Worst] = {}
    for w in sorted(every, key=lambda w: -abs(w.size)):
        out.setdefault(w.toml, w)
    return list(out.values())[:MAX_JOBS]


def _of_suite(result: Result, suite: Suite) -> Iterator[Worst]:
    directed = [c for c in result.comparisons if c.suite == suite.name and c.figure.better]
    figures = [(c, scale) for c in directed if (scale := _scale(c)) > 0]
    if suite.pairs:
        for pair in suite.pairs:
            yield from _of_pair(result, suite, pair, figures)
        return
    for k, (worlds, campaign) in enumerate(((suite.first, result.first), (suite.second, result.second))):
        for row in (row for rows in worlds for row in rows):
            yield from _of_row(suite, campaign, row, k, figures)


def _scale(c: Comparison) -> float:
    """Spread of the figure over the suite's jobs, both sides'."""
    values = np.concatenate(c.values)
    return float(np.std(values)) if len(values) else math.nan


def _of_pair(
    result: Result, suite: Suite, pair: Pair, figures: Sequence[tuple[Comparison, float]]
) -> Iterator[Worst]:  # fmt: skip
    first, second = pair.first[0], pair.second[0]
    endings = first["ending"], second["ending"]
    if (endings[0] == Ending.DONE) != (endings[1] == Ending.DONE):
        size = math.inf if endings[0] == Ending.DONE else -math.inf
        yield _worst(suite, "ending", endings, size, *_worse(result, first, second, size))
        return
    for c, scale in figures:
        values = _value(first, c), _value(second, c)
        if all(map(math.isfinite, values)):
            size = (values[1] - values[0]) / scale * (1 if c.figure.better == "less" else -1)
            yield _worst(suite, c.figure.name, values, size, *_worse(result, first, second, size))


def _of_row(
    suite: Suite, campaign: Campaign, row: Mapping[str, Any], side: int, figures: Sequence[tuple[Comparison, float]]
) -> Iterator[Worst]:  # fmt: skip
    """Beside the median of the other side: nothing else belongs to it."""
    for c, scale in figures:
        value, beside = _value(row, c), c.medians[1 - side]
        if math.isfinite(value) and math.isfinite(beside):
            away = (value - beside) / scale * (1 if c.figure.better == "less" else -1)
            if away > 0:
                values = (value, math.nan) if side == 0 else (math.nan, value)
                yield _worst(suite, c.figure.name, values, away if side else -away, campaign, row, {})


def _worse(result: Result, first: Mapping[str, Any], second: Mapping[str, Any], size: float) -> Any:
    """Campaign and row of the worse side, and what the other one differs in."""
    sides = (result.second, second, first) if size > 0 else (result.first, first, second)
    return sides[0], sides[1], {name: sides[2][name] for name in result.matched.differ}


def _worst(
    suite: Suite, figure: str, values: tuple[Any, Any], size: float, campaign: Campaign, row: Mapping[str, Any],
    other: Mapping[str, Scalar],
) -> Worst:  # fmt: skip
    inputs = {name: row[name] for name in campaign.inputs if row[name] is not None}
    return Worst(suite.name, figure, *values, size, inputs, toml(campaign.kind, inputs, other))


def toml(kind: str, inputs: Mapping[str, Scalar], other: Mapping[str, Scalar]) -> str:
    """A CAMPAIGN.toml of one job; what another job differs in stands beside its keys."""
    lines = [f"kind = {_text(kind)}"]
    if SEED in inputs:
        beside = f"  # the other: {other[SEED]}" if SEED in other else ""
        lines.append(f"first_seed = {inputs[SEED]}{beside}")
    lines += ["", "[fixed]"]
    for name in dict.fromkeys((*inputs, *other)):
        if name == SEED:
            continue
        beside = (
            "" if name not in other else f"  # the other: {_text(other[name]) if other[name] is not None else 'none'}"
        )
        if name in inputs:
            lines.append(f"{_key(name)} = {_text(inputs[name])}{beside}")
        else:
            lines.append(f"# {_key(name)}: none{beside}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.replace("_", "").isalnum() else json.dumps(name)


def _text(value: Scalar) -> str:
    """TOML's strings are JSON's, its numbers and flags too; a campaign has no infinite input."""
    return json.dumps(value, ensure_ascii=False)


def _value(row: Mapping[str, Any], c: Comparison) -> float:
    value = row.get(c.figure.name)
    return math.nan if value is None else float(value)


def inline(inputs: Mapping[str, Scalar]) -> str:
    """A job's inputs on one line."""
    return ", ".join(f"{_key(name)} = {_text(value)}" for name, value in inputs.items())
