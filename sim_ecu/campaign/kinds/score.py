"""A run of a suite of `sim-ecu score`, wrcd alone, with the score's own figures."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.campaign.kind import Factor, Kind, Metric, Type
from sim_ecu.campaign.kinds.given import FIGURES as OF_ESTIMATES
from sim_ecu.campaign.kinds.given import configuration_of
from sim_ecu.campaign.kinds.given import figures_of as figures_of_estimates
from sim_ecu.design.brief import Recipe, load_source
from sim_ecu.jobs.job import Job, Scalar, digest
from sim_ecu.score import SUITES
from sim_ecu.score.metrics import accuracy, change_metrics, honesty
from sim_ecu.score.score_play import Trace, play
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import AXLES, TEST_LOTS, TRAINING_LOTS, TUNED_LOT, Run
from wrcd.config.packaged_designs import design_path
from wrcd.config.section import suggest
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN

KEPT, DESIGNS = 2 * len(SUITES), 16  # that a process keeps: all suites of two designs or lots

DESIGN = Factor("design", Type.TEXT, f"a packaged design's name, or a .json file; empty: {DEFAULT_DESIGN}", "",
                is_file=True, packaged=True)  # fmt: skip
FACTORS = (
    Factor("suite", Type.TEXT, "the suite", choices=SUITES),
    Factor("group", Type.TEXT, "its variant; left out: all of them", optional=True),
    Factor("run", Type.WHOLE, "the run within the group, from 0 on; left out: all of them", optional=True),
    DESIGN,
    Factor("lot", Type.WHOLE, f"which seeds: 0 is what `sim-ecu score` plays, 1 to {TEST_LOTS - 1} the same kinds of "
           f"runs with other seeds; -1 to -{TRAINING_LOTS} those that designs are tuned on", 0),
)  # fmt: skip
FIGURES = (
    *OF_ESTIMATES,
    Metric("delay_s", Type.NUMBER, "time until a change of rail has shown, mean of the changes; NaN without one", "s",
           "less"),
    Metric("drop_lie_s", Type.NUMBER, "time Valid with the truth below the interval after a drop, mean of the drops; "
           "NaN without one", "s", "less"),
    Metric("settled_s", Type.NUMBER, "time until it has settled after a drop, mean of the drops", "s", "less"),
    Metric("settled_worst_s", Type.NUMBER, "the same, worst drop", "s", "less"),
    Metric("max_over_pp", Type.NUMBER, "largest over-estimate in a Valid frame after a drop, worst drop", "pp", "less"),
    Metric("far_s", Type.NUMBER, "longest time that a Valid frame says far too much after a drop, worst drop", "s",
           "less"),
    Metric("found", Type.NUMBER, "share of the axles that are not Valid at the end of a run with something broken or "
           "foreign; NaN for others", better="more"),
    Metric("valid_after_s", Type.NUMBER, "time Valid after sensors died, worst axle; NaN for other suites", "s",
           "less"),
)  # fmt: skip
_CHANGING, _BROKEN = ("transitions", "drops"), ("dead", "foreign")  # suites


def _design(inputs: Mapping[str, Any]) -> Path:
    return design_path(inputs.get("design") or DEFAULT_DESIGN)


def suite_of(inputs: Mapping[str, Any]) -> Mapping[str, Sequence[Run]]:
    """The runs of the inputs' suite by group, in its order. Made once in a process. Raises InputError."""
    lot, file = int(inputs.get("lot", 0)), _design(inputs)
    if not -TRAINING_LOTS <= lot <= TUNED_LOT:
        raise _no_lot(lot)
    return _suite(file, digest(file), str(inputs["suite"]), lot)


def _no_lot(lot: int) -> InputError:
    return InputError(f"takes -{TRAINING_LOTS} … {TEST_LOTS - 1}, not {lot}", key="lot")


@lru_cache(KEPT)
def _suite(file: Path, contents: str, suite: str, lot: int) -> dict[str, list[Run]]:
    source = _source(file, contents)
    every = runs(source, suite, 1.0, lot)
    out: dict[str, list[Run]] = {}
    for run in every:
        if run.suite == suite:  # without its twins in the grid
            out.setdefault(run.group, []).append(run)
    return out


@lru_cache(DESIGNS)
def _source(file: Path, _contents: str) -> Recipe:
    return load_source(file)


def _run(inputs: Mapping[str, Any]) -> Run:
    groups = suite_of(inputs)
    group, number = str(inputs["group"]), int(inputs["run"])
    if group not in groups:
        hint = suggest(group, groups) or f"groups: {'; '.join(groups)}"
        raise InputError(f"the suite {inputs['suite']} has no group {group!r}", key="group", hint=hint)
    if number not in range(len(groups[group])):
        raise InputError(f"takes 0 … {len(groups[group]) - 1}, not {number}", key="run")
    return groups[group][number]


def points(inputs: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield the runs that the inputs request, where group or run are left out. Raises InputError."""
    groups = suite_of(inputs)
    for group in groups if inputs.get("group") is None else (inputs["group"],):
        number_given = inputs.get("run")
        for number in range(max(len(groups.get(group, ())), 1)) if number_given is None else (number_given,):
            yield {**inputs, "group": group, "run": number}


def figures(job: Job) -> Mapping[str, Scalar]:
    """Play the run of a job, and judge it."""
    run = _run(job.inputs)
    traces = play(run, configuration_of(job.inputs, (AXLES,)), {})
    if run.suite == "paper":
        traces = [replace(t, judged_from_s=accuracy.judged_from_reached(t)) for t in traces]
    return figures_of(traces)


def figures_of(traces: Sequence[Trace]) -> dict[str, Scalar]:
    """Of a run's traces."""
    suite = traces[0].suite
    out = figures_of_estimates(traces)
    more: dict[str, Scalar] = {f.name: math.nan for f in FIGURES if f not in OF_ESTIMATES}
    if suite in _CHANGING:
        drops = change_metrics.drops(traces)
        more |= {
            "delay_s": _of(np.mean, change_metrics.delays(traces)[0].tolist()),
            "drop_lie_s": _of(np.mean, [d.lie_s for d in drops]),
            "settled_s": _of(np.mean, [d.settled_s for d in drops]),
            "settled_worst_s": _of(np.max, [d.settled_s for d in drops]),
            "max_over_pp": _of(np.max, [d.max_over_pp for d in drops]),
            "far_s": _of(np.max, [d.far_s for d in drops]),
        }
    if suite in _BROKEN:
        more["found"] = honesty.found_out(traces).value
    if suite == "dead":
        more["valid_after_s"] = honesty.valid_after(traces, traces[0].judged_from_s)["most"].value
    return out | more


def _of(how: Callable[[list[float]], Any], values: list[float]) -> float:
    """Apply how to the values that are numbers; NaN for none."""
    known = [v for v in values if math.isfinite(v)]
    return float(how(known)) if known else math.nan


def _check(inputs: Mapping[str, Any]) -> None:
    """No campaign may request what tuned designs are tested on: only the tuning itself plays it."""
    if inputs.get("lot", 0) == TUNED_LOT:
        raise _no_lot(TUNED_LOT)
    _run(inputs)


def _cost(inputs: Mapping[str, Any]) -> float:
    scenario = _run(inputs).scenario
    return scenario.duration_s * len(scenario.axles)


SCORE = Kind(
    "score",
    "a run of a suite of `sim-ecu score`",
    FACTORS,
    FIGURES,
    figures,
    check=_check,
    cost=_cost,
    suite="suite",
    cluster=("lot", "run"),
    seeded=False,
    points=points,
)
