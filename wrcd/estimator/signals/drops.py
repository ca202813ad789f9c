"""Where a wheelset meets a rail with less adhesion: the first signs of it, long before the estimate follows.

Two signs. The residuals: onto a worse rail, the linear model's innovations grow within a few ticks, those of the wet
peak's model do not, while the torque is as it was. The torque: the drive or the brake of one wheelset is taken back by
its slip control, those of the wheelsets behind it are not.

A sign is a suspicion, no estimate: nothing here changes one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import FloatArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.paper.window import BLOCK_TICKS, quiet

TICK_S = 0.005  # of the designs that all limits here are set for
# Whitened innovations that count, as 2 * model + channel, and how. With these weights a track that becomes rougher
# under all models alike raises the sum by 0.9 of its own decades instead of more.
CHANNELS = (1, 3, 5, 6, 7)
WEIGHTS = np.array((0.3, -1.0, 0.3, 0.3, 1.0))
MOST = 1.5  # decades that one channel may say
# Newest blocks, compared with REFERENCE blocks before them, and decades beyond which they are a sign. Set on 1.3 hours
# of unchanging rails (one false sign an hour) and 140 rides onto low rail, all of training seeds.
NEWEST = (1, 2, 4, 8, 12)
LIMITS = (1.1, 0.75, 0.55, 0.5, 0.46)
REFERENCE = 50
LENGTH = NEWEST[-1] + REFERENCE
MIN_NEW, MIN_REFERENCE = 0.5, 0.9  # of the ticks that must have data
STEADY_BLOCKS, STEADY, STEADY_RATIO = 20, 0.1, 0.004  # before the newest: torque that changes less is steady
# Torque of the newest two blocks over that of ten blocks before the newest eight; and over what it must have been.
FALLEN, HELD, MIN_RATIO = 0.85, 0.93, 0.02
TORQUE_NOW, TORQUE_FROM, TORQUE_TO = 2, 8, 18
TORQUE_LATE = 5  # blocks that a slip control takes from the rail's change to that fall
# A joint or a crossing that is too small to be flagged as a pulse drives all models, a worse rail not the wet peak's.
# Where any of the newest innovations of that one stand out by more decades, no sign is believed until they are gone.
WET, JOLT = 1, 0.35  # its place among CHANNELS
JOLT_BLOCKS = NEWEST[-1] + 1
PAUSE = REFERENCE  # blocks after a sign without another of the same wheelset: the reference is of two rails
_POWERS = len(CHANNELS)
_COUNT, _TORQUE, _TORQUE_COUNT = _POWERS, _POWERS + 1, _POWERS + 2
SUMMED = _POWERS + 3  # of a block


@dataclass(init=False, repr=False, eq=False)
class DropWatch:
    """Takes the innovations of all axles tick by tick and looks for signs at the end of every block."""

    _blocks: FloatArray  # oldest first; the last is being filled
    _pause: FloatArray  # blocks to go
    _jolt: FloatArray  # blocks until a jolt is out of the newest
    _steady: BoolArray  # torque, at the newest block's end
    met_m: FloatArray  # way of the train when an axle met a worse rail, NaN where none did
    _block: int = -1  # its number

    def __init__(self, axles: int) -> None:
        self._blocks = np.zeros((LENGTH, SUMMED, axles))
        self._pause = np.zeros(axles)
        self._jolt = np.zeros(axles)
        self._steady = np.zeros(axles, dtype=bool)
        self.met_m = np.full(axles, np.nan)

    def reset(self, axle: int) -> None:
        """Start an axle anew."""
        self._blocks[:, :, axle] = 0.0
        self._pause[axle] = self._jolt[axle] = 0.0
        self._steady[axle] = False
        self.met_m[axle] = np.nan

    def clear(self) -> None:
        """Start all of them anew."""
        for axle in range(self._blocks.shape[2]):
            self.reset(axle)

    @property
    def ready(self) -> BoolArray:
        """(n,): which axles would show a sign now: seen for long enough, their torque steady, the last sign gone by."""
        ticks: FloatArray = self._blocks[:-1, _COUNT].sum(axis=0)
        enough = ticks >= MIN_REFERENCE * REFERENCE * BLOCK_TICKS
        return np.asarray(enough & self._steady & (self._pause == 0.0))

    def add(
        self, number: int, w: FloatArray, usable: BoolArray, ratio: FloatArray, way_m: float, block_m: float,
        behind: Sequence[Sequence[int]],
    ) -> None:  # fmt: skip
        """A tick by its number: whitened innovations (4, 2, n), where they can be used (n,), torque ratios (n,). The
        train has come way_m far, block_m in each block; behind: by axle, those that run behind it."""
        self._open(number // BLOCK_TICKS)
        new, known = self._blocks[-1], np.isfinite(ratio)
        new[:_POWERS] += np.where(usable, np.square(w.reshape(-1, len(ratio))[CHANNELS, :]), 0.0)
        new[_COUNT] += usable
        new[_TORQUE] += np.where(known, ratio, 0.0)
        new[_TORQUE_COUNT] += known
        if (number + 1) % BLOCK_TICKS == 0:
            with quiet():
                self._look(way_m, block_m, behind)

    def _open(self, block: int) -> None:
        """Begin a block, if it is another one. A gap between two empties them all."""
        if block == self._block:
            return
        if block != self._block + 1:
            self._blocks[:] = 0.0
        self._blocks[:-1] = self._blocks[1:]
        self._blocks[-1] = 0.0
        self._block = block

    def _look(self, way_m: float, block_m: float, behind: Sequence[Sequence[int]]) -> None:
        """Look for signs at a block's end."""
        sums = np.cumsum(self._blocks[::-1], axis=0)  # of so many newest blocks
        torque = self._blocks[::-1, _TORQUE] / self._blocks[::-1, _TORQUE_COUNT]
        late = np.where(self._fallen(sums, behind), float(TORQUE_LATE), np.nan)
        highest, lowest = np.maximum.accumulate(torque), np.minimum.accumulate(torque)
        jolted = np.logical_or.reduce([_decades(sums, blocks)[WET] > JOLT for blocks in NEWEST])
        self._jolt = np.where(jolted, JOLT_BLOCKS, np.maximum(self._jolt - 1.0, 0.0))
        for blocks, limit in zip(NEWEST, LIMITS, strict=True):
            at = blocks + STEADY_BLOCKS - 1
            steady = highest[at] - lowest[at] <= STEADY * highest[at] + STEADY_RATIO
            seen = steady & (self._jolt == 0.0) & (_risen(sums, blocks) > limit)
            late = np.where(seen, np.fmin(late, float(blocks)), late)
            if blocks == NEWEST[0]:
                self._steady = steady
        self._pause = np.maximum(self._pause - 1.0, 0.0)
        new = np.isfinite(late) & (self._pause == 0.0)
        self.met_m = np.where(new, way_m - late * block_m, self.met_m)
        self._pause[new] = PAUSE

    def _fallen(self, sums: FloatArray, behind: Sequence[Sequence[int]]) -> BoolArray:
        """(n,): whose torque has fallen while that of the axles behind it that have any has not."""
        was = _ratio(sums[TORQUE_TO - 1] - sums[TORQUE_FROM - 1])
        share = _ratio(sums[TORQUE_NOW - 1]) / was
        drives = was > MIN_RATIO
        beside = [[a for a in b if drives[a]] for b in behind]
        held = np.array([bool(b) and bool((share[b] >= HELD).all()) for b in beside])
        return held & (share < FALLEN) & drives


def _risen(sums: FloatArray, blocks: int) -> FloatArray:
    """(n,): by how much the newest blocks stand out of those before; NaN where either holds too little."""
    risen: FloatArray = WEIGHTS @ np.clip(_decades(sums, blocks), -MOST, MOST)
    return risen


def _decades(sums: FloatArray, blocks: int) -> FloatArray:
    """(CHANNELS, n): the same of each channel, in decades."""
    new, old = sums[blocks - 1], sums[blocks + REFERENCE - 1] - sums[blocks - 1]
    decades: FloatArray = 0.5 * np.log10((new[:_POWERS] / new[_COUNT]) / (old[:_POWERS] / old[_COUNT]))
    few = new[_COUNT] < MIN_NEW * blocks * BLOCK_TICKS
    decades[:, few | (old[_COUNT] < MIN_REFERENCE * REFERENCE * BLOCK_TICKS)] = np.nan
    return decades


def _ratio(sums: FloatArray) -> FloatArray:
    return np.asarray(sums[_TORQUE] / sums[_TORQUE_COUNT])
