"""How far the train has come, and where its axles met a worse rail: the tick's side of fusion along the vehicle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wrcd.core.inputs import BACKWARDS_M_S, TickInputs
from wrcd.estimator.design import FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.paper.window import BLOCK_TICKS
from wrcd.estimator.records import StepResult, Tick
from wrcd.estimator.signals.drops import DropWatch


class View(NamedTuple):
    """What is reported in a slot. Arrays are by axle (n,)."""

    epoch: int  # another one: nothing that was known of places before holds
    way_m: float  # of the train; NaN where its speed is not known
    speed_m_s: float
    x_m: FloatArray  # where the axles stand in the direction of travel, ahead of the train's way
    met_m: FloatArray  # the train's way when an axle met a worse rail, NaN where none did
    ready: BoolArray  # whose signals would show it
    lost: BoolArray  # whose sensors or estimator broke since the slot before


@dataclass(init=False, repr=False, eq=False)
class Front:
    """Integrates the speed that is received, and watches the axles. Positions in m, forward positive."""

    _watch: DropWatch
    _lost: BoolArray
    _way_m: float = 0.0
    _epoch: int = 0
    _known: bool = False  # whether the speed is
    _speed_m_s: float = 0.0
    _reverse: bool = False

    def __init__(self, positions_m: Sequence[float], tick_s: float) -> None:
        forward = np.array(positions_m, np.float64)
        self._places = _order(forward), _order(-forward)  # by whether it runs in reverse
        self._tick_s = tick_s
        self._watch = DropWatch(len(positions_m))
        self._lost = np.zeros(len(positions_m), dtype=bool)

    def move(self, tick: TickInputs, reverse: bool) -> None:
        """A tick is over. Speed that is unknown, silent, backwards or jumps, and another direction, start anew."""
        known = tick.speed_m_s > -BACKWARDS_M_S and len(tick.unavailable) < len(self._x_m)  # no: also NaN
        if known != self._known or reverse != self._reverse or (known and tick.speed_jumped):
            self.clear()
        self._known, self._reverse = known, reverse
        self._speed_m_s = max(tick.speed_m_s, 0.0) if known else 0.0
        self._way_m += self._speed_m_s * self._tick_s

    def step(self, tick: Tick, result: StepResult) -> None:
        """The estimator has taken a tick."""
        if self._known:
            usable = result.in_window & ~result.near_pulse
            block_m = self._speed_m_s * self._tick_s * BLOCK_TICKS
            self._watch.add(tick.number, result.whitened, usable, tick.torque_ratio, self._way_m, block_m, self._behind)

    def lend(self, record: np.void) -> None:
        """Put the state into wrcd_front of wrcd/core/c/lane.h, which goes on with it."""
        watch, n = self._watch, len(self._lost)
        record["block"][:n] = watch._blocks.transpose(2, 0, 1)
        record["pause"][:n], record["jolt"][:n], record["steady"][:n] = watch._pause, watch._jolt, watch._steady
        record["way_m"], record["speed_m_s"], record["newest"] = self._way_m, self._speed_m_s, watch._block
        record["behind"][:n] = [sum(1 << other for other in behind) for behind in self._behind]
        self.lend_news(record)

    def lend_news(self, record: np.void) -> None:
        """The same of what is told once."""
        record["met_m"][: len(self._lost)] = self._watch.met_m

    def take_back(self, record: np.void) -> None:
        """The state as it has become there."""
        watch, n = self._watch, len(self._lost)
        watch._blocks[:] = record["block"][:n].transpose(1, 2, 0)
        watch._pause[:], watch._jolt[:] = record["pause"][:n], record["jolt"][:n]
        watch._steady, watch._block = record["steady"][:n] > 0.0, int(record["newest"])
        watch.met_m[:] = record["met_m"][:n]
        self._way_m, self._speed_m_s = float(record["way_m"]), float(record["speed_m_s"])

    def goes_on(self, reverse: bool) -> bool:
        """Whether the speed is known, and the train runs the way it did."""
        return self._known and self._reverse == reverse

    def reset(self, axle: int, lost: bool) -> None:
        """An axle starts anew; lost: since its sensors or its estimator broke."""
        self._watch.reset(axle)
        self._lost[axle] |= lost

    def clear(self) -> None:
        """Nothing that was known of places holds."""
        self._epoch += 1
        self._way_m = 0.0
        self._watch.clear()
        self._lost[:] = False

    def view(self) -> View:
        """How it is now, and what is new since the newest forget_news()."""
        way_m, watch = self._way_m if self._known else math.nan, self._watch
        met_m, lost = watch.met_m.copy(), self._lost.copy()
        return View(self._epoch, way_m, self._speed_m_s, self._x_m, met_m, watch.ready, lost)

    def forget_news(self) -> None:
        """A slot is over: what an axle met, or lost, is no news to the next."""
        self._lost[:] = False
        self._watch.met_m[:] = np.nan

    @property
    def _x_m(self) -> FloatArray:
        return self._places[self._reverse][0]

    @property
    def _behind(self) -> Sequence[Sequence[int]]:
        return self._places[self._reverse][1]


def _order(x: FloatArray) -> tuple[FloatArray, list[list[int]]]:
    """Where axles stand in the direction of travel, and which of them run behind each."""
    return x, [np.flatnonzero(x < own).tolist() for own in x]
