"""Sanders, and what their sand makes of a contaminated rail. All amounts are those of one rail: a sander has a nozzle
and a hopper for each, and they are alike.

Published: GM/RT2461 issue 1 lets a train's rear two axles come to rest on less than 7.5 g/m; multiple units of Britain
lay about 2 kg/min. Trials of RSSB (project T1107, reported in Rail Engineer, February 2018) stopped a train of four
cars from 55 mph (24.6 m/s), 0.9 m/s2 demanded, on a rail of 0.02: in more than 1200 m without sand, 800 m with one
sander of fixed rate at axle 3, 650 m with two.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.treated_rail import CELL_M, FloatArray, Treatment

MAX_DENSITY_G_M = 7.5  # GM/RT2461 issue 1
AHEAD_M = CELL_M  # of the axle's contact, where the sand falls: a cell is full before its axle gets there


@dataclass(frozen=True, slots=True)
class Sand(Treatment):
    """How much sand (g per metre of a rail) makes a rail better, how good it gets, and what is left of the sand after
    an axle.

    The three are this project's choice. With them sixteen axles whose adhesion is used to nine tenths stop in 860 m
    with one sander of 2 kg/min at axle 3, and 600 m with a second at axle 7, where T1107 had 800 and 650.
    """

    sand_g_m: float = 2.0
    sanded_mu_0: float = 0.22
    kept: float = 0.8

    ahead_m = AHEAD_M

    @property
    def scale(self) -> float:
        """Sand per metre that goes 63 % of the way."""
        return self.sand_g_m

    @property
    def best_mu_0(self) -> float:
        """mu_0 of the sanded rail."""
        return self.sanded_mu_0

    def met(self, positions_m: Sequence[float]) -> FloatArray:
        """The whole sand of an axle's own sander; of another one ahead what the axles between have left of it."""
        p = np.array(positions_m)
        over = np.array([[np.count_nonzero((p > own) & (p <= other)) for other in p] for own in p])
        out: FloatArray = np.where(p[None, :] >= p[:, None], self.kept**over, 0.0)
        return out


@dataclass(frozen=True, slots=True)
class Sander:
    """A sander: its most (kg/min), the time from a command to the sand on the rail, and what its hopper holds.

    The rate is that of Britain's multiple units; delay and stock are this project's choice.
    """

    max_kg_min: float = 2.0
    delay_s: float = 0.5
    stock_kg: float = 15.0


class SanderState:
    """A sander in steps of any length. left_kg: in its hopper."""

    def __init__(self, sander: Sander, step_s: float) -> None:
        self._max_kg_min, self._step_s = sander.max_kg_min, step_s
        self._coming = deque([0.0] * round(sander.delay_s / step_s))
        self.left_kg = sander.stock_kg

    def step(self, kg_min: float) -> float:
        """One step on, commanded so much; returns the sand (kg) that comes to the rail in it."""
        self._coming.append(min(max(kg_min, 0.0), self._max_kg_min))
        laid_kg = min(self._coming.popleft() / 60.0 * self._step_s, self.left_kg)
        self.left_kg -= laid_kg
        return laid_kg
