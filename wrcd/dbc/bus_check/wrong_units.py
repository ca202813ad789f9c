"""Whether a signal is in another unit than it is read in: which unit the log itself makes likely.

The estimate stays Valid on some such mistakes, so each axle's gyro and accelerometer are judged by what no unit
mistake leaves alone: their noise, the lateral acceleration's size, and its ratio to speed times yaw rate. Each unit
that a signal may be in gets a cost in nats: how far its readings would lie beyond what sound sensors show.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.units import Quantity, factor
from wrcd.config.statements import TORQUES, Statement
from wrcd.core.configuration import Config, Input
from wrcd.dbc.bus_check.findings import BusFinding
from wrcd.dbc.bus_check.input_figures import FloatArray, Gathered, IntArray, SignalFigures
from wrcd.dbc.bus_check.signs import MIN_SPEED_M_S, correlation, means, series_of

# Units that such signals are given in.
CANDIDATES = {
    Quantity.LAT_ACCEL: ("m/s2", "g", "mg", "mm/s2"),
    Quantity.YAW_RATE: ("rad/s", "deg/s", "mrad/s"),
    Quantity.SPEED: ("m/s", "km/h"),
}
PAIR = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)
Suspect = tuple[Input, Mapping[float, str]]  # a signal, and the units that it may be in (_others)
# A curve and its cant change slowly: second differences of means over 0.2 s show the track's own movement, at 1 to
# 3 Hz, and their median leaves a transition out.
BIN_S = 0.2
SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])
MAD = 0.6745  # median size of what is normal with rms 1
MIN_BINS = 40
USUAL_SPEED_M_S = 25.0
# An accelerometer that says so many times its own noise, or goes with the gyro so far, is loud. Another may be dead,
# and its size tells no unit.
LOUD, CORRELATED = 1.5, 0.5


@dataclass(frozen=True, slots=True)
class Usual:
    """What sound signals show: low … high; the spread beyond each end, in decades; and the most that it costs."""

    low: float
    high: float
    below: float
    above: float
    most_below: float
    most_above: float

    def cost(self, x: float) -> float:
        """In nats."""
        below = max(math.log10(self.low / x), 0.0) / self.below
        above = max(math.log10(x / self.high), 0.0) / self.above
        return min(0.5 * below * below, self.most_below) + min(0.5 * above * above, self.most_above)


OTHER_UNIT = 3.0  # nats: few signals are in another unit than their DBC says
CLEAR = 2.0  # nats by which what is named is likelier than what is not
# Of all packaged scenarios with both sets of sensors, two seeds each: noise 0.17 … 2.6 (gyro) and 0.48 … 1.1
# (accelerometer; 35 under vibration) times the design's, ratio 0.72 … 30, size 0.006 … 0.33 m/s2 at 17 to 25 m/s.
# A filter in a sensor makes its noise small: that alone must name nothing, so it costs no more than OTHER_UNIT.
YAW_NOISE = Usual(0.15, 3.0, 0.15, 0.2, OTHER_UNIT, 6.0)  # times the design's
LAT_NOISE = Usual(0.4, 3.0, 0.15, 0.5, OTHER_UNIT, 6.0)
RATIO = Usual(0.72, 5.0, 0.1, 0.5, 12.0, 12.0)  # lateral acceleration over speed times yaw rate
SIZE_M_S2 = Usual(0.006, 1.0, 0.2, 0.2, 8.0, 8.0)  # at USUAL_SPEED_M_S; below it falls with the square of the speed
MAX_SPEED_M_S = 100.0

# A torque as a share of what would slide at an adhesion of one.
KILO = 1000.0
MAX_SHARE = 2.0  # beyond any adhesion
MIN_SHARE = 0.001  # a train that moves needs more
SMOOTH = 0.1  # noise over the largest torque: more is a torque of zero


@dataclass(frozen=True, slots=True)
class UnitPair:
    """A gyro and an accelerometer as they are read: noise in units of the design's, sizes in m/s2."""

    inputs: tuple[Input, Input]
    yaw_noise: float
    lat_noise: float
    lat_m_s2: float
    product_m_s2: float  # of speed times yaw rate
    speed_m_s: float
    loud: bool

    def cost(self, yaw: float, lat: float, speed: float) -> float:
        """Of being so many times as large as they are read."""
        out = YAW_NOISE.cost(self.yaw_noise * yaw) + LAT_NOISE.cost(self.lat_noise * lat)
        if self.loud:
            slow = min(self.speed_m_s * speed / USUAL_SPEED_M_S, 1.0)
            out += RATIO.cost(self.lat_m_s2 * lat / (self.product_m_s2 * yaw * speed))
            out += SIZE_M_S2.cost(self.lat_m_s2 * lat / slow**2)
        return out + OTHER_UNIT * sum(x != 1.0 for x in (yaw, lat, speed))


def wrong_units(
    config: Config, mappings: Sequence[Statement], gathered: Gathered, found: Sequence[SignalFigures]
) -> list[BusFinding]:
    """The signals that are likelier in another unit than in the one that they are read in. mappings: what the
    configuration's file says of its inputs."""
    out = [*_speeds(config, found), *_torques(config, gathered, found)]
    places = range(len(config.axles))
    pairs = [pair for place in places if (pair := _pair(config, gathered, found, place)) is not None]
    speed = list(_shared(config, pairs))
    out += speed or [suspect for pair in pairs for suspect in _named(config, pair)]
    return [_finding(mappings, i, units) for i, units in out]


def _shared(config: Config, pairs: Sequence[UnitPair]) -> Iterator[Suspect]:
    """The speed, where its unit alone makes all pairs likely: of several axles it is one mistake, where each axle's
    accelerometer would be another."""

    def total(speed: float) -> float:
        costs = 0.0
        for p in pairs:
            yaws, lats = ((1.0, *_others(config, i)) for i in p.inputs)
            costs += min(p.cost(yaw, lat, speed) for yaw, lat in product(yaws, lats))
        return costs - OTHER_UNIT * (len(pairs) - 1) * (speed != 1.0)

    speeds = [(x, unit, i) for i in _speed_inputs(config) for x, unit in _others(config, i).items()]
    if len(pairs) < 2 or not speeds:
        return
    least, times, unit, i = min(((total(x), x, unit, i) for x, unit, i in speeds), key=lambda found: found[0])
    if least + CLEAR < total(1.0):
        yield i, {times: unit}


def _speed_inputs(config: Config) -> list[Input]:
    return [i for i in config.inputs if i.source.quantity is Quantity.SPEED]


def _named(config: Config, p: UnitPair) -> Iterator[Suspect]:
    """What all likely hypotheses of a pair and its speed say of the same signals."""
    speeds = (1.0, *(x for i in _speed_inputs(config) for x in _others(config, i)))
    known = [{1.0: ""} | _others(config, i) for i in p.inputs]
    costs = {times: p.cost(*times) for times in product(*known, speeds)}
    least = min(costs.values())
    likely = sorted((times for times in costs if costs[times] < least + CLEAR), key=lambda times: costs[times])
    if len({tuple(x != 1.0 for x in times) for times in likely}) > 1 or likely[0][2] != 1.0:
        return
    for k, i in enumerate(p.inputs):
        if likely[0][k] != 1.0:
            yield i, {times[k]: known[k][times[k]] for times in likely}


def _pair(config: Config, gathered: Gathered, found: Sequence[SignalFigures], place: int) -> UnitPair | None:
    """An axle's pair, where there is enough of it that runs."""
    mine = [
        next(k for k, i in enumerate(config.inputs) if i.source.quantity is q and place in i.source.axles)
        for q in PAIR
    ]  # fmt: skip
    yaw, lat = (gathered.inputs[k] for k in mine)
    if not (len(yaw.stamps) and len(lat.stamps)):
        return None
    speed = series_of(config, gathered, Quantity.SPEED)[:1]
    columns = means(gathered, BIN_S, [yaw, lat, *speed])
    if len(columns[0]) < len(SECOND_DIFFERENCE):
        return None
    v = columns[2] if speed else np.full(len(columns[0]), config.constant_speed_m_s or math.nan)
    made, sideways = (np.convolve(x, SECOND_DIFFERENCE, "valid") for x in (v * columns[0], columns[1]))
    v = v[1:-1]
    there = np.isfinite(made) & np.isfinite(sideways) & (np.abs(v) >= MIN_SPEED_M_S)
    made_m_s2, lat_m_s2 = _size(made[there]), _size(sideways[there])
    if there.sum() < MIN_BINS or not min(found[mine[0]].noise, found[mine[1]].noise, made_m_s2, lat_m_s2) > 0.0:
        return None
    own_m_s2 = found[mine[1]].noise * _left(lat.stamps_us)
    return UnitPair(
        inputs=(config.inputs[mine[0]], config.inputs[mine[1]]),
        yaw_noise=found[mine[0]].noise / float(config.design.noise_rms[0]),
        lat_noise=found[mine[1]].noise / float(config.design.noise_rms[1]),
        lat_m_s2=lat_m_s2,
        product_m_s2=made_m_s2,
        speed_m_s=float(np.median(np.abs(v[there]))),
        loud=lat_m_s2 > LOUD * own_m_s2 or abs(correlation(made[there], sideways[there])) > CORRELATED,
    )


def _size(x: FloatArray) -> float:
    """Rms of what is no exception."""
    return float(np.median(np.abs(x))) / MAD if len(x) else 0.0


def _left(stamps_us: IntArray) -> float:
    """Of white noise with rms 1, in the second differences of its means."""
    gap_s = float(np.median(np.diff(stamps_us))) * 1e-6
    return float(np.linalg.norm(SECOND_DIFFERENCE)) * math.sqrt(min(1.0, gap_s / BIN_S))


def _speeds(config: Config, found: Sequence[SignalFigures]) -> Iterator[Suspect]:
    """A speed that no train on wheels reaches."""
    for i, f in zip(config.inputs, found, strict=True):
        largest_m_s = max(abs(f.low), abs(f.high))
        if i.source.quantity is Quantity.SPEED and largest_m_s > MAX_SPEED_M_S:
            slower = {times: unit for times, unit in _others(config, i).items() if largest_m_s * times <= MAX_SPEED_M_S}
            if slower:
                yield i, slower


def _torques(config: Config, gathered: Gathered, found: Sequence[SignalFigures]) -> Iterator[Suspect]:
    """Torques that no wheel carries, or that move no train."""
    tops = [float(np.abs(s.si).max()) for s in series_of(config, gathered, Quantity.SPEED)[:1]]
    moves = max(tops, default=config.constant_speed_m_s or 0.0) > MIN_SPEED_M_S
    most_Nm = 2.0 * config.design.normal_N * config.design.r_0
    named = set()
    for i, f in zip(config.inputs, found, strict=True):
        if i.source.quantity not in TORQUES or f.name in named or not f.low < f.high:
            continue
        named.add(f.name)
        largest_Nm = max(abs(f.low), abs(f.high))
        in_kilo = _now(config, i) > math.sqrt(KILO)
        if in_kilo and largest_Nm > MAX_SHARE * most_Nm:
            yield i, {1.0 / KILO: "Nm"}
        elif not in_kilo and moves and f.noise < SMOOTH * largest_Nm < SMOOTH * MIN_SHARE * most_Nm:
            yield i, {KILO: "kNm"}


def _now(config: Config, i: Input) -> float:
    """The size of the factor from what a signal says to SI units."""
    s = i.source
    if s.factor is not None:
        return abs(s.factor)
    return factor(find_signal(find_message(config.database, s.message), s.signal).unit, s.quantity)


def _others(config: Config, i: Input) -> dict[float, str]:
    """Units that a signal may be in besides its own, by how many times as large as it is read it would then be."""
    now, q = _now(config, i), i.source.quantity
    times = {factor(unit, q) / now: unit for unit in CANDIDATES[q]}
    return {x: unit for x, unit in times.items() if not math.isclose(x, 1.0, rel_tol=1e-3)}


def _finding(mappings: Sequence[Statement], i: Input, units: Mapping[float, str]) -> BusFinding:
    """Names the units that a signal may be in, the likeliest first, with the line that mends it."""
    s = i.source
    (mapping,) = (
        m for m in mappings if (m.quantity, m.axles, m.part, m.signal) == (s.quantity, s.axles, s.part, s.signal)
    )
    if mapping.given.at == "rim":  # of a force
        units = {times: unit.removesuffix("m") for times, unit in units.items()}
    each = " or ".join(
        f"in {unit}, {times:.3g} times too small" if times > 1.0 else f"in {unit}, {1 / times:.3g} times too large"
        for times, unit in units.items()
    )
    mend = mapping.table.line(unit=next(iter(units.values())))
    return BusFinding(
        True,
        f"{s.message}.{s.signal}",
        f"the {s.quantity.key.replace('_', ' ')} reads as if it were {each}; if it is, {mend}, or mend the unit in the "
        "DBC",
    )
