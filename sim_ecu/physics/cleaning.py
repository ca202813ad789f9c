"""The rail cleaned by slip: an axle meets the energy that those ahead of it have put into a place."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.contact import CURVES, curve_between
from sim_ecu.physics.rail import RAIL_COLUMNS, FloatArray, rail_at

CELL_M = 0.5  # energy is gathered over so much of the rail, as long as a rail takes to change (BLEND_M)
BEHIND_M = 1.0  # of an axle, and ahead of where it can be at the end of a step: what its table covers
BLOCK = 1024  # cells that are made at once
_FAMILY = sorted(CURVES.values(), key=lambda c: c.mu_0)
_LN_MU = np.log([c.mu_0 for c in _FAMILY])
_REST = np.array([c.row()[1:] for c in _FAMILY]).T  # A, B, k_A, k_S, each of the family


@dataclass(frozen=True, slots=True)
class Cleaning:
    """How much energy (kJ/m, both wheels) cleans a contaminated rail, and how clean it gets: this project's choice.

    ln mu_0 goes to ln clean_mu_0 as 1 - exp(-energy / energy_kJ_m). A rail that is no worse stays as it is.
    """

    energy_kJ_m: float = 10.0
    clean_mu_0: float = 0.30

    def mu_0(self, mu_0: FloatArray, kJ_m: FloatArray) -> FloatArray:
        """mu_0 of places that had so much before, after an energy per metre; never less than before."""
        way = np.maximum(math.log(self.clean_mu_0) - np.log(mu_0), 0.0)
        out: FloatArray = mu_0 * np.exp(-np.expm1(-kJ_m / self.energy_kJ_m) * way)
        return out

    @property
    def steepest(self) -> float:
        """k_A + k_S of the clean rail's curve: none on the way to it begins steeper."""
        c = curve_between(self.clean_mu_0)
        return c.k_A + c.k_S


class CleanedRail:
    """The rail under the axles of a train, each with a table of its own. An axle's own energy is for the others."""

    def __init__(self, cleaning: Cleaning, rails: Sequence[FloatArray], positions_m: Sequence[float]) -> None:
        p = np.array(positions_m)
        self._cleaning, self._rails, self._positions_m = cleaning, list(rails), list(positions_m)
        self._start_m = min(positions_m) - 2 * CELL_M - BEHIND_M
        self._met = (p[None, :] > p[:, None]).astype(np.float64)  # [k, j]: whether axle k meets what axle j puts in
        self._energy_kJ = np.zeros((len(p), BLOCK))  # by axle that put it in, and by cell

    def add(self, energy_kJ: FloatArray, from_m: float, to_m: float) -> None:
        """Spread the energy of each axle (axles,) evenly over the way of the train from one distance to another."""
        for j, position in enumerate(self._positions_m):
            if energy_kJ[j] == 0.0:
                continue
            a, b = ((d + (position - self._start_m)) / CELL_M for d in (from_m, to_m))
            first, last = int(a), int(b)
            self._reach(last + 1)
            if first == last:
                self._energy_kJ[j, first] += energy_kJ[j]
                continue
            cells = np.arange(first, last + 1)
            share = (np.minimum(cells + 1, b) - np.maximum(cells, a)) / (b - a)
            self._energy_kJ[j, first : last + 1] += energy_kJ[j] * share

    def tables(self, distance_m: float, ahead_m: float) -> list[FloatArray]:
        """Each axle's rail table, right from BEHIND_M behind it to as much beyond ahead_m of it. Where nothing has been
        put into it, it is the axle's whole own one."""
        return [self._table(k, distance_m, ahead_m) for k in range(len(self._rails))]

    def _table(self, k: int, distance_m: float, ahead_m: float) -> FloatArray:
        rail, at = self._rails[k], distance_m + self._positions_m[k]
        low = int((at - BEHIND_M - self._start_m) / CELL_M)
        high = int((at + ahead_m + BEHIND_M - self._start_m) / CELL_M) + 2
        self._reach(high)
        kJ_m: FloatArray = self._met[k] @ self._energy_kJ[:, low:high] / CELL_M
        if not kJ_m.any():
            return rail
        middle_m = self._start_m + (np.arange(low, high) + 0.5) * CELL_M
        inside = rail[(rail[:, 0] > middle_m[0]) & (rail[:, 0] < middle_m[-1]), 0]
        places = np.union1d(middle_m, inside)
        table = np.empty((len(places), RAIL_COLUMNS))
        table[:, 0] = places
        for row, place in zip(table, places, strict=True):
            row[1:] = rail_at(rail, place)[: RAIL_COLUMNS - 1]
        before = table[:, 1].copy()
        table[:, 1] = self._cleaning.mu_0(before, np.interp(places, middle_m, kJ_m))
        for column, family in enumerate(_REST, 2):
            moved = np.interp(np.log(table[:, 1]), _LN_MU, family) - np.interp(np.log(before), _LN_MU, family)
            table[:, column] = np.maximum(table[:, column] + moved, 0.0)
        return table

    def _reach(self, cells: int) -> None:
        if cells > self._energy_kJ.shape[1]:
            more = np.zeros((len(self._energy_kJ), cells - self._energy_kJ.shape[1] + BLOCK))
            self._energy_kJ = np.concatenate([self._energy_kJ, more], axis=1)
