"""A row of `sim-ecu loop` that takes tenths of a second, in the processes that drive it, too."""

import os
import signal
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sim_ecu.loop import run_loop
from sim_ecu.loop.loop_rides import RideResult
from sim_ecu.loop.run_loop import Work
from sim_ecu.loop.suites.rides import RidePlan
from sim_ecu.loop.suites.variants import STOPS
from sim_ecu.physics.contact import CURVES

RAIL = "dry, leaf patch"
MARK = "SHORT_ROW_MARK"  # a file that says that something has happened once


def slowly(rng: np.random.Generator) -> RidePlan:
    """A stop on a wet rail from 6 to 7 m/s."""
    return RidePlan(((0.0, CURVES["C"]),), float(rng.uniform(6.0, 7.0)), ((0.0, 0.0), (0.2, 0.0), (0.3, -1.0)), 10.0)


def briefly(_rng: np.random.Generator) -> RidePlan:
    """The beginning of one."""
    return RidePlan(((0.0, CURVES["C"]),), 5.0, ((0.0, 0.0), (0.2, 0.0), (0.3, -1.0)), 0.5)


def play_slowly(work: Work) -> list[RideResult]:
    """In place of `run_loop.play_one`."""
    return _with(slowly, work)


def play_briefly(work: Work) -> list[RideResult]:
    """The same."""
    return _with(briefly, work)


def killed_once(work: Work) -> list[RideResult]:
    """The same, but the first process that is asked is killed."""
    mark = Path(os.environ[MARK])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return _with(briefly, work)


def _with(plan: Callable[[np.random.Generator], RidePlan], work: Work) -> list[RideResult]:
    STOPS[RAIL] = plan  # before the cases are made
    return run_loop.play_one(work)
