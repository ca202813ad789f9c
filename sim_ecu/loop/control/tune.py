"""Search for the constants of the reference controllers: `python -m sim_ecu.loop.control.tune [LAW ...]`.

Every constant is a positive number. One after the other is tried larger and smaller by a factor, and the better is
kept; the factor shrinks from round to round. The score is the sum of `training.Cost.total` over the rides of SEEDS.
Rides of CHECKS, which the search has not seen, say what it is worth.
"""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from sim_ecu.loop.control import creep, resync, thresholds
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.control.training import Cost, reference_errors, run

SEEDS, CHECKS = range(1, 17), range(101, 141)
FACTORS = (1.6, 1.3, 1.1)  # of the rounds
HOPELESS = 1.05  # a candidate this much worse than the best after some rides is given up
RELEASED = ("after_s", "share")  # constants of the release that are searched with a law
LAWS: dict[str, tuple[Any, Any]] = {
    "thresholds": (thresholds.Thresholds, thresholds.Constants),
    "creep": (creep.CreepControl, creep.Constants),
}


@dataclass(frozen=True, slots=True)
class Place:
    """Constants of a law and of its releases."""

    law: str
    own: Any
    release: resync.Constants

    @classmethod
    def in_force(cls, law: str) -> "Place":
        """The constants that the law has."""
        return cls(law, LAWS[law][1](), LAWS[law][0].release)

    def names(self) -> list[str]:
        """The constants that are searched."""
        return [*asdict(self.own), *RELEASED]

    def times(self, name: str, factor: float) -> "Place":
        """The same with one constant multiplied."""
        part = "release" if name in RELEASED else "own"
        old = getattr(self, part)
        return replace(self, **{part: replace(old, **{name: getattr(old, name) * factor})})

    def controller(self, facts: Facts) -> SlipController:
        """A controller with these constants."""
        return SlipController(facts, lambda: LAWS[self.law][0](self.own), None, self.release)

    def cost(self, seed: int) -> Cost:
        """The cost of a seed's ride."""
        return run(seed, self.controller)


def scores(place: Place, best: Sequence[float] | None) -> list[float]:
    """The costs of the training rides; shorter when it is given up against the best."""
    found: list[float] = []
    for seed in SEEDS:
        found.append(place.cost(seed).total)
        if best and len(found) % 4 == 0 and sum(found) > HOPELESS * sum(best[: len(found)]):
            break
    return found


def search(law: str) -> Place:
    """The best place that was found. Writes every step that is better to stderr."""
    place = Place.in_force(law)
    best = scores(place, None)
    for factor in FACTORS:
        for name in place.names():
            for f in (factor, 1.0 / factor):
                tried = place.times(name, f)
                found = scores(tried, best)
                if len(found) == len(best) and sum(found) < sum(best):
                    place, best = tried, found
                    print(law, factor, name, place, f"{np.mean(best):.4f}", file=sys.stderr, flush=True)
                    break
    return place


def main(laws: Sequence[str]) -> None:
    """Search for each law, and write what it found and what that is worth."""
    for law in laws or list(LAWS):
        found = search(law)
        print(found)
        for name, place in (("in force", Place.in_force(law)), ("found", found)):
            costs = [place.cost(seed) for seed in CHECKS]
            figures = (np.mean([getattr(c, f) for c in costs]) for f in ("lost", "wear", "total"))
            print(law, name, "lost {:.4f}, wear {:.4f}, cost {:.4f}".format(*figures), flush=True)
        errors = [e for seed in CHECKS for e in reference_errors(seed, found.controller)]
        percentiles = "{:.2f}, {:.2f}, {:.2f}, {:.2f}, {:.2f}".format(*np.percentile(errors, [0, 5, 50, 95, 100]))
        print(law, f"error of the reference in slides, m/s: least, 5th, median, 95th percentile, most: {percentiles}")


if __name__ == "__main__":
    main(sys.argv[1:])
