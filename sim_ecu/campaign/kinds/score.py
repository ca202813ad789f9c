"""A run of a suite of `sim-ecu score`, wrcd alone, with the score's own figures."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from sim_ecu.campaign.kind import Factor, Kind, Scalar
from sim_ecu.campaign.kinds.given import configuration_of
from sim_ecu.campaign.kinds.play_kind import FIGURES
from sim_ecu.design.brief import load_source
from sim_ecu.jobs.digests import digest
from sim_ecu.score import SUITES
from sim_ecu.score.metrics.accuracy import judged_from_reached
from sim_ecu.score.metrics.run_metrics import OF_SUITES, suite_figures
from sim_ecu.score.score_play import play
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import AXLES, TEST_LOTS, TRAINING_LOTS, Run
from wrcd.config.packaged_designs import design_path
from wrcd.config.section import suggest
from wrcd.errors import InputError
from wrcd.resources import DEFAULT_DESIGN

KEPT = 2 * len(SUITES)  # that a process keeps: all suites of two designs or lots
FACTORS = (
    Factor("suite", str, needed=True, choices=SUITES), Factor("group", str), Factor("run", int),
    Factor("design", str, is_file=True, packaged=True), Factor("lot", int),
)  # fmt: skip


def suite_of(inputs: Mapping[str, Any]) -> Mapping[str, Sequence[Run]]:
    """Return the runs of the inputs' suite by group, in its order. Made once in a process. Raises InputError."""
    lot, file = int(inputs.get("lot", 0)), design_path(inputs.get("design") or DEFAULT_DESIGN)
    if not -TRAINING_LOTS <= lot < TEST_LOTS:
        raise InputError(f"takes -{TRAINING_LOTS} … {TEST_LOTS - 1}, not {lot}", key="lot")
    return _suite(file, digest(file), str(inputs["suite"]), lot)


@lru_cache(KEPT)
def _suite(file: Path, _contents: str, suite: str, lot: int) -> dict[str, list[Run]]:
    out: dict[str, list[Run]] = {}
    for run in runs(load_source(file), suite, 1.0, lot):
        if run.suite == suite:  # without its twins in the grid
            out.setdefault(run.group, []).append(run)
    return out


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
    """Yield the runs that the inputs ask for, where group or run are left out. Raises InputError."""
    groups = suite_of(inputs)
    for group in (inputs["group"],) if "group" in inputs else groups:
        for number in (inputs["run"],) if "run" in inputs else range(max(len(groups.get(group, ())), 1)):
            yield {**inputs, "group": group, "run": number}


def figures(inputs: Mapping[str, Any]) -> Mapping[str, Scalar]:
    """Play the run of a job, and judge it."""
    run = _run(inputs)
    traces = play(run, configuration_of(inputs, (AXLES,)), {})
    if run.suite == "paper":
        traces = [replace(t, judged_from_s=judged_from_reached(t)) for t in traces]
    return suite_figures(traces)


def _check(inputs: Mapping[str, Any]) -> float:
    scenario = _run(inputs).scenario
    return scenario.duration_s * len(scenario.axles)


SCORE = Kind(
    "score", FACTORS, FIGURES | dict.fromkeys(OF_SUITES, float), figures, "suite", seeded=False, check=_check,
    points=points,
)  # fmt: skip
