"""The stages of a tuning: CMA-ES over recorded conditions; the start and the best candidates as designs on
whole runs, where the windows are searched, too. Candidates side by side in processes of their own."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from sim_ecu.campaign.tune.played import PlayedFigures, play_training
from sim_ecu.design import make
from sim_ecu.design import search as judged_by
from sim_ecu.design.brief import written
from sim_ecu.design.cases import FloatArray
from sim_ecu.design.cases import Progress as At
from sim_ecu.design.make import Brief, bank, fitted, write
from sim_ecu.design.pairs import plan_of
from sim_ecu.design.recordings import Recording
from sim_ecu.design.search import Objective, error_of, minimise, objective
from sim_ecu.design.space import BY_RECORDINGS, BY_RUNS, brief_at, parameters, vector
from sim_ecu.design.training_jobs import pairs, recorded, remove_parts
from sim_ecu.jobs.job import Ending, Job, JobRow, code
from sim_ecu.jobs.pool import Stopped, Workers
from sim_ecu.jobs.store import Store, save
from wrcd.errors import InputError
from wrcd.estimator.design import parse_design
from wrcd.progress import Progress

STEP = 0.4  # of the search at its start: see design/space.py for what one is
ERROR = "error"


@dataclass(frozen=True, slots=True)
class Candidate:
    """A brief, and its error on recorded conditions (inf: there is no such filter)."""

    brief: Brief
    error: float


@dataclass(frozen=True, slots=True)
class Trial:
    """A candidate, and the conditions of a start and a seed that it is judged by."""

    start: Brief
    seed: int
    candidate: Brief

    @property
    def key(self) -> str:
        """The key of its row in the store."""
        inputs = {"seed": self.seed, "start": written(self.start), "candidate": written(self.candidate)}
        return Job("candidate", inputs).key(code(judged_by.__name__))


def judge(trial: Trial) -> float:
    """Return the error. The conditions are simulated once in a process: deterministic, so all have the same."""
    return error_of(_conditions(trial.start, trial.seed), trial.candidate)


@lru_cache(maxsize=1)
def _conditions(start: Brief, seed: int) -> Objective:
    return objective(start, seed)


def _with_error(row: JobRow, value: float | None) -> JobRow:
    return row if value is None else replace(row, figures={ERROR: value})


class Judging:
    """Scores generations of candidates, those of the store without work. Keeps all that it scored."""

    def __init__(self, start: Brief, seed: int, store: Store, workers: Workers) -> None:
        self._start, self._seed, self._store, self._workers = start, seed, store, workers
        self.every: list[Candidate] = []
        self.known = self.computed = 0
        self.failed: list[str] = []  # why, of those that gave no error at all
        self.seconds = 0.0  # of the computed ones

    def errors(self, briefs: Sequence[Brief]) -> list[float]:
        """Return them in the order of the briefs."""
        began, rows = time.monotonic(), self._store.rows
        trials = {t.key: t for t in (Trial(self._start, self._seed, b) for b in briefs)}
        keys = [Trial(self._start, self._seed, b).key for b in briefs]
        left = [k for k in trials if k not in rows or rows[k].ending is not Ending.DONE]
        self.known += len(keys) - len(left)
        for _, row in self._store.finish(judge, left, [trials[k] for k in left], self._workers, row=_with_error):
            if row.ending is not Ending.DONE:
                self.failed.append(row.error)
        self.computed += len(left)
        self.seconds += time.monotonic() - began if left else 0.0
        found = [float(str(rows[k].figures.get(ERROR, math.inf))) for k in keys]
        self.every += [Candidate(b, e) for b, e in zip(briefs, found, strict=True)]
        return found


def search(
    start: Candidate, groups: Sequence[str], budget: int, seed: int, judging: Judging, progress: At
) -> list[Candidate]:
    """Return the candidates without doubles, the best first: `budget` of them, the start among them, which is judged
    already. Deterministic for its arguments."""
    over = parameters(start.brief, [g for g in groups if g in BY_RECORDINGS])

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        return judging.errors([brief_at(start.brief, over, x) for x in xs])

    def generation(done: int, least: float) -> None:
        rate = 60.0 * judging.computed / judging.seconds if judging.seconds else 0.0
        left = budget - judging.known
        share = 1.0 - (budget - done) / left if left > 0 else 1.0
        pace = f", {rate:.1f} a minute" if rate else ""
        progress(f"candidate {done} of {budget}, least error {least:.4f}{pace}", share)

    if over:
        minimise(scores, vector(start.brief, over), start.error, STEP, budget, seed, generation)
    unique = {written(c.brief): c for c in reversed(judging.every)}
    return sorted(unique.values(), key=lambda c: c.error)


DESIGNS, PLAYED, PARTS = "designs", "played", "parts"  # folders; the last one in that of the designs
FINALISTS = 3  # of the first stage that are played; the rest of what may be played are windows of the best of them
WINDOW_STEP = 0.5
# Conditions of a design that is played to be compared: a quarter of the shipped one's. The one that is chosen is made
# anew from all.
DRAFT_SPEEDS, DRAFT_PER_SPEED = 16, 150


def draft(brief: Brief) -> Brief:
    """Return the brief with fewer conditions."""
    plan = brief.plan
    speeds, per_speed = min(plan.speeds, DRAFT_SPEEDS), min(plan.per_speed, DRAFT_PER_SPEED)
    return replace(brief, plan=replace(plan, speeds=speeds, per_speed=per_speed))


class Designs:
    """Makes designs of one plan's conditions, which are simulated when the first one is missing.

    Raises InputError where the folder or a file cannot be written.
    """

    def __init__(self, folder: Path, workers: Workers) -> None:
        self._folder, self._workers = folder, workers
        self._recordings: tuple[Brief, list[Recording]] | None = None
        try:
            folder.mkdir(exist_ok=True)
        except OSError as e:
            raise InputError(f"cannot be made: {e.strerror}", file=folder, hint="name another folder") from None

    def of(self, brief: Brief, judges: bool = False) -> Path | None:
        """Return the file; None where there is no such design: a filter that has no steady gain, or is not stable.
        judges: whether it judges its sensors, as one that is to be used does."""
        what = {"brief": written(brief), "judges": judges}
        file = self._folder / f"{Job('design', what).key(code(make.__name__))}.json"
        if file.exists():
            return file
        progress = Progress(steps=True)
        try:
            document = fitted(brief, bank(brief), self._recorded(brief, progress), progress.at, self._workers)
            if judges and brief.form == "wrcd":
                design, plan = parse_design(document, file), plan_of(brief.plan)
                watched = pairs(brief.wheelset, plan, design, self._folder / PARTS, self._workers, progress.at)
                document = make.judging(document, watched, progress.at)
        except Stopped:
            raise
        except (np.linalg.LinAlgError, InputError):
            return None
        finally:
            progress.end()
        save(file, lambda partly: write(document, partly))
        return file

    def _recorded(self, brief: Brief, progress: Progress) -> list[Recording]:
        if self._recordings is None or self._recordings[0].plan != brief.plan:
            parts = self._folder / PARTS
            recordings = recorded(brief.wheelset, brief.plan, brief.tick_s, parts, self._workers, progress.at)
            self._recordings = brief, recordings
        return self._recordings[1]

    def end(self) -> None:
        """Remove what only makes further designs."""
        remove_parts(self._folder / PARTS)


@dataclass(frozen=True, slots=True)
class Finalist:
    """A candidate that was played. name: how it came about. design: a draft, of fewer conditions."""

    name: str
    brief: Brief
    design: Path
    figures: PlayedFigures
    against_start: float  # the one number: below 0 it is better than the start


class Final:
    """Plays briefs on the same training runs, and keeps what came of it."""

    def __init__(self, folder: Path, seed: int, workers: Workers) -> None:
        self._folder, self._seed, self._workers = folder, seed, workers
        self.designs = Designs(folder / DESIGNS, workers)
        self.every: list[Finalist] = []
        self.lost = 0  # briefs that gave no design

    def play(self, name: str, brief: Brief) -> float:
        """Return the one number against the first that was played; inf for a brief that gives no design. What was
        played already is not played again."""
        known = [f for f in self.every if written(f.brief) == written(brief)]
        if known:
            return known[0].against_start
        design = self.designs.of(draft(brief))
        if design is None:
            self.lost += 1
            return math.inf
        found = play_training(design, self._seed, self._folder / PLAYED / design.stem, self._workers)
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
        return [f for f in self.every if not any(f.figures.behind(other.figures) for other in self.every)]


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

    minimise(
        scores, vector(base.brief, over), base.against_start, WINDOW_STEP, left + 1, seed, lambda _done, _least: None
    )
