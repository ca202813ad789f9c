"""Covariance matrix adaptation (CMA-ES): a search without derivatives, in the plain form of N. Hansen's tutorial
("The CMA Evolution Strategy: A Tutorial", 2016, arXiv 1604.00772), with its default settings."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
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
    told: Callable[[int, float], None],
) -> tuple[FloatArray, float]:  # fmt: skip
    """The best of `budget` candidates and its score, the start among them. Deterministic for a seed.

    known: the start's score. scores takes a generation at once, so that its candidates may be scored side by side.
    told(done, best) after each.
    """
    search = Cmaes(start, step, np.random.default_rng(seed))
    best, least = start, known
    done = 1
    told(done, least)
    while done < budget:
        candidates = search.ask()
        tried = candidates[: budget - done]
        found = [float(s) for s in scores(tried)]
        done += len(tried)
        i = int(np.argmin(np.where(np.isfinite(found), found, np.inf)))
        if found[i] < least:
            best, least = tried[i], found[i]
        told(done, least)
        if len(tried) == len(candidates):
            search.tell(candidates, found)
    return best, least
