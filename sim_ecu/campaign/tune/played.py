"""A design on whole runs: what each run adds to the goals, so that any runs can be summed up and drawn again."""

import hashlib
import itertools
import json
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.campaign.job import Ending, Job, code, contents
from sim_ecu.campaign.runner import run
from sim_ecu.campaign.tune.journal import Journal
from sim_ecu.design.cases import Progress
from sim_ecu.design.source import Source
from sim_ecu.score.metrics import changes
from sim_ecu.score.metrics.accuracy import judged
from sim_ecu.score.metrics.frames import OURS, gather, period_s, valid
from sim_ecu.score.metrics.honesty import LOW_SURFACES
from sim_ecu.score.play import Trace, play
from sim_ecu.score.suites import runs, training_runs
from sim_ecu.score.suites.nominal import MEMS
from sim_ecu.score.suites.run import TUNED_LOT, Run
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.estimator.design import load_design

GRID, DROPS, DRY = "grid", "drops", "dry-hours"
TRAINING = ((GRID, 0.15), (DROPS, 0.15), (DRY, 0.06))  # suites and shares of their runs
TEST = ((GRID, 0.4), (DROPS, 0.6), (DRY, 0.2))  # so many that equal designs can be told to be equal


@dataclass(frozen=True, slots=True)
class Seen:
    """What a run adds. error_pp over so many Valid frames; of frames from when they are judged on those that are not
    Valid; over drops, seconds Valid with the truth below the interval; seconds that axles on dry rail are called Low or
    worse in Valid frames."""

    suite: str
    number: int
    error_pp: float = 0.0
    valid: int = 0
    silent: int = 0
    frames: int = 0
    lie_s: float = 0.0
    drops: int = 0
    low_s: float = 0.0
    dry_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Asked:
    """A design and a run."""

    design: Path
    run: Run


def training(source: Source, seed: int) -> list[Run]:
    """What designs are tuned on."""
    return _kept(r for suite, share in TRAINING for r in training_runs(source, suite, share, seed))


def test(source: Source) -> list[Run]:
    """What the chosen design is tested on: as much of the score's suites, with seeds that neither the score nor the
    training has."""
    return _kept(r for suite, share in TEST for r in runs(source, suite, share, TUNED_LOT))


def _kept(every: Iterable[Run]) -> list[Run]:
    return [r for r in every if r.suite != GRID or r.group == MEMS.name]


def seen(asked: Asked) -> Seen:
    """Play a run, in a process of its own."""
    return summed_up(asked.run, play(asked.run, _config(asked.design), {}))


@lru_cache(maxsize=2)
def _config(design: Path) -> Config:
    return replace(load_config(None), design=load_design(design), design_file=design)


def summed_up(of: Run, traces: Sequence[Trace]) -> Seen:
    """What a run's traces add."""
    out = Seen(of.suite, of.number)
    if of.suite == DROPS:
        every = changes.drops(traces)
        return replace(out, lie_s=sum(d.lie_s for d in every), drops=len(every))
    if of.suite == DRY:
        low = [float(np.sum(np.isin(t.surface, LOW_SURFACES) & valid(t))) * period_s(t) for t in traces]
        return replace(out, low_s=sum(low), dry_s=sum(len(t.time_s) * period_s(t) for t in traces))
    frames = gather(traces)
    use = judged(frames, OURS)
    return replace(
        out, error_pp=float(frames.errors(OURS)[use].sum()), valid=int(use.sum()), silent=int((~frames.valid).sum()),
        frames=len(frames.true),
    )  # fmt: skip


def digest(of: Run) -> str:
    """Of all that a run is: its wheelset, rails, courses and seeds."""
    return hashlib.sha256(json.dumps(asdict(of), default=_plain, sort_keys=True).encode()).hexdigest()


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"a run is plain data, not {type(value).__name__}")


def play_all(
    designs: Sequence[Path],
    every: Sequence[Run],
    journal: Journal,
    executor: Executor,
    workers: int,
    progress: Progress,
) -> list[list[Seen]]:
    """Of each design what it does in each run, in order; what the journal has is not played again, nor a design
    that is there twice. All designs hear the same frames. Raises InputError where a run cannot be played."""
    checksums = {d: contents(d) for d in designs}
    digests = [digest(r) for r in every]
    jobs = [Job("played", {"run": d}, {"design": checksums[design]}) for design in designs for d in digests]
    asked = {j.key(code()): (j, Asked(d, r)) for j, (d, r) in zip(jobs, itertools.product(designs, every), strict=True)}
    left = [pair for pair in asked.values() if journal.answer(pair[0]) is None]
    for done, outcome in enumerate(run(seen, [a for _, a in left], executor, workers), 1):
        job, of = left[outcome.place]
        if outcome.ending is not Ending.DONE or outcome.value is None:
            raise InputError(f"cannot be played in {of.run.suite}: {outcome.error}", file=of.design)
        journal.add(job, asdict(outcome.value))
        progress(f"run {len(asked) - len(left) + done} of {len(asked)}", done / len(left))
    whole = [Seen(**journal.answer(j)) for j in jobs]
    return [whole[i : i + len(every)] for i in range(0, len(whole), max(len(every), 1))]
