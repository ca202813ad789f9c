"""From recordings, through the train's own estimator, to what its rules are made from."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cases import Plan, Progress, quietly
from sim_ecu.design.recordings import Recording
from sim_ecu.design.side_by_side import SideBySide
from sim_ecu.jobs.pool import Workers
from sim_ecu.jobs.whole import each
from wrcd.core.design import Design
from wrcd.core.estimator import step_through
from wrcd.core.records import Ticks
from wrcd.core.terms import BLOCK_TICKS, LENGTH, MODELS, PARTNER, SWING

FloatArray = NDArray[np.float64]
EDGE = 0.4  # importance of a window outside the plan's core
WHOLE, TOLERANCE = 3.0, 0.99  # and of a whole one (of so much of the usual) whose torque stays: the memory fuses those
ENDS = (0.25, 0.5, 0.75, 1.0)  # windows end at these shares of the recording after it has settled
NO_PARTNER = 0.15  # of the windows: without what the partner says, as where it has no sensors
ELSEWHERE = 0.2  # of a bogie's recordings: the partner is on another track, as of bogies with one axle's sensors each
MOVED, SLOW_M_S = 0.1, 10.0  # see Features.covers: decades of the torque within half a second, as in slip cycles


@dataclass(frozen=True, slots=True)
class Features:
    """One row per window: inputs (n, COLUMNS) as the rules are given them, the truth in percent (n,), the number of the
    condition (n,), one for both wheelsets of a bogie, whether it is of the design's own world and undisturbed (n,)."""

    inputs: FloatArray
    mu_pct: FloatArray
    condition: NDArray[np.int64]
    nominal: NDArray[np.bool_]
    window_s: float  # of the usual window

    def importance(self, plan: Plan) -> FloatArray:
        """Weight (n,) of each window in the fit: less at the edges of the plan, more for whole ones whose torque
        stays, and as the plan says in the own world."""
        low, high = plan.core_speeds
        speed_m_s = 10.0 ** self.inputs[:, 5]
        utilisation = 100.0 * 10.0 ** self.inputs[:, 4] / self.mu_pct
        core = (speed_m_s >= low) & (speed_m_s <= high) & (utilisation >= plan.core_utilisation)
        weight = np.where(core, 1.0, EDGE)
        still = (self.inputs[:, LENGTH] >= math.log10(TOLERANCE * self.window_s)) & ~self._moved
        return np.where(self.nominal, plan.own_weight, 1.0) * np.where(still, WHOLE, 1.0) * weight

    @property
    def _moved(self) -> NDArray[np.bool_]:
        return np.asarray(self.inputs[:, SWING].sum(axis=1) > MOVED)

    def covers(self, plan: Plan) -> FloatArray:
        """(n,) Which quantile of the error the half-width of each window's interval is to be.

        At least half of the training windows are of other worlds or disturbed, and many are short: of whole windows in
        the own world more lie inside than the plan says. More are to where the torque has moved and below SLOW_M_S:
        few windows there make up for others.
        """
        slow = self.inputs[:, 5] < math.log10(SLOW_M_S)
        return np.where(self._moved | slow, plan.covers_moved, plan.covers_still)


@dataclass(frozen=True, slots=True)
class Steps:
    """Per window: decades (n, 4) between the residuals of its newest part and of the rest, and the speed (n,)."""

    decades: FloatArray
    speed_m_s: FloatArray


def estimator_alone(design: Design, axles: int) -> SideBySide:
    """The train's estimator without the judgement of whose sensors these are; the estimates are the same."""
    return SideBySide(replace(design, health=None), axles)


def run(design: Design, z: NDArray[np.float32], r: Recording, at: Sequence[int]) -> Iterator[tuple[int, SideBySide]]:
    """Feed a recording to the train's estimator; gives it back after each of the ticks (growing)."""
    n = z.shape[2]
    estimator = estimator_alone(design, n)
    present = np.ones(z.shape, dtype=bool)
    ratio = np.abs(r.torque.astype(np.float64)) / (2 * design.normal_N * design.r_0)
    ticks = Ticks(0, z.astype(np.float64), present, ratio, r.speed_m_s.tolist())
    for k in step_through(estimator, ticks.part(0, at[-1] + 1), at[:-1]):
        yield k, estimator


def lengths_of(design: Design) -> tuple[float, ...]:
    """Seconds that windows are long: the newest part alone, the usual window, the longest, and between them."""
    usual, longest = design.window_s, design.longest_s
    return design.recent_s, 0.25 * usual, 0.5 * usual, usual, usual, 0.5 * (usual + longest), longest


def features(
    design: Design, recordings: Sequence[Recording], plan: Plan, progress: Progress = quietly, seed: int = 0,
    workers: Workers | None = None,
) -> tuple[Features, Steps]:  # fmt: skip
    """Windows out of every recording, undisturbed and disturbed: whole ones, and as many of random length. Of the
    design only the bank is used. In the paper's form they are all of the one length that it has, and undisturbed.

    The steps are those of undisturbed windows in the design's own world, on a rail that does not change.
    workers: whose processes do it; None: the caller's does. Raises Stopped where one of them cannot.
    """
    first = np.cumsum([0, *(r.z.shape[2] for r in recordings)])
    jobs = [(design, plan, r, [plan.seed, 2, seed, k], int(first[k])) for k, r in enumerate(recordings)]
    if workers is None:
        return _joined([_windows(job) for job in jobs])
    parts = {}
    for place, part in each(_windows, jobs, workers, [f"residuals of {r.speed_m_s[0]:.1f} m/s" for r in recordings]):
        parts[place] = part
        progress("residuals", len(parts) / len(jobs))
    return _joined([parts[place] for place in range(len(jobs))])


def _joined(parts: Sequence[tuple[Features, Steps]]) -> tuple[Features, Steps]:
    """One of all, without windows that have no inputs."""
    inputs, mu, condition, own, decades, speeds = (
        np.concatenate(columns)
        for columns in zip(*((f.inputs, f.mu_pct, f.condition, f.nominal, s.decades, s.speed_m_s) for f, s in parts),
                           strict=True)
    )  # fmt: skip
    known = np.isfinite(inputs).all(axis=1)
    window_s = parts[0][0].window_s
    return Features(inputs[known], mu[known], condition[known], own[known], window_s), Steps(decades, speeds)


def _in_order(r: Recording, order: NDArray[np.int64]) -> Recording:
    """The same conditions in another order."""
    lanes = ("z", "felt", "torque", "mu_pct", "first", "steady")
    return replace(r, **{name: getattr(r, name)[..., order] for name in lanes})


def _windows(job: tuple[Design, Plan, Recording, list[int], int]) -> tuple[Features, Steps]:
    design, plan, r, seed, first = job
    rng = np.random.default_rng(seed)
    n = r.z.shape[2]
    inputs, truth, nominal, decades, speeds = [], [], [], [np.zeros((0, MODELS))], [np.zeros(0)]
    each = 2 if design.is_bogie else 1
    number = first + np.arange(n)
    if each == 2 and rng.random() < ELSEWHERE:
        order = np.arange(n)
        order[1::2] = np.roll(order[1::2], 1)
        r, number = _in_order(r, order), number[order]
    lengths_s, copies = (lengths_of(design), 2) if design.form == "wrcd" else ((), 1)
    for z in (r.z, r.felt)[:copies]:
        settled = round(plan.settle_s / plan.seconds * len(z))
        at = [settled + round(share * (len(z) - settled)) - 1 for share in ENDS]
        for k, estimator in run(design, z, r, at):
            own = r.own_world and z is r.z
            for seconds in (np.full(n, design.window_s), *([rng.choice(lengths_s, n)] if lengths_s else [])):
                blocks = np.round(seconds / design.tick_s / BLOCK_TICKS).astype(np.int64)
                blocks = np.minimum(blocks, (k + 1 - r.first) // BLOCK_TICKS)
                window = estimator.inputs_of(blocks, estimator.torque_now())
                window[rng.random(n) < NO_PARTNER, PARTNER] = 0.0
                inputs.append(window)
                truth.append(r.mu_pct[k].astype(np.float64))
                nominal.append(np.full(n, own))
            if own:
                still = r.steady & (k + 1 - r.first >= design.window_ticks)
                decades.append(estimator.steps()[still])
                speeds.append(np.full(int(still.sum()), r.speed_m_s[k]))
    data = Features(
        np.concatenate(inputs), np.concatenate(truth), np.tile(number // each, len(inputs)),
        np.concatenate(nominal), design.window_s,
    )  # fmt: skip
    return data, Steps(np.concatenate(decades), np.concatenate(speeds))
