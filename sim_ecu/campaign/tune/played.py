"""A design on whole runs, as a campaign of the score's; what it is tuned for: several goals, and one number of them."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim_ecu.campaign.campaign_folder import CampaignRequest, opened_store
from sim_ecu.campaign.definition import Campaign
from sim_ecu.campaign.go import Finished, go
from sim_ecu.campaign.kinds.score import SCORE, suite_of
from sim_ecu.jobs.job import Ending, Job, code, digest
from sim_ecu.jobs.pool import Workers
from sim_ecu.score.suites.nominal import MEMS
from sim_ecu.score.suites.run import AXLES, TUNED_LOT
from sim_ecu.score.suites.sound import DRY_RUN_S
from wrcd.errors import InputError
from wrcd.estimator.design import CHANNELS, COLUMNS, INPUTS, MODELS, Design, load_design
from wrcd.estimator.paper.window import BLOCK_TICKS

GRID, DROPS, DRY = "grid", "drops", "dry-hours"
# suites and shares of their runs: the first of each
TRAINING = ((GRID, 0.15), (DROPS, 0.15), (DRY, 0.06))
TEST = ((GRID, 0.4), (DROPS, 0.6), (DRY, 0.2))
SECTION = 9  # operations of a second-order section
WINDOWS = 3  # that every answer is made of: the longest, the usual, the newest part


@dataclass(frozen=True, slots=True)
class TuningGoal:
    """A figure of a suite that is to be small, mean of the runs. factor: from the figure. weight: in the one number.
    floor: what no difference is made below: a design that does half of next to nothing is not twice as good."""

    words: str
    unit: str
    suite: str
    figure: str
    weight: float
    floor: float
    factor: float = 1.0
    offset: float = 0.0

    def value(self, rows: Sequence[Mapping[str, Any]]) -> float:
        """Return the mean over the suite's runs that have a number; NaN without any."""
        found = [float(r[self.figure]) for r in rows if r["suite"] == self.suite and r[self.figure] is not None]
        known = [v for v in found if math.isfinite(v)]
        return self.offset + self.factor * sum(known) / len(known) if known else math.nan


GOALS = (
    TuningGoal("mean error", "pp", GRID, "mean_error_pp", 1.0, 0.05),
    TuningGoal("lie after a drop", "s", DROPS, "drop_lie_s", 1.0, 0.2),
    TuningGoal("dry rail called low", "s/h", DRY, "false_low_s", 0.25, 10.0, 3600.0 / (DRY_RUN_S * AXLES)),
    TuningGoal("not Valid", "share", GRID, "valid", 0.25, 0.02, -1.0, 1.0),
)
ERROR, SILENT = 0, 3
SILENT_PP = 5.0  # what a frame that is not Valid counts as in the one number: silence is no way to a small error
COST_WEIGHT = 0.1


@dataclass(frozen=True, slots=True)
class PlayedFigures:
    """A design's goals, and its cost: operations an axle and tick, counted and not measured."""

    values: tuple[float, ...]
    cost: int

    @property
    def _with_silence(self) -> tuple[float, ...]:
        """The goals with the frames that are not Valid in the error."""
        out, silent = [*self.values], self.values[SILENT]
        out[ERROR] = (1.0 - silent) * out[ERROR] + silent * SILENT_PP if silent < 1.0 else SILENT_PP
        return tuple(out)

    def behind(self, other: "PlayedFigures") -> bool:
        """Return whether the other is nowhere worse, and better somewhere. No figure is worse than any."""
        mine, theirs = ([math.inf if math.isnan(v) else v for v in (*f.values, float(f.cost))] for f in (self, other))
        pairs = list(zip(mine, theirs, strict=True))
        return all(b <= a for a, b in pairs) and any(b < a for a, b in pairs)

    def against(self, other: "PlayedFigures") -> float:
        """One number: the goals' logarithms over another design's, by weight. Below 0: better. inf without a figure."""
        if not all(map(math.isfinite, (*self._with_silence, *other._with_silence))):
            return math.inf
        parts = [
            g.weight * math.log((mine + g.floor) / (theirs + g.floor))
            for g, mine, theirs in zip(GOALS, self._with_silence, other._with_silence, strict=True)
        ]
        return sum(parts) + COST_WEIGHT * math.log(self.cost / other.cost)


def operations(design: Design) -> int:
    """Count multiplications and additions of an axle's tick: four filters, the band, and an answer every fourth tick,
    over all rules and their slopes."""
    step = 2 * (design.states**2 + 2 * design.states * CHANNELS + CHANNELS**2)
    band = SECTION * CHANNELS * len(design.lowpass)
    rule = INPUTS + 2 * 2 * COLUMNS
    return MODELS * (step + band) + round(WINDOWS * len(design.rules) * rule / BLOCK_TICKS)


def play_training(design: Path, seed: int, folder: Path, workers: Workers) -> PlayedFigures:
    """Play a design on the runs that designs are tuned on; rows that are in the folder are not played again. Raises
    InputError where a run fails."""
    finished = play(design, TRAINING, -1 - seed, folder, workers)
    rows = [{**job.inputs, **row.figures} for job, row in finished.pairs]
    return PlayedFigures(tuple(g.value(rows) for g in GOALS), operations(load_design(design)))


def play_test(design: Path, folder: Path, workers: Workers) -> Finished:
    """Play it on as much of the score's suites with seeds that neither the score nor the training has."""
    return play(design, TEST, TUNED_LOT, folder, workers)


def play(design: Path, shares: Sequence[tuple[str, float]], lot: int, folder: Path, workers: Workers) -> Finished:
    """Run the campaign of a design in a folder. Raises InputError where a run fails."""
    file, contents = str(design.resolve()), digest(design)
    jobs = tuple(
        Job(SCORE.name, inputs, {"design": contents}) for s, share in shares for inputs in _runs(s, share, file, lot)
    )
    types = {f.name: f.type for f in SCORE.factors}
    request = CampaignRequest(folder.name, SCORE, types, code(SCORE.function.__module__))
    campaign = Campaign(request, jobs, {}, None, 0, None, folder, {(file,): {file: contents}})
    with opened_store(folder, request, campaign.keys) as store:
        finished = go(campaign, folder, store, workers, again=True)
    for job, row in finished.pairs:
        if row.ending is not Ending.DONE:
            raise InputError(f"cannot be played in {job.inputs['suite']}: {row.error or row.ending}", file=design)
    return finished


def _runs(suite: str, share: float, design: str, lot: int) -> Iterator[dict[str, Any]]:
    inputs = {"suite": suite, "design": design, "lot": lot}
    for group, runs in suite_of(inputs).items():
        if suite != GRID or group == MEMS.name:
            yield from ({**inputs, "group": group, "run": k} for k in range(max(1, round(share * len(runs)))))
