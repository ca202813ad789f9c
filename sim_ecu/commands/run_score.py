"""`sim-ecu score`: plays the suites, judges the estimator and its baselines on the same frames, prints the tables."""

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu import resources as rig
from sim_ecu.commands.outputs import check_output, write_results
from sim_ecu.design.source import Source, load_source
from sim_ecu.score import learned
from sim_ecu.score.baselines import PAPER, Baseline, Beside, Offsetless, TorqueRatio, fitting
from sim_ecu.score.ekf import SINGLE, Ekf
from sim_ecu.score.play import Trace, play
from sim_ecu.score.report import judge
from sim_ecu.score.suites import runs
from sim_ecu.score.suites.run import Run
from sim_ecu.score.tables import tables
from wrcd import resources
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design
from wrcd.tools.progress import Progress

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


_world: _World | None = None


def run(
    suite: str | None, quick: bool, jobs: int, design_file: Path | None, baselines_file: Path | None,
    beside: Sequence[str], json_out: Path | None, html_out: Path | None,
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
    _prepare(asked)  # bad files are told of here, before anything is played
    began = time.monotonic()
    traces = _play_all(list(runs(source, suite, QUICK if quick else 1.0)), jobs, asked)
    result = {"run": {"quick": quick, "jobs": jobs}} | judge(traces, source, suite, quick)
    result["run"]["seconds"] = round(time.monotonic() - began)
    print("\n".join(tables(result)))
    write_results(result, json_out, html_out, lambda: _page(result, traces))
    return 0


def _page(result: dict[str, Any], traces: list[Trace]) -> str:
    from sim_ecu.score.page import page

    return page(result, traces)


def _named(text: str) -> tuple[str, Path]:
    name, equals, path = text.partition("=")
    if not equals or not name or not path:
        raise InputError(f"takes NAME=DESIGN.json, not {text!r}", key="--beside", hint="e.g. before=old.design.json")
    return name, Path(path)


def _play_all(every: list[Run], jobs: int, asked: Asked) -> list[Trace]:
    """In processes of their own; the order of the traces does not depend on them."""
    progress = Progress(steps=True)
    cost = np.array([r.scenario.duration_s * len(r.scenario.axles) for r in every])
    done = 0.0
    traces: list[Trace] = []
    with ProcessPoolExecutor(jobs, initializer=_prepare, initargs=(asked,)) as pool:
        for number, part in enumerate(pool.map(_play, every, chunksize=1)):
            traces += part
            done += cost[number]
            progress.at(f"{every[number].suite}: run {number + 1} of {len(every)}", done / cost.sum())
    progress.end()
    return traces


def _prepare(asked: Asked) -> None:
    global _world
    source = load_source(asked.design)
    config = replace(load_config(None), design=source.design, design_file=asked.design)
    _world = _World(config, make_baselines(source, asked))


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


def _play(run: Run) -> list[Trace]:
    assert _world is not None
    return play(run, _world.config, _world.baselines if run.suite in COMPARED else {})
