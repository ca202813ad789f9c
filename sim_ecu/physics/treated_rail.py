"""The rail as a train's axles change it: what those before have put on a place of it, an axle finds there."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.contact import CURVES, curve_between
from sim_ecu.physics.rail import RAIL_COLUMNS, rail_at

FloatArray = NDArray[np.float64]

CELL_M = 0.5  # amounts are gathered over so much of the rail, as long as a rail takes to change (BLEND_M)
BEHIND_M = 1.0  # of an axle, and ahead of where it can be at the end of a step: what its table covers
BLOCK = 1024  # cells that are made at once
_FAMILY = sorted(CURVES.values(), key=lambda c: c.mu_0)
_LN_MU = np.log([c.mu_0 for c in _FAMILY])
_REST = np.array([c.row()[1:] for c in _FAMILY]).T  # A, B, k_A, k_S, each of the family


class Treatment:
    """How an amount per metre changes a rail: ln mu_0 goes to ln best_mu_0 as 1 - exp(-amount / scale).

    A rail that is no worse stays as it is.
    """

    __slots__ = ()
    ahead_m = 0.0  # of the axle's contact: where it puts the amount on the rail

    @property
    def scale(self) -> float:
        """Amount per metre that goes 63 % of the way."""
        raise NotImplementedError

    @property
    def best_mu_0(self) -> float:
        """mu_0 after very much."""
        raise NotImplementedError

    def met(self, positions_m: Sequence[float]) -> FloatArray:
        """Share (axles, axles) of what axle j has put on the rail that axle k meets, [k, j]."""
        raise NotImplementedError

    def mu_0(self, mu_0: FloatArray, amount: FloatArray) -> FloatArray:
        """mu_0 of places that had so much before, after an amount per metre; never less than before."""
        way = np.maximum(math.log(self.best_mu_0) - np.log(mu_0), 0.0)
        out: FloatArray = mu_0 * np.exp(-np.expm1(-amount / self.scale) * way)
        return out

    @property
    def steepest(self) -> float:
        """k_A + k_S of the best rail's curve: no treated one begins steeper."""
        c = curve_between(self.best_mu_0)
        return c.k_A + c.k_S


class _Deposit:
    """Amounts of one treatment, by axle that put them on the rail, and by cell."""

    def __init__(self, treatment: Treatment, positions_m: Sequence[float], start_m: float) -> None:
        self._met = treatment.met(positions_m)
        self._from_m = [p + treatment.ahead_m - start_m for p in positions_m]
        self.amount = np.zeros((len(positions_m), BLOCK))

    def add(self, amounts: FloatArray, from_m: float, to_m: float) -> None:
        """Spread each axle's amount (axles,) evenly over its way."""
        for j, position in enumerate(self._from_m):
            if amounts[j] == 0.0:
                continue
            a, b = ((d + position) / CELL_M for d in (from_m, to_m))
            first, last = int(a), int(b)
            self._reach(last + 1)
            if first == last:
                self.amount[j, first] += amounts[j]
                continue
            cells = np.arange(first, last + 1)
            share = (np.minimum(cells + 1, b) - np.maximum(cells, a)) / (b - a)
            self.amount[j, first : last + 1] += amounts[j] * share

    def per_metre(self, k: int, low: int, high: int) -> FloatArray:
        """What axle k meets in some cells."""
        self._reach(high)
        out: FloatArray = self._met[k] @ self.amount[:, low:high] / CELL_M
        return out

    def _reach(self, cells: int) -> None:
        if cells > self.amount.shape[1]:
            more = np.zeros((len(self.amount), cells - self.amount.shape[1] + BLOCK))
            self.amount = np.concatenate([self.amount, more], axis=1)


class TreatedRail:
    """The rail under the axles of a train, each with a table of its own. Treatments act one after another."""

    def __init__(
        self, treatments: Sequence[Treatment], rails: Sequence[FloatArray], positions_m: Sequence[float]
    ) -> None:
        self._rails, self._positions_m = list(rails), list(positions_m)
        self._start_m = min(positions_m) - 2 * CELL_M - BEHIND_M
        self._deposits = {t: _Deposit(t, positions_m, self._start_m) for t in treatments}

    def add(self, treatment: Treatment, amounts: FloatArray, from_m: float, to_m: float) -> None:
        """Amounts of each axle (axles,) while the train went from one distance to another: spread evenly over it."""
        self._deposits[treatment].add(amounts, from_m, to_m)

    def total(self, treatment: Treatment) -> float:
        """All that was put on the rail."""
        return float(self._deposits[treatment].amount.sum())

    def tables(self, distance_m: float, ahead_m: float) -> list[FloatArray]:
        """Each axle's rail table, right from BEHIND_M behind it to as much beyond ahead_m of it. Where nothing has been
        put on it, it is the axle's whole own one."""
        return [self._table(k, distance_m, ahead_m) for k in range(len(self._rails))]

    def _table(self, k: int, distance_m: float, ahead_m: float) -> FloatArray:
        rail, at = self._rails[k], distance_m + self._positions_m[k]
        low = int((at - BEHIND_M - self._start_m) / CELL_M)
        high = int((at + ahead_m + BEHIND_M - self._start_m) / CELL_M) + 2
        found = {t: d.per_metre(k, low, high) for t, d in self._deposits.items()}
        if not any(amount.any() for amount in found.values()):
            return rail
        middle_m = self._start_m + (np.arange(low, high) + 0.5) * CELL_M
        inside = rail[(rail[:, 0] > middle_m[0]) & (rail[:, 0] < middle_m[-1]), 0]
        places = np.union1d(middle_m, inside)
        table = np.empty((len(places), RAIL_COLUMNS))
        table[:, 0] = places
        for row, place in zip(table, places, strict=True):
            row[1:] = rail_at(rail, place)[: RAIL_COLUMNS - 1]
        before = table[:, 1].copy()
        for treatment, amount in found.items():
            table[:, 1] = treatment.mu_0(table[:, 1], np.interp(places, middle_m, amount))
        for column, family in enumerate(_REST, 2):
            moved = np.interp(np.log(table[:, 1]), _LN_MU, family) - np.interp(np.log(before), _LN_MU, family)
            table[:, column] = np.maximum(table[:, column] + moved, 0.0)
        return table
