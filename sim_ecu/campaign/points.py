"""Which points of the factors' space a campaign asks about: all, random ones, or a Latin hypercube's."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from sim_ecu.campaign.job import Scalar

Point: TypeAlias = dict[str, Scalar]
DIGITS = 9  # of a value that is drawn: enough for any quantity, and written the same everywhere


@dataclass(frozen=True, slots=True)
class Values:
    """A factor's values, listed."""

    values: tuple[Scalar, ...]

    def at(self, share: float) -> Scalar:
        """The value of a share (0 to 1, 1 not among them) of the list: each as likely."""
        return self.values[min(int(share * len(self.values)), len(self.values) - 1)]

    def every(self) -> tuple[Scalar, ...]:
        """All."""
        return self.values


@dataclass(frozen=True, slots=True)
class Range:
    """A factor's values between two ends, evenly or (log) evenly by their logarithm. steps: of a full factorial."""

    low: float
    high: float
    steps: int = 0
    log: bool = False
    whole: bool = False

    def at(self, share: float) -> Scalar:
        """The value of a share (0 to 1) of the way."""
        if self.whole:
            return int(min(np.floor(self.low + share * (self.high - self.low + 1)), self.high))
        way = self.high - self.low
        exact = self.low * (self.high / self.low) ** share if self.log else self.low + share * way
        return min(max(float(f"{exact:.{DIGITS}g}"), self.low), self.high)

    def every(self) -> tuple[Scalar, ...]:
        """The steps, both ends among them."""
        shares = np.linspace(0.0, 1.0, self.steps)
        if self.whole:
            return tuple(int(v) for v in np.unique(np.round(self.low + shares * (self.high - self.low))))
        return tuple(self.at(float(s)) for s in shares)


Spread: TypeAlias = Values | Range


def full(factors: Mapping[str, Spread]) -> Iterator[Point]:
    """Every combination; the last factor changes fastest."""
    names = list(factors)
    for values in itertools.product(*(factors[n].every() for n in names)):
        yield dict(zip(names, values, strict=True))


def drawn(factors: Mapping[str, Spread], count: int, seed: int) -> Iterator[Point]:
    """So many points, each by itself."""
    return _of(factors, np.random.default_rng(seed).random((count, len(factors))))


def latin(factors: Mapping[str, Spread], count: int, seed: int) -> Iterator[Point]:
    """So many points, of which every factor's values are spread evenly."""
    return _of(factors, qmc.LatinHypercube(len(factors), rng=np.random.default_rng(seed)).random(count))


def _of(factors: Mapping[str, Spread], shares: NDArray[np.float64]) -> Iterator[Point]:
    names: Sequence[str] = list(factors)
    for row in shares.tolist():
        yield {name: factors[name].at(share) for name, share in zip(names, row, strict=True)}
