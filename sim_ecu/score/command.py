"""`sim-ecu score`: plays the suites, judges the estimator and its baselines on the same frames, prints the tables."""

import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_ecu import resources as rig
from sim_ecu.cli import SUITES
from sim_ecu.design.source import Source, load_source
from sim_ecu.score import learned, suites
from sim_ecu.score.ekf import SINGLE, Ekf
from sim_ecu.score.play import Baseline, Trace, play
from sim_ecu.score.report import judge
from sim_ecu.score.suites import Run
from sim_ecu.score.tables import tables
from sim_ecu.score.ticks import Ticks, running_mean
from wrcd import resources
from wrcd.daemon.config import Config, load_config
from wrcd.errors import InputError, create
from wrcd.tools.progress import Progress

QUICK = 0.08  # share of the runs in a quick score
IMM_EVERY, IMM_EVERY_QUICK = 6, 12  # the IMM is slow: it runs beside every so many runs of grid and robust
COMPARED = ("grid", "robust", "rough")  # suites in which baselines run beside


class TorqueRatio:
    """What anyone can do without a filter: the adhesion in use is the least there can be."""

    def __init__(self, window: int) -> None:
        self._window = window

    def mu_pct(self, ticks: Ticks) -> np.ndarray:
        """Adhesion in percent (t, n)."""
        return 100.0 * running_mean(np.nan_to_num(ticks.torque_ratio), self._window)


@dataclass(slots=True)
class _World:
    """What a process that plays needs, made once in each."""

    config: Config
    quick: dict[str, Baseline]
    slow: dict[str, Baseline]


_world: _World | None = None


def run(
    suite: str | None, quick: bool, jobs: int, design_file: Path | None, baselines_file: Path | None,
    json_out: Path | None, html_out: Path | None,
) -> int:  # fmt: skip
    """Play, judge, print; write the figures as JSON and a page where asked for."""
    for out in (json_out, html_out):
        key = "--json" if out is json_out else "--html"
        if out is not None and not out.parent.is_dir():
            raise InputError("no such folder", file=out.parent, key=key)
        if out is not None and out.is_dir():
            raise InputError("is a folder", file=out, key=key, hint="name the file to write")
    if baselines_file is None and design_file is None:
        baselines_file = rig.BASELINES
    source = load_source(design_file or resources.DESIGN)
    _prepare(source, baselines_file)  # bad files are told of here, before anything is played
    began = time.monotonic()
    runs = list(_runs(source, suite, QUICK if quick else 1.0))
    traces = _play_all(runs, quick, jobs, source, baselines_file)
    result = judge(traces, source)
    result["run"] = {"quick": quick, "seconds": round(time.monotonic() - began), "jobs": jobs}
    print("\n".join(tables(result)))
    if json_out:
        with create(json_out) as file:
            file.write(json.dumps(result, indent=1, ensure_ascii=False) + "\n")
    if html_out:
        from sim_ecu.score.page import page

        with create(html_out) as file:
            file.write(page(result, traces))
    return 0


def _runs(source: Source, suite: str | None, scale: float) -> Iterator[Run]:
    w = source.wheelset
    makers = {
        "paper": lambda: suites.paper(w, scale),
        "grid": lambda: suites.grid(w, scale),
        "transitions": lambda: suites.transitions(w, scale),
        "robust": lambda: suites.robust(w, scale),
        "rough": lambda: suites.rough(w, scale, source.roughness),
        "dry-hours": lambda: suites.dry_hours(w, scale),
    }
    for name in SUITES:
        if suite in (None, name):
            yield from makers[name]()


def _play_all(runs: list[Run], quick: bool, jobs: int, source: Source, baselines_file: Path | None) -> list[Trace]:
    """In processes of their own; the order of the traces does not depend on them."""
    progress = Progress(steps=False)
    seconds = np.array([r.scenario.duration_s * len(r.scenario.axles) for r in runs])
    every = IMM_EVERY_QUICK if quick else IMM_EVERY
    first = {name: next((k for k, r in enumerate(runs) if r.suite == name), 0) for name in SUITES}
    beside = [
        (r.suite in COMPARED, r.suite in ("grid", "robust") and (k - first[r.suite]) % every == 0)
        for k, r in enumerate(runs)
    ]
    # the IMM takes some times longer than all the rest
    cost = seconds * np.where([slow for _, slow in beside], 6.0, 1.0)
    done = 0.0
    traces: list[Trace] = []
    with ProcessPoolExecutor(jobs, initializer=_prepare, initargs=(source, baselines_file)) as pool:
        for number, part in enumerate(pool.map(_play, runs, beside, chunksize=1)):
            traces += part
            done += cost[number]
            progress.at(f"{runs[number].suite}: run {number + 1} of {len(runs)}", done / cost.sum())
    progress.end()
    return traces


def _prepare(source: Source, baselines_file: Path | None) -> None:
    global _world
    design, w, sensors = source.design, source.wheelset, source.sensors
    quick: dict[str, Baseline] = {"torque ratio": TorqueRatio(design.window_ticks)}
    slow: dict[str, Baseline] = {}
    if baselines_file is not None:
        made = learned.load(baselines_file, design)
        quick["filterless"] = made.filterless
        if made.regressor is not None:
            quick["regressor"] = made.regressor
    quick["EKF"] = Ekf(w, sensors, design.tick_s, SINGLE)
    quick["12 EKFs"] = Ekf(w, sensors, design.tick_s)
    _world = _World(replace(load_config(None), design=design, design_file=source.file), quick, slow)


def _play(run: Run, beside: tuple[bool, bool]) -> list[Trace]:
    assert _world is not None
    baselines = (_world.quick if beside[0] else {}) | (_world.slow if beside[1] else {})
    return play(run, _world.config, baselines)
