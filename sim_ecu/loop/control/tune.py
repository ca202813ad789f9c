"""Search for the constants of the reference controllers: `python -m sim_ecu.loop.control.tune [LAW …]`.

Every constant is a positive number and is searched by its logarithm, from the constants in force. The score is the mean
of `training.Cost.total` over the rides of seeds 1 ... 36; rides of seeds 101 ... 172, which the search has not seen, say
what it is worth.
"""

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from multiprocessing import Pool
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.cmaes import minimise
from sim_ecu.loop.control import creep, resync, thresholds
from sim_ecu.loop.control.facts import Facts
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.control.training import Cost, run

SEEDS, CHECKS = range(1, 37), range(101, 173)
BUDGET, STEP, SEARCH_SEED = 120, 0.25, 13
FloatArray = NDArray[np.float64]
LAWS: dict[str, tuple[Any, Any]] = {
    "thresholds": (thresholds.Thresholds, thresholds.Constants),
    "creep": (creep.CreepControl, creep.Constants),
}
RELEASED = ("after_s", "share")  # constants of the release that are searched with a law


def constants_of(law: str, at: FloatArray | None = None) -> tuple[dict[str, float], dict[str, float]]:
    """Constants of a law and of its releases at a place of the search; None: those in force."""
    own, release = asdict(LAWS[law][1]()), asdict(resync.Constants())
    if at is not None:
        factors = [float(f) for f in np.exp(at)]
        own = {k: v * f for (k, v), f in zip(own.items(), factors, strict=False)}
        release |= {k: release[k] * f for k, f in zip(RELEASED, factors[len(own) :], strict=True)}
    return own, release


def controller(law: str, at: FloatArray | None, facts: Facts) -> SlipController:
    """A controller with the constants of a place of the search."""
    own, release = constants_of(law, at)
    kind, constants = LAWS[law]
    return SlipController(facts, lambda: kind(constants(**own)), None, resync.Constants(**release))


def cost(law: str, at: FloatArray | None, seed: int) -> Cost:
    """The cost of a seed's ride."""
    return run(seed, partial(controller, law, at))


def score(law: str, at: FloatArray) -> float:
    """The mean cost of the training rides."""
    return float(np.mean([cost(law, at, s).total for s in SEEDS]))


def search(law: str, told: Callable[[int, float], None], jobs: int) -> FloatArray:
    """The best place that was found."""
    size = len(asdict(LAWS[law][1]())) + len(RELEASED)
    with Pool(jobs) as pool:

        def scores(places: Sequence[FloatArray]) -> list[float]:
            return pool.map(partial(score, law), places, chunksize=1)

        return minimise(scores, np.zeros(size), STEP, BUDGET, SEARCH_SEED, told)[0]


def main(laws: Sequence[str]) -> None:
    """Search for each law, and write what it found and what that is worth."""
    jobs = os.cpu_count() or 1
    for law in laws or list(LAWS):
        at = search(law, lambda n, best: print(f"{law} {n}/{BUDGET} {best:.4f}", file=sys.stderr, flush=True), jobs)
        print(law, *constants_of(law, at))
        for name, place in (("in force", None), ("found", at)):
            with Pool(jobs) as pool:
                costs = pool.map(partial(cost, law, place), CHECKS, chunksize=1)
            figures = (np.mean([getattr(c, f) for c in costs]) for f in ("lost", "wear", "total"))
            print(law, name, "lost {:.4f}, wear {:.4f}, cost {:.4f}".format(*figures))


if __name__ == "__main__":
    main(sys.argv[1:])
