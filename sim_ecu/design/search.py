"""`sim-ecu design --search`: the process noise and the channels' weights of the four models, by what they lead to."""

from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import FloatArray, Group, Plan, Progress, held_at
from sim_ecu.design.cmaes import minimise
from sim_ecu.design.features import features, run
from sim_ecu.design.linear import Point
from sim_ecu.design.make import Brief, bank, rule_base, with_placeholder_rules
from sim_ecu.design.recordings import Recording, record, record_groups
from sim_ecu.physics.contact import CURVES
from wrcd.errors import InputError, create
from wrcd.estimator.design import MODELS
from wrcd.estimator.window import BLOCK_TICKS
from wrcd.tools.progress import Progress as Shown

IntArray = NDArray[np.int64]
GRID = 24  # speeds of a candidate's bank
SPEEDS, PER_SPEED = 8, 60  # conditions that a candidate is judged by, at most
STEP = 0.3  # of the search at its start: decades of noise, and of weight over what is left of it
NOISES, WEIGHTS = (-6.0, 2.0), (-3.0, 3.0)  # log10 of a process noise, of one channel's weight over the other's
# Plans have seeds up to 1000; a score's seeds begin at two thousand million: what lies between belongs to the search.
FIRST_VALIDATION_SEED, VALIDATION_SEEDS, HELD_SEED = 1001, 900, 1_950_000_000
HELD_SPEEDS = (15.0, 25.0, 40.0)
HELD_OFF_PEAK = (0.004, 0.05, 0.15, 0.3)  # of the peak's creep: there model 4 matches, on every curve
HELD_TRACKS, HELD_SECONDS, HELD_SETTLED_S = 10, 4.0, 1.0
MARGIN = 0.01  # decades by which a residual is the lowest: half a point at 0, nearly a whole one from here on


class Objective(Protocol):
    """What a search makes small."""

    @property
    def brief(self) -> Brief:
        """What the models are for."""
        ...

    def error(self, points: Sequence[Point]) -> float:
        """Of a bank of four models."""
        ...

    def words(self, error: float) -> str:
        """What such an error is."""
        ...


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Mean error (percentage points) of the rules that train's conditions give, on validation's, by importance."""

    brief: Brief
    train: list[Recording]
    validation: list[Recording]
    validation_plan: Plan

    def error(self, points: Sequence[Point]) -> float:
        """See above. What is in use is available: no estimate lies below it."""
        brief = replace(self.brief, points=tuple(points), grid=GRID)
        design = with_placeholder_rules(bank(brief))
        rules = rule_base(brief, features(design, self.train, brief.plan)[0])
        fresh, _ = features(design, self.validation, self.validation_plan)
        guess = np.maximum(rules.mu_pct(fresh.inputs), 100.0 * 10.0 ** fresh.inputs[:, MODELS])
        weights = fresh.importance(self.validation_plan)
        return float(np.average(np.abs(guess - fresh.mu_pct), weights=weights))

    def words(self, error: float) -> str:
        """In words."""
        return f"mean error {error:.3f} pp on conditions that the rules were not made from"


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
            logs = np.array([e.inputs_of(blocks, e.torque_now())[0][:, :MODELS] for _, e in run(design, r.z, r, ends)])
            for m in range(MODELS):
                here = logs[:, match == m]
                lead = np.delete(here, m, axis=2).min(axis=2) - here[..., m]
                row[m] = np.mean(0.5 + 0.5 * np.tanh(lead / margin) if margin else lead > 0)
        return out

    def error(self, points: Sequence[Point]) -> float:
        """See above, smoothly; the worst of a model and a speed counts as much as the mean of all."""
        shares = self.shares(points, MARGIN)
        return 1.0 - 0.5 * float(shares.mean() + shares.min())

    def words(self, error: float) -> str:
        """In words."""
        return f"the matching residual is the lowest by a margin: {1.0 - error:.3f} (1: always)"


def objective(brief: Brief, progress: Progress) -> Objective:
    """What the brief's form is searched for; simulates its conditions (a minute or so)."""
    plan = replace(brief.plan, speeds=min(brief.plan.speeds, SPEEDS), per_speed=min(brief.plan.per_speed, PER_SPEED))
    brief = replace(brief, plan=plan)
    if brief.form == "paper":
        return matching(brief, min(HELD_TRACKS, plan.per_speed), progress)
    fresh = replace(plan, seed=FIRST_VALIDATION_SEED + plan.seed % VALIDATION_SEEDS)
    train, validation = (record(brief.wheelset, p, brief.tick_s, progress) for p in (plan, fresh))
    return Accuracy(brief, train, validation, fresh)


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
    return Matching(brief, record_groups(brief.wheelset, groups, plan, brief.tick_s, progress), matches)


def vector(brief: Brief) -> FloatArray:
    """What a search moves: log10 of the three noises of each model and, not in the paper's form, of the yaw rate's
    weight over the other's."""
    rows = [[*np.log10(p.noise), np.log10(p.yaw_rate_weight / (2.0 - p.yaw_rate_weight))] for p in brief.points]
    return np.array(rows)[:, : _columns(brief)].ravel()


def points_of(brief: Brief, x: FloatArray) -> tuple[Point, ...]:
    """The reverse, rounded as a person writes it."""
    out = []
    for p, row in zip(brief.points, x.reshape(MODELS, _columns(brief)), strict=True):
        track, yaw, lateral = (float(f"{10.0**e:.3g}") for e in np.clip(row[:3], *NOISES))
        found = replace(p, noise=(track, yaw, lateral))
        for e in np.clip(row[3:], *WEIGHTS):
            found = replace(found, yaw_rate_weight=float(f"{2.0 / (1.0 + 10.0**-e):.4g}"))
        out.append(found)
    return tuple(out)


def _columns(brief: Brief) -> int:
    return 3 if brief.form == "paper" else 4


def error_of(aim: Objective, x: FloatArray) -> float:
    """Of a vector; infinite where there is no steady gain, or one that is not stable between two speeds."""
    try:
        return aim.error(points_of(aim.brief, x))
    except (np.linalg.LinAlgError, InputError):
        return float("inf")


_objective: Objective | None = None  # of a process that scores candidates


def _begin(given: Objective) -> None:
    global _objective
    _objective = given


def _error(x: FloatArray) -> float:
    assert _objective is not None
    return error_of(_objective, x)


def best_of(aim: Objective, budget: int, jobs: int, told: Callable[[int, float], None]) -> tuple[FloatArray, float]:
    """The best vector of so many candidates, and its error."""
    start, seed = vector(aim.brief), aim.brief.plan.seed
    if aim.brief.form != "paper":  # each of its candidates keeps processes of its own busy
        return minimise(lambda xs: [error_of(aim, x) for x in xs], start, STEP, budget, seed, told)
    with ProcessPoolExecutor(jobs, initializer=_begin, initargs=(aim,)) as pool:
        return minimise(lambda xs: list(pool.map(_error, xs)), start, STEP, budget, seed, told)


def search(brief: Brief, output: Path, budget: int, jobs: int) -> int:
    """Search from the brief's points on, and write the best found as TOML for `--config`. Deterministic for a brief.

    budget: candidates; one takes seconds. Nothing that is designed or scored with has the conditions' seeds.
    """
    shown = Shown(steps=True)
    aim = objective(brief, shown.at)
    errors: list[float] = []  # the least so far; the first is that of the brief's own points

    def told(done: int, least: float) -> None:
        errors.append(least)
        shown.at(f"candidate {done} of {budget}, best: {aim.words(least)}", done / budget)

    best, least = best_of(aim, budget, jobs, told)
    before = errors[0]
    shown.end()
    points = points_of(brief, best)
    with create(output) as file:
        file.write(_toml(brief, points, [
            f"Found by `sim-ecu design --search` (seed {brief.plan.seed}, {budget} candidates) from the design's own.",
            f"Before: {aim.words(before)}.", f"Now: {aim.words(least)}.",
            "Look whether you believe it, then make a design with it: `sim-ecu design --config`.",
        ]))  # fmt: skip
    print(f"{output}: {aim.words(least)}; before: {aim.words(before)}")
    return 0


def _toml(brief: Brief, points: Sequence[Point], comments: Sequence[str]) -> str:
    lines = [*(f"# {c}" for c in comments), "[design]", f'form = "{brief.form}"']
    lines += [
        "# of each model: y_t' (m/s), yaw and lateral acceleration (rad/s2, m/s2), per root Hz; the yaw rate's weight"
    ]
    lines += ["noise = [", *(f"    {[*p.noise, p.yaw_rate_weight]},  # {p.name}" for p in points), "]"]
    return "\n".join(lines) + "\n"
