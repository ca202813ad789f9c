"""Whether a gyro and an accelerometer are the pair that they should be: judged by the raw signals, not by the filters.

The track drives both. Below 1.5 Hz the lateral acceleration is the speed times the yaw rate or more, in phase, but
where a curve begins or ends that is canted; up to 25 Hz the two go together less and less, yet hardly ever against each
other. What has no part in the track is white.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, FloatArray


class Doubt(IntEnum):
    """What speaks against a pair; where several things do, the first counts."""

    NONE = 0
    SILENT = 1  # both say nothing but their own noise
    REVERSED = 2  # one is mounted the other way round
    UNRELATED = 3  # they do not feel the same track
    ACCEL_SMALL = 4  # the accelerometer is dead, or its unit smaller than it should be against the gyro's
    GYRO_DEAD = 5  # the gyro says nothing but its own noise


# The first of these that is held is the doubt. What is dead has no correlation to be judged by; a pair that does not
# belong together has no ratio.
PRECEDENCE = (Doubt.SILENT, Doubt.GYRO_DEAD, Doubt.REVERSED, Doubt.UNRELATED, Doubt.ACCEL_SMALL)

YAW, LAT = range(CHANNELS)
BANDS_HZ = ((0.0, 1.5), (3.0, 10.0), (10.0, 25.0))
LOW, MIDDLE, HIGH = range(len(BANDS_HZ))
MIN_SILENT_BLOCKS = 3  # that silence is judged by where a sensor was loud before

# Bounds, set on 480 nominal and 450 robust conditions (13 s, utilisation 0 to 1, 8 to 52 m/s, noise once and twice the
# design's, a fifth tactical) and on 240 slow or coasting ones; sim-ecu score tells what they find and cost.
# A dead sensor's power in each band (rows; gyro, accelerometer) over that of all it says, in ten seconds. Below 1.5 Hz
# a gyro that died shows for long what it last measured, and one that lives much more.
WHITE_MIN = (0.0, 0.0, 0.75)
WHITE_MAX = ((2.5, 1.5), (1.32, 1.32), (1.25, 1.25))
# The same over one second, as one number: weighed excesses of both sensors' bands. The sensors' own noise stays below
# in 96 % of all seconds, what comes of a track in less than 1 %.
SILENT_WEIGHTS = (0.6, 1.0, 1.5)
SILENT_EXCESS = 1.1
STILL_SILENT_EXCESS = 2.5  # where it is doubted already, or the sensors were silent before
FALLEN_TIMES = 2.0  # as much power in a block before
LOUDEST = 5.5  # times the power of the design's noise: more than that is no silence (noise may be twice as large)
HEARD = 4.0  # times the noise's power: what correlations are judged on
HEARD_SHARE = 0.7  # of the seconds
# Correlations below 1.5 Hz and in 3 to 10 Hz of sound pairs on rails from hardly used to nearly saturated, and the
# degrees of freedom that a second has there. Of a pair on one rail a reversed one has the opposite ones; where the
# contact is saturated both have none, and nothing can be concluded.
COHERENT = np.array([(0.99, 0.96), (0.96, 0.92), (0.85, 0.75), (0.6, 0.4), (0.37, 0.17)])
FREEDOM = np.array([4.0, 14.0])
# Share of the seconds' correlations that are positive. Near saturation a sound pair of a lone wheelset is little
# correlated, yet positive in every second.
UNRELATED_POSITIVE = 0.75
# Rms below 1.5 Hz from which on a curve may begin or end: lateral acceleration, or speed times yaw rate. Through canted
# curves sound pairs were then called reversed or unrelated in 1.5 % of the time, for 7 % where the band always counts.
CURVE_M_S2 = 0.03
# An accelerometer that hears so much, in units of its noise's power, while the gyro hears nothing. A saturated wheelset
# yaws that little. Held at the peak for minutes its acceleration is up to 26 in 3 to 10 Hz, as large as a free one's,
# and below 2.5 above that: so what the first band says counts only where the wheelset is not called saturated for
# nearly all of the time.
GYRO_MISSES_MIDDLE, GYRO_MISSES_HIGH = 6.0, 2.2
MAX_SATURATED = 0.9
GYRO_MISSES_RATIO = 0.70  # decades by which acceleration exceeds speed times (the noise's) yaw rate in 3 to 10 Hz
# One sensor dead beside a live one, judged over one second: in 3 to 10 Hz, above, and over all it is as white as its
# own noise (in units of its power as measured). The other hears more than these: the accelerometer in 3 to 10 Hz or
# above; the gyro by what lateral acceleration its yaw rate makes in 3 to 10 Hz. Finds two of three within 1.5 s.
# In slip cycles the acceleration in 3 to 10 Hz was 46 once; where the wheelset is called saturated it does not count.
ALONE_WHITE, ALONE_ABOVE, ALONE_VARIANCE = 1.7, 1.45, 1.45
LIVE_ACCEL_MIDDLE, LIVE_ACCEL_HIGH = 15.0, 6.0
LIVE_GYRO_MIDDLE = 8.0
# A saturated wheelset swings by itself: its yaw rate goes with no lateral acceleration. Other seconds that are needed.
MIN_FREE, FREE = 9, 0.5
TINY = 1e-12
SLOWEST = 0.1  # m/s


@dataclass(frozen=True, slots=True)
class Bounds:
    """Of what depends on how the wheelset is held.

    reversed: log of how much likelier a reversed pair must be than a sound or an incoherent one. small: decades by
    which the lateral acceleration up to 10 Hz is less than speed times yaw rate. unrelated: sum of the mean
    correlations over none, one, two, three bands in which both are loud; unrelated_middle: the same where 3 to 10 Hz
    alone say so, for what another axle of the train feels comes a moment later, which shows there and hardly below
    1.5 Hz. saturated_times: by how much the acceleration in 3 to 10 Hz beside a white gyro must exceed its bounds where
    the wheelset is called saturated; a dead gyro itself makes the estimate say so.
    """

    reversed: float
    small: float
    unrelated: tuple[float, float, float, float]
    unrelated_middle: float
    saturated_times: float


LONE = Bounds(5.0, -0.10, (-math.inf, 0.2, 0.6, 0.8), -0.1, math.inf)
# In a bogie the primary suspension and the gravity of cross-level part the two: with the bounds above half of 1680
# sound pairs were accused within 14 s (6 to 50 m/s; own and other bogies, curves, axle boxes that shake). With these 11
# of 400 axles of sound trains were within 20 s, none of 216 below 0.8 of the peak (100 trains that no bound was chosen
# on, 6 to 50 m/s, on straights of ERRI and FRA 6). A pair's own correlations do not tell it from another axle's: what
# does is how all gyros go with all accelerometers (`Wiring`). Below 0.8 of the peak 83 % of axles that changed their
# accelerometers are found, 53 % of reversed pairs and 72 % of dead gyros; of frames after a gyro died 12 % are Valid
# and wrong there, where its silence looks like a saturated wheelset's.
IN_BOGIE = Bounds(40.0, -0.5, (-math.inf,) * 4, -math.inf, 1.5)

# rows of the sums over a block of ticks
POWER, CROSS, FINE, LOW_MEAN, MEAN, RAW, SPEED, SATURATED = (
    slice(0, 6), slice(6, 9), slice(9, 11), slice(11, 13), slice(13, 15), slice(15, 17), 17, 18,
)  # fmt: skip
ROWS = 19


@dataclass(frozen=True, slots=True)
class Evidence:
    """Of one pair, over spans of time (s,). Powers in units of the design's sensor noise through the same filter."""

    power: FloatArray  # (s, 3, 2) of the bands
    cross: FloatArray  # (s, 3)
    variance: FloatArray  # (s, 2)
    noise: FloatArray  # (s, 2) power of the fourth differences: above 50 Hz there is little but the sensor's noise
    speed_m_s: FloatArray  # (s,)
    saturated: FloatArray  # (s,) share of the time

    def of(self, spans: BoolArray) -> "Evidence":
        """Of some of the spans (s,)."""
        return Evidence(*(getattr(self, name)[spans] for name in self.__dataclass_fields__))


def evidence(sums: FloatArray) -> Evidence:
    """Of sums (s, ROWS) over ticks, divided by how many they are."""
    mean = sums[:, MEAN]
    return Evidence(
        power=np.maximum(sums[:, POWER].reshape(-1, len(BANDS_HZ), CHANNELS), TINY),
        cross=sums[:, CROSS],
        variance=np.maximum(sums[:, RAW] - mean * mean, TINY),
        noise=np.maximum(sums[:, FINE], TINY),
        speed_m_s=sums[:, SPEED],
        saturated=sums[:, SATURATED],
    )


def silent(newest: FloatArray, before: FloatArray, most: float) -> bool:
    """Whether in the newest blocks (b, ROWS), the newest first, both signals are white, but for an excess, and of the
    size of the sensors' noise.

    When a sensor dies, the mean that is taken off stays behind at its last value, for seconds. So one that was loud
    a moment before is judged about a straight line through what it says now; another, about its mean as known.
    """
    now, then = (b[:, RAW] - b[:, MEAN] ** 2 for b in (newest, before))
    fallen = then.max(axis=0, initial=0.0) > FALLEN_TIMES * now[:MIN_SILENT_BLOCKS].mean(axis=0)
    heard = bool(fallen.any())
    if heard:
        newest = newest[:MIN_SILENT_BLOCKS]
    sums = newest.mean(axis=0)
    power, variance = sums[POWER].reshape(len(BANDS_HZ), CHANNELS).copy(), sums[RAW]
    if heard:
        power[LOW] -= np.where(fallen, _line(newest[:, LOW_MEAN]), 0.0)
        variance = variance - np.where(fallen, _line(newest[:, MEAN]), 0.0)
    variance = np.maximum(variance, TINY)
    excess = np.maximum(power / variance - 1.0, 0.0)
    return bool(np.dot(SILENT_WEIGHTS, excess).sum() < most and variance.max() < LOUDEST)


def _line(means: FloatArray) -> FloatArray:
    """Power of the straight line through the means of blocks (b, …)."""
    t = np.arange(len(means)) - 0.5 * (len(means) - 1)
    square = float(np.mean(t * t))
    slope = np.tensordot(t, means, 1) / (len(t) * square)
    power: FloatArray = means.mean(axis=0) ** 2 + slope**2 * (square + 1.0 / 12.0)
    return power


def dead_alone(e: Evidence, yaw_unit: float, lat_unit: float, bounds: Bounds) -> Doubt:
    """Whether over one second (1,) one sensor of a pair says nothing but its noise while the other is loud."""
    power, noise = e.power[0], e.noise[0]
    share = power / noise
    white = (share[MIDDLE] < ALONE_WHITE) & (share[HIGH] < ALONE_ABOVE) & (e.variance[0] < ALONE_VARIANCE * noise)
    least = LIVE_ACCEL_MIDDLE * (1.0 if e.saturated[0] < MAX_SATURATED else bounds.saturated_times)
    if white[YAW] and (share[HIGH, LAT] > LIVE_ACCEL_HIGH or share[MIDDLE, LAT] > least):
        return Doubt.GYRO_DEAD
    made = power[MIDDLE, YAW] * (e.speed_m_s[0] * yaw_unit / lat_unit) ** 2 / noise[LAT]
    if white[LAT] and made > LIVE_GYRO_MIDDLE:
        return Doubt.ACCEL_SMALL
    return Doubt.NONE


class DoubtFigures(NamedTuple):
    """What a doubt was found by, for a person."""

    low: float = 0.0  # correlation below 1.5 Hz
    middle: float = 0.0  # and in 3 to 10 Hz
    yaw_rms: float = 0.0  # of each signal's alternating part, in units of the design's sensor noise
    lat_rms: float = 0.0
    ratio: float = 0.0  # lateral acceleration below 1.5 Hz over speed times yaw rate
    partner: float = -1.0  # the axle (its place) whose other sensor fits better, -1: none


def figures(e: Evidence, yaw_unit: float, lat_unit: float, partner: int = -1) -> DoubtFigures:
    """Of a pair over spans of time."""
    low, middle, _ = _correlation(e).mean(axis=0).tolist()
    yaw_rms, lat_rms = np.sqrt(e.variance.mean(axis=0)).tolist()
    ratio = 10.0 ** float(_median(_ratios(e, yaw_unit, lat_unit))[LOW])
    return DoubtFigures(low, middle, yaw_rms, lat_rms, ratio, float(partner))


def doubts(e: Evidence, yaw_unit: float, lat_unit: float, tick_s: float, bounds: Bounds) -> set[Doubt]:
    """What speaks against a pair over seconds (s,). The units are what its powers are in, rad/s and m/s².

    Noise is taken as measured, not as designed. Means of the seconds' correlations and medians of their powers: one
    second that is unlike the others, at a change of rail, does not decide.
    """
    median = _median(np.column_stack((e.power.reshape(len(e.power), -1), e.variance, e.noise)))
    power, variance, noise = median[:6].reshape(-1, CHANNELS), median[6:8], median[8:]
    share = power / variance
    white = ((share > np.array(WHITE_MIN)[:, None]) & (share < WHITE_MAX)).all(axis=0)
    white &= variance < LOUDEST  # what is white and louder is drowned in vibration, not dead
    if white.all():
        return {Doubt.SILENT}
    if white[LAT]:
        return {Doubt.ACCEL_SMALL}
    ratios = _median(_ratios(e, yaw_unit, lat_unit))
    out = set()
    _, middle, high = power[:, LAT] / noise[LAT]
    if e.saturated.mean() < MAX_SATURATED:
        clear = middle > GYRO_MISSES_MIDDLE or (middle > HEARD and ratios[MIDDLE] > GYRO_MISSES_RATIO)
    else:
        clear = middle > GYRO_MISSES_MIDDLE * bounds.saturated_times
    if white[YAW] and (high > GYRO_MISSES_HIGH or clear):
        out.add(Doubt.GYRO_DEAD)
    curved = in_curve(e, yaw_unit, lat_unit, tick_s)
    if reversed_odds(e, curved) > bounds.reversed:  # saturated or not: nothing swings so by itself
        out.add(Doubt.REVERSED)
    free = e.saturated < FREE
    if free.sum() < MIN_FREE:
        return out
    if (power[:HIGH, YAW] > HEARD * noise[YAW]).all() and ratios[:HIGH].max() < bounds.small:
        out.add(Doubt.ACCEL_SMALL)
    if _unrelated(e.of(free), noise, curved[free], bounds):
        out.add(Doubt.UNRELATED)
    return out


def _ratios(e: Evidence, yaw_unit: float, lat_unit: float) -> FloatArray:
    """(s, 3): decades by which the lateral acceleration exceeds speed times yaw rate, by band."""
    ratios = 0.5 * np.log10(e.power[..., LAT] / e.power[..., YAW]) - np.log10(np.fmax(e.speed_m_s, SLOWEST))[:, None]
    return np.asarray(ratios + math.log10(lat_unit / yaw_unit))


def in_curve(e: Evidence, yaw_unit: float, lat_unit: float, tick_s: float) -> BoolArray:
    """(s,): seconds in which a curve may begin or end and have set the two against each other below 1.5 Hz: where it is
    canted, gravity takes what the yaw rate makes, or more. Told by so much acceleration or yaw rate, or by too little
    acceleration for the yaw rate."""
    rms = np.sqrt(low_pass_share(tick_s) * e.power[:, LOW]) * (yaw_unit, lat_unit)
    rms[:, YAW] *= e.speed_m_s
    curved = (rms.max(axis=1) > CURVE_M_S2) | (_ratios(e, yaw_unit, lat_unit)[:, LOW] < LONE.small)
    return np.asarray(curved & (e.cross[:, LOW] < 0.0))


def low_pass_share(tick_s: float) -> float:
    """What the first-order filter at 1.5 Hz leaves of white noise's power."""
    w = math.tan(math.pi * BANDS_HZ[LOW][1] * tick_s)
    return w / (1.0 + w)


def reversed_odds(e: Evidence, curved: BoolArray) -> float:
    """Log of how much likelier the seconds' correlations are of a reversed pair than of a sound one, or of none of
    either: summed over the contacts, each of which holds for all of the seconds. curved (s,): see in_curve()."""
    r = _correlation(e)[:, :HIGH]
    rho = COHERENT[:, None]
    freedom = np.where(np.column_stack((curved, np.zeros_like(curved))), 0.0, FREEDOM)
    spread = 0.5 * np.log1p(-rho * rho)
    sound, against = ((freedom * (spread - np.log1p(-sign * rho * r))).sum(axis=(1, 2)) for sign in (1.0, -1.0))
    return float(np.logaddexp.reduce(against) - np.logaddexp.reduce(sound, initial=0.0))


def _median(values: FloatArray) -> FloatArray:
    """Over the first axis. numpy's own imports numpy.ma when it is first called: a tick of 30 ms."""
    ordered = np.sort(values, axis=0)
    n = len(ordered)
    return np.asarray(0.5 * (ordered[(n - 1) // 2] + ordered[n // 2]))


def _correlation(e: Evidence) -> FloatArray:
    """(s, 3) of the bands."""
    return np.asarray(e.cross / np.sqrt(e.power.prod(axis=2)))


def _unrelated(e: Evidence, noise: FloatArray, curved: BoolArray, bounds: Bounds) -> bool:
    """Whether the two do not go together in the bands in which both are loud enough. curved (s,): see in_curve()."""
    r = _correlation(e)
    heard: BoolArray = np.all(e.power > HEARD * noise, axis=2)
    heard[:, LOW] &= ~curved
    bands = heard.mean(axis=0) >= HEARD_SHARE
    if not bands.any():
        return False
    of_bands = [r[heard[:, k], k] for k in np.flatnonzero(bands)]
    positive = np.concatenate(of_bands) > 0.0
    if sum(x.mean() for x in of_bands) < bounds.unrelated[len(of_bands)] and positive.mean() < UNRELATED_POSITIVE:
        return True
    return bool(bands[MIDDLE] and r[:, MIDDLE].mean() < bounds.unrelated_middle)
