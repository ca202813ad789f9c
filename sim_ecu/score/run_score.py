"""`sim-ecu score`: plays the suites, judges the estimator and its baselines on the same frames, prints the tables."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import islice
from pathlib import Path
from typing import Any

from sim_ecu import resources as rig
from sim_ecu.design.brief import load_source
from sim_ecu.jobs.whole import Missing, Piece, every, left_out, not_whole
from sim_ecu.reporting.result_files import check_output, status_by_goals, write_json
from sim_ecu.reporting.table import markdown
from sim_ecu.reporting.values import number, share
from sim_ecu.score import MAP, SUITES
from sim_ecu.score.baselines import PAPER, Baseline, Beside, TorqueRatio, fitting
from sim_ecu.score.map_play import Passage, play_passage
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.accuracy import OURS, accuracy, gather
from sim_ecu.score.metrics.honesty import own_coverage
from sim_ecu.score.report import judge
from sim_ecu.score.score_play import Trace, play
from sim_ecu.score.sections import sections, warnings
from sim_ecu.score.suites import PAIRED, runs
from sim_ecu.score.suites.map_passages import PassageRun
from sim_ecu.score.suites.run import TEST, Run
from sim_ecu.score.suites.worlds import WORLDS
from wrcd import resources
from wrcd.config.config import load_config
from wrcd.config.packaged_designs import design_path
from wrcd.core.configuration import Config
from wrcd.core.design import Design, load_design
from wrcd.errors import InputError

QUICK = 0.08  # share of the runs in a quick score, at least one of each variant
# suites in which baselines run beside
COMPARED = ("paper", "grid", "robust", "rough", "transitions", "drops", "cycles", "slow")
SHORT = 10  # runs of a short score, four axles each
WHOLE = ("worlds",)  # suites in which other designs do not only estimate beside, but have a core each


@dataclass(frozen=True, slots=True)
class ScoreRequest:
    """What a process needs to play: files, not what is made of them."""

    design: Path
    beside: tuple[tuple[str, Path], ...]


def run(
    suite: str | None, quick: bool, jobs: int, design: Path, beside: Sequence[str],
    json_out: Path | None, fail_on: str | None, plot: Path | None = None,
) -> int:  # fmt: skip
    """Play, judge, print; write the figures as JSON and draw them where requested: the suite map, else the goals."""
    check_output("--json", json_out)
    check_output("--plot", plot)
    if plot is not None and plot.suffix.lower() != ".png":
        raise InputError("takes .png", file=plot, key="--plot", hint="give this suffix")
    others = [_named(b) for b in beside]
    papers = paper_form_of(design)
    if papers is not None:
        others.insert(0, (PAPER, papers))
    request = ScoreRequest(design, tuple(others))
    source = load_source(request.design)
    _world(request)  # bad files are reported here, before anything is played
    began = time.monotonic()
    played, missing = _play_all(list(runs(source, suite, QUICK if quick else 1.0)), jobs, request)
    holed = _holed(missing, suite)
    played = [p for p in played if p.suite not in holed]
    about = {"quick": quick, "jobs": jobs, "left_out": left_out(missing, holed)}
    result: dict[str, Any] = {"run": about} | judge(played, source, suite, quick)
    result["run"]["seconds"] = round(time.monotonic() - began)
    if result["suites"]:
        print("\n".join([*(f"{word}: {text}\n" for word, text in warnings(result)), *markdown(sections(result))]))
        write_json(result, json_out)
        if plot is not None:
            from sim_ecu.score import goal_drawing, map_drawing  # half a second

            if suite == MAP:
                map_drawing.write_picture(result["suites"][MAP], plot)
            else:
                goal_drawing.write_picture(result["goals"], plot)
    if missing:
        raise not_whole(missing)
    return status_by_goals(fail_on, result["goals"])


def short(design: Path, jobs: int) -> str:
    """Play a design on SHORT of its own vehicle's runs, and say how it did; Valid frames only, 90 % intervals in
    brackets. A lone wheelset's are of the grid."""
    source = load_source(design)
    if source.wheelset.bogie is None:
        plays = list(islice(runs(source, "grid", 1.0), SHORT))
    else:
        plays = [WORLDS[0].play(source, TEST, k) for k in range(SHORT)]
    played, missing = _play_all(plays, jobs, ScoreRequest(design, ()))
    if missing:
        raise not_whole(missing)
    traces = [t for t in played if isinstance(t, Trace)]
    f = gather(traces)
    error = accuracy(f, OURS)
    return (
        f"on {len(traces)} axles of its own kind of vehicle: mean error {number(error['mean'])} pp, "
        f"Valid {share(bootstrap.mean(f.valid, f.run))}, Valid and wrong {share(error['valid_and_wrong'])}, "
        f"its own interval holds the truth in {share(own_coverage(f))}"
    )


def paper_form_of(design: Path) -> Path | None:
    """Return the paper's own form of a packaged design; None where there is none, and for any other design."""
    file = rig.FOLDER / f"{design.name.removesuffix('design.json')}paper.design.json"
    return file if design.parent == resources.DESIGNS and file.exists() else None


def _holed(missing: Sequence[Missing], suite: str | None) -> tuple[str, ...]:
    """The suites that lack a run, and those whose twins in the grid do."""
    found = {m.piece.suite for m in missing}
    if "grid" in found:
        found |= set(PAIRED) if suite is None else {suite}
    return tuple(name for name in SUITES if name in found)


def _named(text: str) -> tuple[str, Path]:
    name, equals, design = text.partition("=")
    if not equals or not name or not design:
        raise InputError(f"takes NAME=DESIGN, not {text!r}", key="--beside", hint="e.g. before=old.design.json")
    return name, design_path(design)


def _play_all(runs: Sequence[Run], jobs: int, request: ScoreRequest) -> tuple[list[Trace | Passage], Sequence[Missing]]:
    """In processes of their own; the order of what comes does not depend on them. And the runs that failed."""
    pieces = [Piece(r.suite, f"{r.group}, run {r.number}", r.scenario.duration_s * len(r.scenario.axles)) for r in runs]
    found, missing = every(partial(play_any, request), runs, pieces, jobs)
    return [t for part in found for t in part], missing


@lru_cache(1)
def _world(request: ScoreRequest) -> tuple[Config, dict[str, Baseline], Sequence[tuple[str, Config]]]:
    """What plays, the baselines, and the other designs' configurations. Made once in a process that plays."""
    source = load_source(request.design)
    config = replace(load_config(None), design=source.design, design_file=request.design)
    others = [
        (name, replace(config, design=load_design(path), design_file=path))
        for name, path in request.beside
        if name != PAPER  # it is of the lone wheelset, and stands beside in the other suites
    ]
    return config, make_baselines(source.design, request), others


def make_baselines(design: Design, request: ScoreRequest) -> dict[str, Baseline]:
    """By the name that the tables give each, in their order."""
    out: dict[str, Baseline] = {}
    for name, path in request.beside:
        other: Design = load_design(path)
        fitting(name, other, design)
        out[name] = Beside(other)
    out["torque ratio"] = TorqueRatio(design.window_ticks)
    return out


def play_any(request: ScoreRequest, run: Run) -> Sequence[Trace | Passage]:
    """What a process does with each run."""
    return [play_passage(run, _world(request)[0])] if isinstance(run, PassageRun) else play_one(request, run)


def play_one(request: ScoreRequest, run: Run) -> list[Trace]:
    """Play a run of any suite but the map."""
    config, baselines, others = _world(request)
    return play(run, config, baselines if run.suite in COMPARED else {}, beside=others if run.suite in WHOLE else ())
