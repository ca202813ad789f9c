"""Low rail found in ordinary running: what a train's axles say of each block of track, and the rule by which it is low.

It takes what is on the bus, or in a log of it: where a wheel is, MuAvailable, the upper end of its interval, Valid. One
definition, of the suite map and of `sim-ecu campaign --logs`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
BLOCK_M = 100.0
LAG_S = 0.5  # a word is of the rail that the wheel has run over: the middle of it lies so far behind
MIN_WORDS = 10  # of an axle in a block, which are 0.2 s: of fewer a median says little
# The rest of a passage that a block is compared with: blocks from APART to REACH away (nearer ones share words and the
# film's edges; further on it may be another line), MIN_REST at least. Of them the best tenth, for a film may be long.
APART, REACH, MIN_REST, BEST = 2, 25, 4, 0.9


class AxleWords(NamedTuple):
    """Adhesion frames of an axle along the track, (n,) each: place on the track; MuAvailable, NaN where it is not
    Valid; the upper end of its interval, inf for none."""

    place_m: FloatArray
    available_pct: FloatArray
    upper_pct: FloatArray


class TrackBlocks(NamedTuple):
    """What a train says of the blocks of track that it has run over in a passage, (b,) each, in the track's order; NaN
    where fewer than half of its axles say enough."""

    number: IntArray  # the block begins at number * BLOCK_M
    available_pct: FloatArray  # median of all Valid words
    upper_pct: FloatArray  # the largest of the axles' medians
    rest_pct: FloatArray  # quantile BEST of available_pct on the rest of the passage


class LowRule(NamedTuple):
    """When a block is low: every axle's upper end lies below upper_pct, and below of_rest times what the train finds on
    the best of the rest. Without the second, a train that finds too little anywhere would call all low."""

    upper_pct: float
    of_rest: float


# By other places and trains than the score's: lots -1 and -2 of the suite map. Where most of three or more must agree,
# each passage may be less sure.
RULE, RULE_OF_THREE, THREE = LowRule(16.0, 1.0), LowRule(18.0, 1.1), 3


def blocks_of(axles: Sequence[AxleWords]) -> TrackBlocks:
    """Return a passage's blocks, from the words of its axles."""
    words = AxleWords(*(np.concatenate(column) for column in zip(*axles, strict=True)))
    axle = np.repeat(np.arange(len(axles)), [len(a.place_m) for a in axles])
    known = np.isfinite(words.place_m)
    block = np.floor(np.where(known, words.place_m, 0.0) / BLOCK_M).astype(np.int64)
    numbers = np.unique(block[known])
    available, upper = np.full((2, len(numbers)), np.nan)
    valid = np.flatnonzero(known & np.isfinite(words.available_pct))
    valid = valid[np.argsort(block[valid], kind="stable")]
    ends_at = np.searchsorted(block[valid], numbers, side="right")
    for k, of_block in enumerate(np.split(valid, ends_at)[: len(numbers)]):
        each = [words.upper_pct[of_block[axle[of_block] == a]] for a in range(len(axles))]
        said = [np.median(ends) for ends in each if len(ends) >= MIN_WORDS]
        if said and 2 * len(said) >= len(axles):
            available[k], upper[k] = np.median(words.available_pct[of_block]), max(said)
    return TrackBlocks(numbers, available, upper, _rest(numbers, available))


def _rest(numbers: IntArray, available_pct: FloatArray) -> FloatArray:
    out = np.full(len(numbers), np.nan)
    for k, number in enumerate(numbers):
        away = np.abs(numbers - number)
        rest = available_pct[(away >= APART) & (away <= REACH) & np.isfinite(available_pct)]
        out[k] = np.quantile(rest, BEST) if len(rest) >= MIN_REST else np.nan
    return out


def is_low(blocks: TrackBlocks, rule: LowRule = RULE) -> BoolArray:
    """Return by block whether a passage calls it low; never where the train says too little of it, or of the rest."""
    with np.errstate(invalid="ignore"):
        return (blocks.upper_pct < rule.upper_pct) & (blocks.upper_pct < rule.of_rest * blocks.rest_pct)


def rule_for(passages: int) -> LowRule:
    """Return the rule by which each of a block's passages is judged, by how many there are."""
    return RULE if passages < THREE else RULE_OF_THREE


def is_low_by_most(low: IntArray | int, passages: IntArray | int) -> BoolArray:
    """Return whether more than half of the passages, of any trains, call a block low. low: how many do."""
    return np.asarray(2 * low > passages)
