"""The jobs that differ most, each way, and how to run them again."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim_ecu.campaign.campaign_folder import Results
from sim_ecu.campaign.comparison.compare import Comparison, Result, Suite
from sim_ecu.jobs.job import Ending, Scalar

MAX_JOBS = 10
SEED = "seed"
BARE = re.compile("[A-Za-z0-9_-]+")  # a key of TOML without quotes


@dataclass(frozen=True, slots=True)
class Worst:
    """A job that is worse on one side. figure: by which; "ending" where it is not done. size: the difference, in the
    figure's spread over the suite, above 0 where the second is worse. first, second: the figure, or how it ended; of
    samples the other side's median, or "".

    inputs: of the worse side. toml: a CAMPAIGN.toml of this job alone.
    """

    suite: str
    figure: str
    first: float | str
    second: float | str
    size: float
    inputs: Mapping[str, Scalar]
    toml: str


@dataclass(frozen=True, slots=True)
class _Away:
    """How far a job is from what is beside it, in its worst figure; size > 0: the second is worse. other: the row
    beside it, None of samples."""

    suite: str
    figure: str
    values: tuple[float | str, float | str]
    size: float
    row: Mapping[str, Any]
    other: Mapping[str, Any] | None


def worst(result: Result) -> tuple[list[Worst], list[Worst]]:
    """Those that the second has worse, and those that the first has worse; the worst first, each job once."""
    every = [away for suite in result.matched.suites for away in _of_suite(result, suite)]
    second = sorted((a for a in every if a.size > 0), key=lambda a: -a.size)[:MAX_JOBS]
    first = sorted((a for a in every if a.size < 0), key=lambda a: a.size)[:MAX_JOBS]
    return [_told(a, result.second, result) for a in second], [_told(a, result.first, result) for a in first]


def _of_suite(result: Result, suite: Suite) -> Iterator[_Away]:
    """Of each job what it is worst in, each way."""
    directed = [c for c in result.comparisons if c.suite == suite.name and c.figure.better]
    figures = [(c, scale) for c in directed if (scale := _scale(c)) > 0]
    for pair in suite.pairs:
        yield from _of_pair(pair.first[0], pair.second[0], figures, suite.name)
    for side, worlds in enumerate((suite.first, suite.second)):
        for row in (row for rows in worlds for row in rows):
            yield from _of_row(row, side, figures, suite.name)


def _scale(c: Comparison) -> float:
    """Spread of the figure over the suite's jobs, both sides'."""
    values = np.concatenate(c.values)
    return float(np.std(values)) if len(values) else math.nan


def _of_pair(
    first: Mapping[str, Any], second: Mapping[str, Any], figures: Sequence[tuple[Comparison, float]], suite: str
) -> Iterator[_Away]:
    endings = first["ending"], second["ending"]
    if (endings[0] == Ending.DONE) != (endings[1] == Ending.DONE):
        if endings[0] == Ending.DONE:
            yield _Away(suite, "ending", endings, math.inf, second, first)
        else:
            yield _Away(suite, "ending", endings, -math.inf, first, second)
        return
    found = []
    for c, scale in figures:
        values = _value(first, c), _value(second, c)
        if all(map(math.isfinite, values)):
            found.append((_size(c, values[1] - values[0], scale), c.figure.name, values))
    if found and (most := max(found))[0] > 0:
        yield _Away(suite, most[1], most[2], most[0], second, first)
    if found and (least := min(found))[0] < 0:
        yield _Away(suite, least[1], least[2], least[0], first, second)


def _of_row(
    row: Mapping[str, Any], side: int, figures: Sequence[tuple[Comparison, float]], suite: str
) -> Iterator[_Away]:
    """Beside the median of the other side, for no job of it belongs to this one."""
    sign = 1 if side else -1
    if row["ending"] != Ending.DONE:
        yield _Away(suite, "ending", ("", row["ending"]) if side else (row["ending"], ""), sign * math.inf, row, None)
        return
    found = [(_size(c, _value(row, c) - c.medians[1 - side], scale), c) for c, scale in figures]
    known = [(size, c) for size, c in found if size > 0]
    if known:
        size, c = max(known, key=lambda sized: sized[0])
        value, beside = _value(row, c), c.medians[1 - side]
        yield _Away(suite, c.figure.name, (beside, value) if side else (value, beside), sign * size, row, None)


def _size(c: Comparison, more: float, scale: float) -> float:
    """In spreads, above 0 where it is worse to have so much more."""
    return more / scale * (1 if c.figure.better == "less" else -1)


def _told(away: _Away, campaign: Results, result: Result) -> Worst:
    inputs = {name: away.row[name] for name in campaign.inputs if away.row[name] is not None}
    beside = {} if away.other is None else {name: away.other[name] for name in result.matched.differ}
    return Worst(
        away.suite, away.figure, *away.values, away.size, inputs, toml(campaign.kind, inputs, beside)
    )  # fmt: skip


def toml(kind: str, inputs: Mapping[str, Scalar], other: Mapping[str, Scalar]) -> str:
    """A CAMPAIGN.toml of one job; what another job differs in stands beside its keys."""
    beside = {name: f"  # the other: {'none' if v is None else _text(v)}" for name, v in other.items()}
    lines = [f"kind = {_text(kind)}"]
    if SEED in inputs:
        lines.append(f"first_seed = {_text(inputs[SEED])}{beside.get(SEED, '')}")
    lines += ["", "[fixed]"]
    for name in dict.fromkeys((*inputs, *other)):
        if name in inputs and name != SEED:
            lines.append(f"{_key(name)} = {_text(inputs[name])}{beside.get(name, '')}")
        elif name != SEED:
            lines.append(f"# {_key(name)}: none{beside[name]}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if BARE.fullmatch(name) else json.dumps(name)


def _text(value: Scalar) -> str:
    """TOML's strings are JSON's, its numbers and flags too; a campaign has no infinite input."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(row: Mapping[str, Any], c: Comparison) -> float:
    value = row.get(c.figure.name)
    return math.nan if value is None else float(value)


def inline(inputs: Mapping[str, Scalar]) -> str:
    """A job's inputs on one line."""
    return ", ".join(f"{_key(name)} = {_text(value)}" for name, value in inputs.items())
