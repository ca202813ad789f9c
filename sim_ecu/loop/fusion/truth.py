"""What was told, held against what each axle then came to.

A warning is right where the place that it tells is the patch's begin, within NEAR_M; it is false where that place is on
no patch at all, NEAR_M and more from its ends.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_ecu.loop.fusion.patches import PLACES_M
from sim_ecu.loop.fusion.play import SAMPLE_S, TRULY_LOW_PCT, BoolArray, FloatArray, Played

BEHIND = range(1, len(PLACES_M))  # places of the axles that are warned
NEAR_M = 3.0
FRAME_S = 0.02  # from one frame to an axle to the next
SETTLED_M = 1.0  # behind a patch's begin its rail is its own


class Entry(NamedTuple):
    """An axle that comes to a patch. lead_s: for how long it had been warned of it without a break; NaN for not at all.
    told_pct: what was predicted last, NaN for nothing. errors_m: of Distance, in all warnings from the first axle's
    entry to its own."""

    run: int
    axle: int
    speed_m_s: float
    slides: bool
    cleaned: bool
    held: bool
    lead_s: float
    told_pct: float
    true_pct: float
    confirmed: bool
    errors_m: FloatArray


def entry(p: Played, axle: int) -> Entry | None:
    """Of the axle at a place behind the first; None where it never comes to the patch.

    It is warned where the last frame strictly before it is on the patch warns and tells the patch's place, and the
    warning began after the first axle had come to the patch.
    """
    first_s, own_s = enters_s(p, 0), enters_s(p, axle)
    if math.isnan(own_s):
        return None
    seen, drive = p.seen[axle], p.drive
    errors_m = _errors_m(p, axle)
    right = seen.warns & (np.abs(errors_m) <= NEAR_M)
    last = int(np.searchsorted(seen.time_s, own_s)) - 1
    warned = last >= 0 and bool(right[last]) and float(seen.time_s[_begin(seen.warns, last)]) > first_s
    between = seen.warns & (seen.time_s > first_s) & (seen.time_s < own_s)
    settled = int(np.searchsorted(p.way_m + PLACES_M[axle], _start_m(p) + SETTLED_M))
    return Entry(
        run=drive.number,
        axle=axle + 1,
        speed_m_s=drive.speed_m_s,
        slides=drive.slides,
        cleaned=drive.cleaned,
        held=drive.held,
        lead_s=own_s - float(seen.time_s[_begin(right, last)]) if warned else math.nan,
        told_pct=float(seen.mu_pct[last]) if warned else math.nan,
        true_pct=float(p.mu_pct[settled, axle]),
        confirmed=bool(seen.confirmed[last]) if warned else False,
        errors_m=errors_m[between],
    )


def enters_s(p: Played, axle: int) -> float:
    """When the axle at a place is on the patch; NaN where it never comes so far, or there is none."""
    at_m = p.way_m + PLACES_M[axle]
    if p.drive.start_m is None or at_m[-1] < p.drive.start_m + SETTLED_M:
        return math.nan
    return float(np.interp(p.drive.start_m, at_m, _time_s(p)))


def false_warnings(p: Played) -> tuple[int, float]:
    """How often a train was warned of nothing, any axle of it, and for how many seconds."""
    time_s = p.seen[0].time_s
    if not len(time_s):
        return 0, 0.0
    false = np.logical_or.reduce([_false(p, axle) for axle in range(len(PLACES_M))])
    begins = false & ~np.concatenate(([False], false[:-1]))
    return int(begins.sum()), FRAME_S * float(false.sum())


def false_lows(p: Played) -> tuple[int, int]:
    """Frames that tell low adhesion at a place that the axle comes to in the run; and those of them where it finds none
    so low within NEAR_M of it."""
    told = false = 0
    for axle in BEHIND:
        seen, at_m = p.seen[axle], p.way_m + PLACES_M[axle]
        for place in _places_m(p, axle)[seen.warns & (seen.mu_pct < TRULY_LOW_PCT)].tolist():
            begin, end = np.searchsorted(at_m, (place - NEAR_M, place + NEAR_M)).tolist()
            if end < len(at_m):
                told += 1
                false += bool(p.mu_pct[begin : end + 1, axle].min() >= TRULY_LOW_PCT)
    return told, false


def _begin(holds: BoolArray, last: int) -> int:
    """Where that began which holds without a break until last."""
    broken = np.flatnonzero(~holds[: last + 1])
    return int(broken[-1]) + 1 if len(broken) else 0


def _start_m(p: Played) -> float:
    return math.nan if p.drive.start_m is None else p.drive.start_m


def _time_s(p: Played) -> FloatArray:
    return SAMPLE_S * np.arange(1, len(p.way_m) + 1, dtype=np.float64)


def _axle_m(p: Played, axle: int) -> FloatArray:
    """Where the axle is at each frame."""
    way_m: FloatArray = np.interp(p.seen[axle].time_s, _time_s(p), p.way_m)
    return way_m + PLACES_M[axle]


def _places_m(p: Played, axle: int) -> FloatArray:
    """The place that each frame tells; NaN where it tells none."""
    return _axle_m(p, axle) + p.seen[axle].distance_m


def _errors_m(p: Played, axle: int) -> FloatArray:
    """Of Distance, which is 0 once the axle is there."""
    return p.seen[axle].distance_m - np.maximum(_start_m(p) - _axle_m(p, axle), 0.0)


def _false(p: Played, axle: int) -> BoolArray:
    warns = p.seen[axle].warns
    start_m, end_m = p.drive.start_m, p.drive.end_m
    if start_m is None or end_m is None:
        return warns
    place_m = _places_m(p, axle)
    return warns & ~((place_m >= start_m - NEAR_M) & (place_m <= end_m + NEAR_M))
