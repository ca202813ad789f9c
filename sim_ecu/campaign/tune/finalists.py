"""The second stage: the start and the best candidates as designs, on whole runs; the windows are searched here."""

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from sim_ecu.campaign.tune.candidates import Candidate
from sim_ecu.campaign.tune.designs import Designs, draft
from sim_ecu.campaign.tune.goals import Figures, figures, front
from sim_ecu.campaign.tune.journal import Journal
from sim_ecu.campaign.tune.played import play_all, training
from sim_ecu.design.brief import written
from sim_ecu.design.cases import FloatArray, Progress
from sim_ecu.design.cmaes import minimise
from sim_ecu.design.make import Brief
from sim_ecu.design.source import load_source
from sim_ecu.design.space import BY_RUNS, brief_at, parameters, vector
from wrcd.errors import InputError
from wrcd.estimator.design import load_design

FINALISTS = 3  # of the first stage that are played; the rest of what may be played are windows of the best of them
STEP = 0.5


@dataclass(frozen=True, slots=True)
class Finalist:
    """A candidate that was played. name: how it came about. design: a draft, of fewer conditions."""

    name: str
    brief: Brief
    design: Path
    figures: Figures
    against_start: float  # the one number: below 0 it is better than the start


class Final:
    """Plays briefs on the same training runs, and keeps what came of it."""

    def __init__(
        self, designs: Designs, seed: int, journal: Journal, executor: Executor, workers: int, progress: Progress
    ) -> None:
        self._designs, self._seed, self._journal = designs, seed, journal
        self._executor, self._workers, self._progress = executor, workers, progress
        self.every: list[Finalist] = []
        self.lost = 0  # briefs that gave no design

    def play(self, name: str, brief: Brief) -> float:
        """The one number against the first that was played; inf for a brief that gives no design. What was played
        already is not played again."""
        known = [f for f in self.every if written(f.brief) == written(brief)]
        if known:
            return known[0].against_start
        design = self._designs.of(draft(brief))
        if design is None:
            self.lost += 1
            return math.inf
        every = training(load_source(design), self._seed)
        (seen,) = play_all([design], every, self._journal, self._executor, self._workers, self._progress)
        found = figures(load_design(design), seen)
        against = found.against(self.every[0].figures) if self.every else 0.0
        self.every.append(Finalist(name, brief, design, found, against))
        return against

    @property
    def best(self) -> Finalist:
        """Least in the one number; the earlier of two alike."""
        return min(self.every, key=lambda f: f.against_start)

    @property
    def front(self) -> list[Finalist]:
        """Those that no other is ahead of in all goals."""
        return [self.every[k] for k in front([f.figures for f in self.every])]


def play_off(
    start: Brief, candidates: Sequence[Candidate], groups: Sequence[str], played: int, seed: int, final: Final
) -> None:
    """Play the start, the best candidates, and then windows and rules of the best: `played` in all, or less where some
    of the windows give no design.

    Raises InputError where the start gives no design: there is nothing to compare with.
    """
    if math.isinf(final.play("start", start)):
        raise InputError("gives no design: a filter has no steady gain, or is not stable", key="--config")
    over = parameters(start, [g for g in groups if g in BY_RUNS])
    wanted = [c for c in candidates if math.isfinite(c.error) and written(c.brief) != written(start)]
    most = min(1 + FINALISTS, played) if over else played
    for k, c in enumerate(wanted, 1):
        if len(final.every) >= most:
            break
        final.play(f"candidate {k}", c.brief)
    left = played - len(final.every)
    if not over or left < 1:
        return
    base = final.best

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        return [final.play(f"windows {len(final.every)}", brief_at(base.brief, over, x)) for x in xs]

    minimise(scores, vector(base.brief, over), base.against_start, STEP, left + 1, seed, lambda _done, _least: None)
