"""One ride with and without fusion in the daemon, and each warning held against what the axle then came to."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.fusion.patches import PLACES_M, PatchRide
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.play.encoder import SAMPLE_US
from sim_ecu.play.play import LOG_START_US
from sim_ecu.score.score_play import MessageFrames, TrainFrames
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
AXLES = range(1, len(PLACES_M) + 1)
SAMPLE_S = SAMPLE_US * 1e-6
LOW = ("Low", "VeryLow")
TRULY_LOW_PCT = 8.0


@dataclass(frozen=True, slots=True)
class AheadFrames:
    """What was reported to one axle: arrays by frame (n,). mu_pct and distance_m are NaN where nothing was."""

    time_s: FloatArray
    warns: BoolArray
    confirmed: BoolArray
    mu_pct: FloatArray
    distance_m: FloatArray


@dataclass(frozen=True, slots=True)
class PatchRecord:
    """A run as it came out.

    way_m (steps,), mu_pct (steps, axles): after each step of 5 ms, how far the train has come and the adhesion that
    each axle finds there. false_lows: Valid frames that call a rail low that is not. same: whether the adhesion frames
    with fusion are those without, byte for byte; true where none were made without.
    """

    drive: PatchRide
    seen: tuple[AheadFrames, ...]
    way_m: FloatArray
    mu_pct: FloatArray
    false_lows: int
    same: bool


def play(drive: PatchRide, fusing: Config, plain: Config | None) -> PatchRecord:
    """Drive a run and gather what a core sent whose configuration has fusion, and one without where there is such."""
    scenario = drive.scenario
    pairs = [(Core(config), TrainFrames(AXLES, config)) for config in (fusing, plain) if config is not None]
    for core, _ in pairs:
        core.explains = False

    def frame(stamp_us: int, can_id: int, data: bytes) -> None:
        for core, kept in pairs:
            for out in core.feed_batch(FrameBatch.of([Frame(LOG_START_US + stamp_us, can_id, data)])):
                kept.keep(out.frame.stamp_us - LOG_START_US, out.frame.can_id, out.frame.data)

    run = Lockstep(scenario, make_controller(drive.law, Facts.of(scenario)), None, frame, sensors=True)
    steps = [(step.distance_m, step.mu_available) for step in run]
    mu_pct = 100.0 * np.array([mu for _, mu in steps])
    (_, fused), (_, alone) = pairs[0], pairs[-1]
    return PatchRecord(
        drive=drive,
        seen=tuple(_seen(fused.ahead[a]) for a in AXLES),
        way_m=np.array([d for d, _ in steps]),
        mu_pct=mu_pct,
        false_lows=_false_lows(fused, mu_pct),
        same=all(fused.adhesion[a].data == alone.adhesion[a].data for a in AXLES),
    )


def _seen(frames: MessageFrames) -> AheadFrames:
    evidence = frames.words("Evidence")
    return AheadFrames(
        time_s=np.array(frames.stamps_us) * 1e-6,
        warns=evidence != "None",
        confirmed=evidence == "Confirmed",
        mu_pct=frames.numbers("MuAhead"),
        distance_m=frames.numbers("Distance"),
    )


def _false_lows(fused: TrainFrames, mu_pct: FloatArray) -> int:
    """Valid frames that call a rail low that is not."""
    count = 0
    for k, adhesion in enumerate(fused.adhesion.values()):
        at = np.minimum((np.array(adhesion.stamps_us) * 1e-6 / SAMPLE_S).round().astype(np.int64), len(mu_pct)) - 1
        low = (adhesion.words("Validity") == Validity.VALID) & np.isin(adhesion.words("Surface"), LOW)
        count += int(np.sum(low & (mu_pct[at, k] >= TRULY_LOW_PCT)))
    return count


BEHIND = range(1, len(PLACES_M))  # places of the axles that are warned
NEAR_M = 3.0
FRAME_S = 0.02  # from one frame to an axle to the next
SETTLED_M = 1.0  # behind a patch's begin its rail is its own


class Entry(NamedTuple):
    """An axle that comes to a patch. lead_s: for how long it had been warned of it without a break; NaN for not at all.
    reported_pct: what was predicted last, NaN for nothing. errors_m: of Distance, in all warnings from the first axle's
    entry to its own."""

    run: int
    axle: int
    speed_m_s: float
    slides: bool
    cleaned: bool
    held: bool
    lead_s: float
    reported_pct: float
    true_pct: float
    confirmed: bool
    errors_m: FloatArray


def entry(p: PatchRecord, axle: int) -> Entry | None:
    """Of the axle at a place behind the first; None where it never comes to the patch.

    It is warned where the last frame strictly before it is on the patch warns and gives the patch's place, and the
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
        reported_pct=float(seen.mu_pct[last]) if warned else math.nan,
        true_pct=float(p.mu_pct[settled, axle]),
        confirmed=bool(seen.confirmed[last]) if warned else False,
        errors_m=errors_m[between],
    )


def enters_s(p: PatchRecord, axle: int) -> float:
    """When the axle at a place is on the patch; NaN where it never comes so far, or there is none."""
    at_m = p.way_m + PLACES_M[axle]
    if p.drive.start_m is None or at_m[-1] < p.drive.start_m + SETTLED_M:
        return math.nan
    return float(np.interp(p.drive.start_m, at_m, _time_s(p)))


def false_warnings(p: PatchRecord) -> tuple[int, float]:
    """How often a train was warned of nothing, any axle of it, and for how many seconds."""
    time_s = p.seen[0].time_s
    if not len(time_s):
        return 0, 0.0
    false = np.logical_or.reduce([_false(p, axle) for axle in range(len(PLACES_M))])
    begins = false & ~np.concatenate(([False], false[:-1]))
    return int(begins.sum()), FRAME_S * float(false.sum())


def false_lows(p: PatchRecord) -> tuple[int, int]:
    """Frames that report low adhesion at a place that the axle comes to in the run; and those where it finds none
    so low within NEAR_M of it."""
    warned = false = 0
    for axle in BEHIND:
        seen, at_m = p.seen[axle], p.way_m + PLACES_M[axle]
        for place in _places_m(p, axle)[seen.warns & (seen.mu_pct < TRULY_LOW_PCT)].tolist():
            begin, end = np.searchsorted(at_m, (place - NEAR_M, place + NEAR_M)).tolist()
            if end < len(at_m):
                warned += 1
                false += bool(p.mu_pct[begin : end + 1, axle].min() >= TRULY_LOW_PCT)
    return warned, false


def _begin(holds: BoolArray, last: int) -> int:
    """Where that began which holds without a break until last."""
    broken = np.flatnonzero(~holds[: last + 1])
    return int(broken[-1]) + 1 if len(broken) else 0


def _start_m(p: PatchRecord) -> float:
    return math.nan if p.drive.start_m is None else p.drive.start_m


def _time_s(p: PatchRecord) -> FloatArray:
    return SAMPLE_S * np.arange(1, len(p.way_m) + 1, dtype=np.float64)


def _axle_m(p: PatchRecord, axle: int) -> FloatArray:
    """Where the axle is at each frame."""
    way_m: FloatArray = np.interp(p.seen[axle].time_s, _time_s(p), p.way_m)
    return way_m + PLACES_M[axle]


def _places_m(p: PatchRecord, axle: int) -> FloatArray:
    """The place (m) that each frame gives; NaN where it gives none."""
    return _axle_m(p, axle) + p.seen[axle].distance_m


def _errors_m(p: PatchRecord, axle: int) -> FloatArray:
    """Of Distance, which is 0 once the axle is there."""
    return p.seen[axle].distance_m - np.maximum(_start_m(p) - _axle_m(p, axle), 0.0)


def _false(p: PatchRecord, axle: int) -> BoolArray:
    warns = p.seen[axle].warns
    start_m, end_m = p.drive.start_m, p.drive.end_m
    if start_m is None or end_m is None:
        return warns
    place_m = _places_m(p, axle)
    return warns & ~((place_m >= start_m - NEAR_M) & (place_m <= end_m + NEAR_M))
