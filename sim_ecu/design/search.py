"""`sim-ecu design --search`: CMA-ES over a brief's numbers. Candidates are judged by recorded conditions, and what a
bank makes of them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import FloatArray, Group, Progress, held_at, quietly
from sim_ecu.design.features import Features, features, run
from sim_ecu.design.linear import Point
from sim_ecu.design.make import Brief, bank, rule_base, with_placeholder_rules
from sim_ecu.design.recordings import Recording, record
from sim_ecu.design.space import brief_at, parameters, vector
from sim_ecu.jobs.pool import Workers
from sim_ecu.jobs.whole import each
from sim_ecu.physics.contact import CURVES
from wrcd.core.terms import BLOCK_TICKS, MODELS
from wrcd.errors import InputError

Scores = Callable[[Sequence[FloatArray]], Sequence[float]]


class Cmaes:
    """Ask for candidates (each (n,)), tell their scores (lower is better, NaN and inf count as worst)."""

    def __init__(self, start: FloatArray, step: float, rng: np.random.Generator) -> None:
        n = len(start)
        self.mean, self.step = start.astype(np.float64), step
        self._rng = rng
        self.population = 4 + int(3 * math.log(n))
        self._parents = self.population // 2
        weights = np.log((self.population + 1) / 2) - np.log(np.arange(1, self._parents + 1))
        self._weights = weights / weights.sum()
        self._effective = 1.0 / np.square(self._weights).sum()
        e = self._effective
        self._c_step, self._c_path = (e + 2) / (n + e + 5), (4 + e / n) / (n + 4 + 2 * e / n)
        self._c_one = 2 / ((n + 1.3) ** 2 + e)
        self._c_rank = min(1 - self._c_one, 2 * (e - 2 + 1 / e) / ((n + 2) ** 2 + e))
        self._damping = 1 + 2 * max(0.0, math.sqrt((e - 1) / (n + 1)) - 1) + self._c_step
        self._usual = math.sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n))  # length of a normal vector
        self._path_step, self._path = np.zeros(n), np.zeros(n)
        self._covariance = np.eye(n)
        self._generation = 0
        self._decompose()

    def ask(self) -> list[FloatArray]:
        """The candidates of a generation."""
        z = self._rng.standard_normal((self.population, len(self.mean)))
        return list(self.mean + self.step * (z * self._axes) @ self._basis.T)

    def tell(self, candidates: Sequence[FloatArray], scores: Sequence[float]) -> None:
        """Move and reshape by what they scored."""
        order = np.argsort(np.where(np.isfinite(scores), scores, np.inf), kind="stable")[: self._parents]
        steps = (np.array(candidates)[order] - self.mean) / self.step
        moved = self._weights @ steps
        self.mean = self.mean + self.step * moved
        self._generation += 1
        white = self._basis @ ((self._basis.T @ moved) / self._axes)
        c, e = self._c_step, self._effective
        self._path_step = (1 - c) * self._path_step + math.sqrt(c * (2 - c) * e) * white
        length = float(np.linalg.norm(self._path_step)) / math.sqrt(1 - (1 - c) ** (2 * self._generation))
        stalls = length < (1.4 + 2 / (len(self.mean) + 1)) * self._usual
        c = self._c_path
        self._path = (1 - c) * self._path + stalls * math.sqrt(c * (2 - c) * e) * moved
        kept = 1 - self._c_one - self._c_rank + (0.0 if stalls else self._c_one * c * (2 - c))
        self._covariance = (
            kept * self._covariance
            + self._c_one * np.outer(self._path, self._path)
            + self._c_rank * (steps.T * self._weights) @ steps
        )
        self.step *= math.exp(self._c_step / self._damping * (float(np.linalg.norm(self._path_step)) / self._usual - 1))
        self._decompose()

    def _decompose(self) -> None:
        values, self._basis = np.linalg.eigh(self._covariance)
        self._axes = np.sqrt(np.maximum(values, 1e-20))


def minimise(
    scores: Scores, start: FloatArray, known: float, step: float, budget: int, seed: int,
    progress: Callable[[int, float], None],
) -> tuple[FloatArray, float]:  # fmt: skip
    """The best of `budget` candidates and its score, the start among them. Deterministic for a seed.

    known: the start's score. scores takes a generation at once, so that its candidates may be scored side by side.
    progress(done, best) after each.
    """
    search = Cmaes(start, step, np.random.default_rng(seed))
    best, least = start, known
    done = 1
    progress(done, least)
    while done < budget:
        candidates = search.ask()
        tried = candidates[: budget - done]
        found = [float(s) for s in scores(tried)]
        done += len(tried)
        i = int(np.argmin(np.where(np.isfinite(found), found, np.inf)))
        if found[i] < least:
            best, least = tried[i], found[i]
        progress(done, least)
        if len(tried) == len(candidates):
            search.tell(candidates, found)
    return best, least


IntArray = NDArray[np.int64]
GRID = 24  # speeds of a candidate's bank
# Conditions that a candidate is judged by, at most; half of them in worlds that differ. With fewer, the rules of any
# bank learn them by heart, and the bank hardly matters: at each speed there are twice as many as in the plan.
# From one in VALIDATED of them no rules are made.
SPEEDS, PER_SPEED, VALIDATED = 3, 300, 3
MAX_RULES = 40  # of a candidate: less than half the time of a hundred
# Plans have seeds up to 1000; a score's seeds begin at two thousand million: what lies between belongs to the search.
FIRST_SEARCH_SEED, SEARCH_SEEDS, HELD_SEED = 1001, 900, 1_950_000_000
HELD_SPEEDS = (15.0, 25.0, 40.0)
HELD_OFF_PEAK = (0.004, 0.05, 0.15, 0.3)  # of the peak's creep: there model 4 matches, on every curve
HELD_TRACKS, HELD_SECONDS, HELD_SETTLED_S = 10, 4.0, 1.0
ACCURACY = "mean error (pp) on conditions that the rules were not made from:"
MATCHING = "1 less the share of windows in which the matching residual is the lowest by a margin:"
STEP = 0.4  # of the search at its start: see design/space.py for what one is
MARGIN = 0.01  # decades by which a residual is the lowest: half a point at 0, nearly a whole one from here on


@dataclass(frozen=True, slots=True)
class FitAccuracy:
    """Mean error (percentage points, by importance) of rules on conditions that they were not made from."""

    brief: Brief
    recordings: list[Recording]

    def error(self, brief: Brief) -> float:
        """See above. What is in use is available: no estimate lies below it."""
        brief = replace(brief, grid=GRID, max_rules=min(brief.max_rules, MAX_RULES))
        plan = self.brief.plan
        data, _ = features(with_placeholder_rules(bank(brief)), self.recordings, plan)
        fresh = data.condition % VALIDATED == 0
        rules, others = rule_base(brief, some(data, ~fresh)), some(data, fresh)
        guess = np.maximum(rules.mu_pct(others.inputs), 100.0 * 10.0 ** others.inputs[:, MODELS])
        return float(np.average(np.abs(guess - others.mu_pct), weights=others.importance(plan)))


def some(data: Features, rows: NDArray[np.bool_]) -> Features:
    """Some of the windows (n,), their conditions numbered from 0 on: a fit halves them by their numbers."""
    numbers = np.unique(data.condition[rows], return_inverse=True)[1]
    return replace(
        data, inputs=data.inputs[rows], mu_pct=data.mu_pct[rows], condition=numbers, nominal=data.nominal[rows]
    )


@dataclass(frozen=True, slots=True)
class Matching:
    """How often the matching filter's residual is not the lowest of the four, in conditions that are held: models 1 to
    3 at their design points, model 4 off the peaks of all curves. matches: of every recording, the model (n,)."""

    brief: Brief
    held: list[Recording]
    matches: list[IntArray]

    def shares(self, points: Sequence[Point], margin: float = 0.0) -> FloatArray:
        """(speeds, 4): share of the windows in which each model's residual is the lowest where it matches.

        With a margin (decades) a share rises smoothly with the distance to the next lowest: a search can climb it.
        """
        brief = replace(self.brief, points=tuple(points), grid=GRID)
        design = with_placeholder_rules(bank(brief))
        out = np.empty((len(self.held), MODELS))
        for row, r, match in zip(out, self.held, self.matches, strict=True):
            window = design.window_ticks
            ends = range(round(HELD_SETTLED_S / design.tick_s) + window - 1, len(r.z), window // 2)
            blocks = np.full(len(match), window // BLOCK_TICKS)
            logs = np.array([e.inputs_of(blocks, e.torque_now())[:, :MODELS] for _, e in run(design, r.z, r, ends)])
            for m in range(MODELS):
                here = logs[:, match == m]
                lead = np.delete(here, m, axis=2).min(axis=2) - here[..., m]
                row[m] = np.mean(0.5 + 0.5 * np.tanh(lead / margin) if margin else lead > 0)
        return out

    def error(self, brief: Brief) -> float:
        """See above, smoothly; the worst of a model and a speed counts as much as the mean of all."""
        shares = self.shares(brief.points, MARGIN)
        return 1.0 - 0.5 * float(shares.mean() + shares.min())


Objective: TypeAlias = FitAccuracy | Matching  # what a search makes small


def objective(brief: Brief, seed: int, progress: Progress = quietly) -> Objective:
    """What the brief's form is searched for; simulates its conditions (seconds). Deterministic for a brief and seed."""
    plan = replace(
        brief.plan, speeds=min(brief.plan.speeds, SPEEDS), per_speed=min(SPEEDS * brief.plan.per_speed, PER_SPEED),
        speed_range=brief.plan.core_speeds, seed=FIRST_SEARCH_SEED + seed % SEARCH_SEEDS,
    )  # fmt: skip
    brief = replace(brief, plan=plan)
    if brief.form == "paper":
        return matching(brief, min(HELD_TRACKS, plan.per_speed), progress)
    return FitAccuracy(brief, record(brief.wheelset, plan, brief.tick_s, progress))


def matching(brief: Brief, tracks: int, progress: Progress) -> Matching:
    """Conditions held on so many tracks each."""
    plan = replace(brief.plan, seconds=HELD_SECONDS, seed=HELD_SEED)
    groups, matches = [], []
    for v in HELD_SPEEDS:
        wanted = [(m, p.curve, p.creep_of_peak) for m, p in enumerate(brief.points[:-1])]
        wanted += [(MODELS - 1, curve, share) for share in HELD_OFF_PEAK for curve in CURVES.values()]
        every = [(m, held_at(brief.wheelset, c, s, v, HELD_SEED + k)) for m, c, s in wanted for k in range(tracks)]
        groups.append(Group(v, 0.0, tuple(c for _, c in every)))
        matches.append(np.array([m for m, _ in every], dtype=np.int64))
    return Matching(brief, record(brief.wheelset, plan, brief.tick_s, progress, groups=groups), matches)


def error_of(aim: Objective, brief: Brief) -> float:
    """Of a candidate; infinite where there is no steady gain, or one that is not stable between two speeds."""
    try:
        return aim.error(brief)
    except (np.linalg.LinAlgError, InputError):
        return math.inf


def objective_words(form: str) -> str:
    """Return what the objective of a form is, for a person."""
    return MATCHING if form == "paper" else ACCURACY


@dataclass(frozen=True, slots=True)
class Trial:
    """A candidate, and the brief by whose conditions it is judged."""

    start: Brief
    candidate: Brief


def judge(trial: Trial) -> float:
    """Return the error. The conditions are simulated once in a process: deterministic, so all have the same."""
    return error_of(_conditions(trial.start), trial.candidate)


@lru_cache(maxsize=1)
def _conditions(start: Brief) -> Objective:
    return objective(start, start.plan.seed)


def search(
    start: Brief, groups: Sequence[str], budget: int, workers: Workers, progress: Progress
) -> tuple[Brief, float, float]:
    """Return the best of `budget` candidates, the start among them; its error, and the start's. Deterministic for a
    brief. Raises InputError for a group that the form lacks."""
    over = parameters(start, groups)

    def scores(xs: Sequence[FloatArray]) -> list[float]:
        trials = [Trial(start, brief_at(start, over, x)) for x in xs]
        found = dict(each(judge, trials, workers, [f"candidate {k + 1} of a generation" for k in range(len(trials))]))
        return [found[k] for k in range(len(trials))]

    def generation(done: int, least: float) -> None:
        progress(f"candidate {done} of {budget}, least error {least:.4f}", done / budget)

    first = scores([vector(start, over)])[0]
    best, least = minimise(scores, vector(start, over), first, STEP, budget, start.plan.seed, generation)
    return start if least == first else brief_at(start, over, best), least, first
