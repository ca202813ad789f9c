"""The jobs that differ most, each way, and how to run them again."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

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


class _Away(NamedTuple):
    """How far a job is from what is beside it. size > 0: the second is worse. other: the row beside it, None of
    samples."""

    size: float
    figure: str
    values: tuple[float | str, float | str]
    suite: str
    row: Mapping[str, Any]
    other: Mapping[str, Any] | None


def worst(result: Result) -> tuple[list[Worst], list[Worst]]:
    """Those that the second has worse, and those that the first has worse; the worst first, each job once."""
    every = [away for suite in result.matched.suites for away in _of_suite(result, suite)]
    second = sorted((a for a in every if a.size > 0), key=lambda a: -a.size)[:MAX_JOBS]
    first = sorted((a for a in every if a.size < 0), key=lambda a: a.size)[:MAX_JOBS]
    return [_worst_of(a, result.second, result) for a in second], [_worst_of(a, result.first, result) for a in first]


def _of_suite(result: Result, suite: Suite) -> Iterator[_Away]:
    """Of each job what it is worst in, each way; one of samples beside the median of the other side."""
    directed = [c for c in result.comparisons if c.suite == suite.name and c.figure.better]
    figures = [(c, scale) for c in directed if (scale := _scale(c)) > 0]
    for pair in suite.pairs:
        yield from _of_job((pair.first[0], pair.second[0]), figures, suite.name)
    for row in (row for rows in suite.first for row in rows):
        yield from _of_job((row, None), figures, suite.name)
    for row in (row for rows in suite.second for row in rows):
        yield from _of_job((None, row), figures, suite.name)


def _scale(c: Comparison) -> float:
    """Spread of the figure over the suite's jobs, both sides'."""
    values = np.concatenate(c.values)
    return float(np.std(values)) if len(values) else math.nan


def _of_job(
    rows: tuple[Mapping[str, Any] | None, Mapping[str, Any] | None], figures: Sequence[tuple[Comparison, float]],
    suite: str,
) -> Iterator[_Away]:  # fmt: skip
    endings = ["" if row is None else str(row["ending"]) for row in rows]
    badly = [ending not in ("", Ending.DONE) for ending in endings]
    found: list[tuple[float, str, tuple[float | str, float | str]]] = []
    for c, scale in figures:
        first, second = (c.medians[k] if row is None else _value(row, c) for k, row in enumerate(rows))
        size = (second - first) / scale * (1 if c.figure.better == "less" else -1)
        if math.isfinite(size):
            found.append((size, c.figure.name, (first, second)))
    if badly[0] != badly[1]:
        found = [(math.inf if badly[1] else -math.inf, "ending", (endings[0], endings[1]))]
    found.sort(key=lambda sized: sized[0])
    for side, worse in ((1, found[-1]), (0, found[0])) if found else ():
        row = rows[side]
        if row is not None and (worse[0] > 0 if side else worse[0] < 0):
            yield _Away(*worse, suite, row, rows[1 - side])


def _worst_of(away: _Away, campaign: Results, result: Result) -> Worst:
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
