"""`sim-ecu score`: plays the suites, judges the estimator and its baselines on the same frames, prints the tables."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from sim_ecu import resources as rig
from sim_ecu.campaign.whole import Missing, Piece, every, left_out, not_whole
from sim_ecu.commands.outputs import check_output, status_by_goals, write_results
from sim_ecu.design.source import Source, load_source
from sim_ecu.score import learned
from sim_ecu.score.baselines import PAPER, Baseline, Beside, Offsetless, TorqueRatio, fitting
from sim_ecu.score.ekf import SINGLE, Ekf
from sim_ecu.score.names import SUITES
from sim_ecu.score.play import Trace, play
from sim_ecu.score.report import judge
from sim_ecu.score.suites import PAIRED, runs
from sim_ecu.score.suites.run import Run
from sim_ecu.score.tables import tables
from wrcd import resources
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design

QUICK = 0.08  # share of the runs in a quick score, at least one of each variant
# suites in which baselines run beside
COMPARED = ("paper", "grid", "robust", "rough", "transitions", "drops", "cycles", "slow")


@dataclass(frozen=True, slots=True)
class Asked:
    """What a process needs to play: files, not what is made of them."""

    design: Path
    baselines: Path | None
    beside: tuple[tuple[str, Path], ...]


@dataclass(frozen=True, slots=True)
class _World:
    """What a process that plays has made of it, once."""

    config: Config
    baselines: dict[str, Baseline]


@dataclass(frozen=True, slots=True)
class Work:
    """A run, and what plays it."""

    run: Run
    asked: Asked


def run(
    suite: str | None, quick: bool, jobs: int, design_file: Path | None, baselines_file: Path | None,
    beside: Sequence[str], json_out: Path | None, html_out: Path | None, fail_on: str | None,
) -> int:  # fmt: skip
    """Play, judge, print; write the figures as JSON and a page where asked for."""
    check_output("--json", json_out)
    check_output("--html", html_out)
    others = [_named(b) for b in beside]
    if baselines_file is None and design_file is None:
        baselines_file = rig.BASELINES
    if design_file is None and rig.PAPER_DESIGN.exists():
        others.insert(0, (PAPER, rig.PAPER_DESIGN))
    asked = Asked(design_file or resources.DESIGN, baselines_file, tuple(others))
    source = load_source(asked.design)
    _world(asked)  # bad files are told of here, before anything is played
    began = time.monotonic()
    traces, missing = _play_all(list(runs(source, suite, QUICK if quick else 1.0)), jobs, asked)
    holed = _holed(missing, suite)
    traces = [t for t in traces if t.suite not in holed]
    about = {"quick": quick, "jobs": jobs, "left_out": left_out(missing, holed)}
    result: dict[str, Any] = {"run": about} | judge(traces, source, suite, quick)
    result["run"]["seconds"] = round(time.monotonic() - began)
    if result["suites"]:
        print("\n".join(tables(result)))
        write_results(result, json_out, html_out, lambda: _page(result, traces))
    if missing:
        raise not_whole(missing)
    return status_by_goals(fail_on, result["goals"])


def _holed(missing: Sequence[Missing], suite: str | None) -> tuple[str, ...]:
    """The suites that lack a run, and those whose twins in the grid do."""
    found = {m.piece.suite for m in missing}
    if "grid" in found:
        found |= set(PAIRED) if suite is None else {suite}
    return tuple(name for name in SUITES if name in found)


def _page(result: dict[str, Any], traces: list[Trace]) -> str:
    from sim_ecu.score.page import page

    return page(result, traces)


def _named(text: str) -> tuple[str, Path]:
    name, equals, path = text.partition("=")
    if not equals or not name or not path:
        raise InputError(f"takes NAME=DESIGN.json, not {text!r}", key="--beside", hint="e.g. before=old.design.json")
    return name, Path(path)


def _play_all(runs: Sequence[Run], jobs: int, asked: Asked) -> tuple[list[Trace], Sequence[Missing]]:
    """In processes of their own; the order of the traces does not depend on them. And the runs that failed."""
    pieces = [Piece(r.suite, f"{r.group}, run {r.number}", r.scenario.duration_s * len(r.scenario.axles)) for r in runs]
    whole = every(play_one, [Work(r, asked) for r in runs], pieces, jobs)
    return [t for part in whole.results if part is not None for t in part], whole.missing


@lru_cache(1)
def _world(asked: Asked) -> _World:
    source = load_source(asked.design)
    config = replace(load_config(None), design=source.design, design_file=asked.design)
    return _World(config, make_baselines(source, asked))


def make_baselines(source: Source, asked: Asked) -> dict[str, Baseline]:
    """By the name that the tables give each, in their order."""
    design, w, sensors = source.design, source.wheelset, source.sensors
    out: dict[str, Baseline] = {}
    for name, path in asked.beside:
        other: Design = load_design(path)
        fitting(name, other, design)
        out[name] = Beside(other)
    out["torque ratio"] = TorqueRatio(design.window_ticks)
    if asked.baselines is not None:
        made = learned.load(asked.baselines, design)
        out["filterless"] = made.filterless
        if made.regressor is not None:
            out["neural network"] = made.regressor
    out["EKF"] = Offsetless(Ekf(w, sensors, design.tick_s, SINGLE), design.window_ticks)
    out["12 EKFs"] = Offsetless(Ekf(w, sensors, design.tick_s), design.window_ticks)
    return out


def play_one(work: Work) -> list[Trace]:
    """What a process does with each piece of work."""
    world = _world(work.asked)
    return play(work.run, world.config, world.baselines if work.run.suite in COMPARED else {})
