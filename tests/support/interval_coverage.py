"""How often the score's 90 % intervals hold the truth, by simulation: what drawing again gives, and what is printed."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.metrics.bootstrap import ENDS, REPLICATES, SEED, FloatArray

RUNS = (8, 12, 40)
TRIALS = 400
Rng = np.random.Generator
Sample = Callable[[Rng, int], FloatArray]


def _zeros(rng: Rng, n: int) -> FloatArray:
    return np.where(rng.random(n) < 0.5, 0.0, rng.lognormal(0.0, 0.5, n))


# Values of runs: what is drawn, and its mean and median.
SAMPLES: dict[str, tuple[Sample, float, float]] = {
    "normal": (lambda rng, n: rng.normal(1.0, 0.5, n), 1.0, 1.0),
    "log-normal, spread of 0.5": (lambda rng, n: rng.lognormal(0.0, 0.5, n), math.exp(0.125), 1.0),
    "log-normal, spread of 1": (lambda rng, n: rng.lognormal(0.0, 1.0, n), math.exp(0.5), 1.0),
    "half zeros, half log-normal": (_zeros, 0.5 * math.exp(0.125), math.nan),
}


@dataclass(frozen=True, slots=True)
class Coverage:
    """Shares of the trials whose interval holds the truth: of the mean by the percentiles of drawing again and as the
    score gives it, of the median; NaN where the median is no point."""

    percentile: float
    mean: float
    median: float


def coverage(name: str, runs: int, trials: int = TRIALS) -> Coverage:
    """Of samples of so many runs, the same ones in each call."""
    sample, mean, median = SAMPLES[name]
    rng, again = np.random.default_rng(7), np.random.default_rng(SEED)
    places = again.integers(0, runs, (REPLICATES, runs))
    held = np.zeros((trials, 3), np.bool_)
    for k in range(trials):
        values = sample(rng, runs)
        low, high = np.quantile(values[places].mean(axis=1), ENDS)
        of_mean, of_median = bootstrap.mean(values, np.arange(runs)), bootstrap.median(values)
        held[k] = (
            low <= mean <= high,
            of_mean.low <= mean <= of_mean.high,
            of_median.low <= median <= of_median.high,
        )
    share = held.mean(axis=0)
    return Coverage(float(share[0]), float(share[1]), math.nan if math.isnan(median) else float(share[2]))
