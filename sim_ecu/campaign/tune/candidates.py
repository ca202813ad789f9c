"""The first stage: CMA-ES over what recorded conditions tell, candidates side by side in processes of their own."""

import math
import time
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import lru_cache

from sim_ecu.campaign.job import Ending, Job
from sim_ecu.campaign.runner import run
from sim_ecu.campaign.tune.journal import Journal
from sim_ecu.design.brief import written
from sim_ecu.design.cases import FloatArray, Progress
from sim_ecu.design.cmaes import minimise
from sim_ecu.design.make import Brief
from sim_ecu.design.search import Objective, error_of, objective
from sim_ecu.design.space import BY_RECORDINGS, brief_at, parameters, vector

STEP = 0.4  # of the search at its start: see design/space.py for what one is


@dataclass(frozen=True, slots=True)
class Candidate:
    """A brief, and its error on recorded conditions (inf: there is no such filter)."""

    brief: Brief
    error: float


@dataclass(frozen=True, slots=True)
class Asked:
    """What a process is asked: a candidate, and the conditions of a start and a seed that it is judged by."""

    start: Brief
    seed: int
    candidate: Brief

    def job(self) -> Job:
        """By which the journal knows it."""
        return Job("candidate", {"seed": self.seed, "start": written(self.start), "candidate": written(self.candidate)})


def judge(asked: Asked) -> float:
    """The error. The conditions are simulated once in a process: deterministic, so all have the same."""
    return error_of(_conditions(asked.start, asked.seed), asked.candidate)


@lru_cache(maxsize=1)
def _conditions(start: Brief, seed: int) -> Objective:
    return objective(start, seed)


class Judging:
    """Scores generations of candidates, those of the journal without work. Keeps all that it scored."""

    def __init__(self, start: Brief, seed: int, journal: Journal, executor: Executor, workers: int) -> None:
        self._start, self._seed, self._journal = start, seed, journal
        self._executor, self._workers = executor, workers
        self.every: list[Candidate] = []
        self.known = self.computed = 0
        self.failed: list[str] = []  # why, of those that gave no error at all
        self.seconds = 0.0  # of the computed ones

    def errors(self, briefs: Sequence[Brief]) -> list[float]:
        """In the order of the briefs."""
        began = time.monotonic()
        every = [Asked(self._start, self._seed, b) for b in briefs]
        errors: list[float | None] = [self._journal.answer(a.job()) for a in every]
        left = [k for k, e in enumerate(errors) if e is None]
        self.known += len(every) - len(left)
        for outcome in run(judge, [every[k] for k in left], self._executor, self._workers):
            k = left[outcome.place]
            if outcome.ending is not Ending.DONE or outcome.value is None:
                self.failed.append(outcome.error)
                continue
            errors[k] = outcome.value
            self._journal.add(every[k].job(), outcome.value if math.isfinite(outcome.value) else "inf")
        self.computed += len(left)
        self.seconds += time.monotonic() - began if left else 0.0
        found = [math.inf if e is None else float(e) for e in errors]
        self.every += [Candidate(b, e) for b, e in zip(briefs, found, strict=True)]
        return found


def search(
    start: Candidate, groups: Sequence[str], budget: int, seed: int, judging: Judging, progress: Progress
) -> list[Candidate]:
    """The candidates without doubles, the best first: `budget` of them, the start among them, which is judged already.
    Deterministic for its arguments."""
    over = parameters(start.brief, [g for g in groups if g in BY_RECORDINGS])

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        return judging.errors([brief_at(start.brief, over, x) for x in xs])

    def told(done: int, least: float) -> None:
        rate = 60.0 * judging.computed / judging.seconds if judging.seconds else 0.0
        left = budget - judging.known
        share = 1.0 - (budget - done) / left if left > 0 else 1.0
        pace = f", {rate:.1f} a minute" if rate else ""
        progress(f"candidate {done} of {budget}, least error {least:.4f}{pace}", share)

    if over:
        minimise(scores, vector(start.brief, over), start.error, STEP, budget, seed, told)
    unique = {written(c.brief): c for c in reversed(judging.every)}
    return sorted(unique.values(), key=lambda c: c.error)
