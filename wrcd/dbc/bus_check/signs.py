"""Whether signs fit each other: what a curve and what a change of speed say of them.

Gyro against accelerometer in the track's own movement is the estimator's business: its causes tell.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.dbc.bus_check.input_figures import FloatArray, Gathered, Readings

CURVE_BIN_S, SPEED_BIN_S = 1.0, 1.0
MIN_BINS = 8
MIN_CURVE_M_S2 = 0.1  # rms of speed times yaw rate: less is no curve
MIN_ACCELERATION_M_S2 = 0.03  # rms
MIN_TORQUE_NM = 200.0  # rms
MIN_SPEED_M_S = 3.0
FITS, AGAINST = 0.5, -0.5  # correlation


@dataclass(frozen=True, slots=True)
class Fit:
    """What two things that belong together do: fits, does not (None: nothing to tell by), and the text."""

    what: str
    fits: bool | None
    text: str
    axles: tuple[int, ...] = ()  # numbers that it is about


def signs(config: Config, gathered: Gathered) -> list[Fit]:
    """All that a log has to tell of."""
    speed = series_of(config, gathered, Quantity.SPEED)
    out = list(_curves(config, gathered, speed))
    return out + list(_torques(config, gathered, speed))


def _curves(config: Config, gathered: Gathered, speed: Sequence[Readings]) -> Iterator[Fit]:
    """Speed times yaw rate is the lateral acceleration, less what the cant takes: the signs are alike."""
    for place, axle in enumerate(config.axles):
        yaw, lat = (series_of(config, gathered, q, place) for q in (Quantity.YAW_RATE, Quantity.LAT_ACCEL))
        what = f"speed times yaw rate against lateral acceleration, axle {axle.number}"
        if not (yaw and lat and gathered.seconds):
            continue
        columns = means(gathered, CURVE_BIN_S, [yaw[0], lat[0], *speed[:1]])
        v = columns[2] if len(columns) > 2 else np.full(len(columns[0]), config.constant_speed_m_s or math.nan)
        product, sideways = v * columns[0], columns[1]
        there = np.isfinite(product) & np.isfinite(sideways) & (np.abs(v) >= MIN_SPEED_M_S)
        product, sideways = product[there], sideways[there]
        product, sideways = product - _median(product), sideways - _median(sideways)
        if len(product) < MIN_BINS or _rms(product) < MIN_CURVE_M_S2:
            yield Fit(what, None, "no curve to judge by", (axle.number,))
            continue
        names = " or ".join(_name(config, q, place) for q in (Quantity.YAW_RATE, Quantity.LAT_ACCEL))
        remark = f" in curves of {_rms(product):.2f} m/s2 rms"
        yield _fit(what, product, sideways, remark, f"one of them needs sign = -1: {names}", (axle.number,))


def _torques(config: Config, gathered: Gathered, speed: Sequence[Readings]) -> Iterator[Fit]:
    """A torque and what the vehicle does: traction accelerates, braking slows down."""
    if not speed or not gathered.seconds:
        return
    done: set[str] = set()
    for number, i in enumerate(config.inputs):
        name = f"{i.source.message}.{i.source.signal}"
        torques = (Quantity.TORQUE, Quantity.BRAKE_TORQUE)
        if i.source.quantity not in torques or name in done or not gathered.frames[i.source.message]:
            continue
        done.add(name)
        axles = tuple(config.axles[place].number for place in i.source.axles)
        what = f"{i.source.quantity.key.replace('_', ' ')} {name} against the change of speed"
        torque, v = means(gathered, SPEED_BIN_S, [gathered.inputs[number], speed[0]])
        acceleration = np.diff(np.abs(v)) / SPEED_BIN_S
        mean = (torque[1:] + torque[:-1]) / 2
        there = np.isfinite(acceleration) & np.isfinite(mean)
        acceleration, mean = acceleration[there], mean[there]
        if len(mean) < MIN_BINS or _rms(acceleration) < MIN_ACCELERATION_M_S2:
            yield Fit(what, None, "the speed hardly changes", axles)
            continue
        if _rms(mean - mean.mean()) < MIN_TORQUE_NM:
            yield Fit(what, None, "the torque hardly changes", axles)
            continue
        mend = "it needs sign = -1 (traction is positive, braking negative)"
        yield _fit(what, acceleration - acceleration.mean(), mean - mean.mean(), "", mend, axles)


def _fit(what: str, x: FloatArray, y: FloatArray, remark: str, mend: str, axles: tuple[int, ...]) -> Fit:
    r = correlation(x, y)
    text = f"correlation {r:.2f}{remark}" + (f": against each other; {mend}" if r < AGAINST else "")
    return Fit(what, False if r < AGAINST else True if r > FITS else None, text, axles)


def series_of(config: Config, gathered: Gathered, quantity: Quantity, place: int = 0) -> list[Readings]:
    """What came of a quantity of an axle, if anything did."""
    return [
        series
        for series, i in zip(gathered.inputs, config.inputs, strict=True)
        if i.source.quantity is quantity and place in i.source.axles and len(series.stamps)
    ]


def _name(config: Config, quantity: Quantity, place: int) -> str:
    s = next(i.source for i in config.inputs if i.source.quantity is quantity and place in i.source.axles)
    return f"{s.message}.{s.signal}"


def means(gathered: Gathered, bin_s: float, series: Sequence[Readings]) -> list[FloatArray]:
    """Mean values over bins of time, NaN where there are none. Gaps of a log have no bins."""
    assert gathered.first_us is not None
    gaps = gathered.gaps
    bins = max(1, math.ceil(gathered.seconds / bin_s))
    out = []
    for s in series:
        times_us = gaps.taken_out(s.stamps_us) - gathered.first_us
        at = np.minimum((times_us * 1e-6 / bin_s).astype(np.int64), bins - 1)
        counts = np.bincount(at, minlength=bins)
        sums = np.bincount(at, weights=s.si, minlength=bins)
        out.append(np.divide(sums, counts, out=np.full(bins, math.nan), where=counts > 0))
    return out


def _median(x: FloatArray) -> float:
    return float(np.median(x)) if len(x) else 0.0


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(x * x))) if len(x) else 0.0


def correlation(x: FloatArray, y: FloatArray) -> float:
    """Of two (n,) whose means are zero; 0 where one is nothing but zero."""
    both = float(np.sqrt(np.sum(x * x) * np.sum(y * y)))
    return float(np.sum(x * y)) / both if both > 0 else 0.0
