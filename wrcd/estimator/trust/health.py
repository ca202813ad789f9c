"""Whether gyro and accelerometer are the pair that they should be: one posterior over what may be wrong with them.

Every SPAN_TICKS what both say, how they go together, and how with the other axle of their bogie, becomes a vector of
features. A small network, fitted to simulated pairs of every kind and kept in the design, says how much likelier each
state makes them than a sound pair does: the rail is unknown to all states alike. The log odds forget slowly, allow for
a sensor that breaks, and take up each span's evidence, tempered, since what misleads in one span misleads in the next.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from wrcd.estimator.design import CERTAIN, CHANNELS, COLUMNS, PAIR_STATES, FloatArray, HealthModel, IntArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.trust.pair import BANDS, PairSums, Span

SPAN_TICKS = 48
MIN_SHARE = 0.5  # of a span's ticks that an axle must have data in
SPANS = (5, 25)  # of the means beside the newest span, 1.2 and 6 s: what was loud before is gone then
FLOOR = 0.02  # of the noise's power
MOST = 5.0  # standard deviations of a feature
SOUND_ALONE = np.r_[0.0, np.full(len(PAIR_STATES) - 1, -CERTAIN)]  # where nothing is judged
YAW, LAT = range(CHANNELS)
ACROSS = ((YAW, YAW), (LAT, LAT), (YAW, LAT), (LAT, YAW))  # own signal, partner's
MIN_RATIO, MIN_SPEED_M_S = 0.003, 1.0
OWN = BANDS * CHANNELS + BANDS + 2 * CHANNELS
FEATURES = OWN + len(SPANS) * (OWN + 8 * BANDS + COLUMNS) + 2 + COLUMNS


class PairState(IntEnum):
    """What a pair may be."""

    SOUND = 0
    REVERSED = 1
    GYRO_DEAD = 2  # it says nothing but its own noise
    ACCEL_DEAD = 3
    BOTH_DEAD = 4
    OTHER_AXLE = 5
    WRONG_UNIT = 6
    LATE = 7

    @property
    def words(self) -> str:
        """The same in words."""
        return PAIR_STATES[self]


class HealthFigures(NamedTuple):
    """What leads beside a sound pair, with its probability, and what that was found by, for a person."""

    state: int
    probability: float
    sound: float
    low: float  # correlation below 1.5 Hz
    middle: float  # and in 3 to 10 Hz
    yaw_rms: float  # of each signal's alternating part, in units of the design's sensor noise
    lat_rms: float


@dataclass(frozen=True, slots=True)
class PairMeans:
    """Means of one pair's signals over a span or longer (…, n): powers (BANDS, 2, n) of the bands, products (BANDS, n)
    of the two; of_partner (2, 4, BANDS, n): gyro with gyro, accelerometer with accelerometer, gyro with the partner's
    accelerometer, accelerometer with its gyro, the partner's a wheelbase ago, and the own ones; partner (BANDS, 2, n)
    its powers. All 0 where there is no partner. inputs (COLUMNS, n): what the rules were given."""

    power: FloatArray
    cross: FloatArray
    fine: FloatArray
    variance: FloatArray
    of_partner: FloatArray
    partner: FloatArray
    inputs: FloatArray

    def joined(self) -> FloatArray:
        """(rows, n)."""
        n = self.cross.shape[1]
        return np.concatenate([getattr(self, name).reshape(-1, n) for name in self.__dataclass_fields__])


def split(rows: FloatArray) -> PairMeans:
    """What PairMeans.joined() gave."""
    n = rows.shape[1]
    parts = np.split(rows, np.cumsum([math.prod(shape) for shape in SHAPES]))
    return PairMeans(*(part.reshape(*shape, n) for part, shape in zip(parts, SHAPES, strict=False)))


SHAPES = (
    (BANDS, CHANNELS), (BANDS,), (CHANNELS,), (CHANNELS,), (2, 4, BANDS), (BANDS, CHANNELS), (COLUMNS,),
)  # fmt: skip
ROWS = sum(math.prod(shape) for shape in SHAPES)


def rows_of(span: Span, known: BoolArray, inputs: FloatArray) -> PairMeans:
    """Of every pair with its partner's; known (n,): which pairs have one that counts; inputs (n, COLUMNS)."""
    n = len(known)
    bogie, own = np.divmod(np.arange(n), 2)
    their = 1 - own

    def product(channel: int, place: IntArray, other: int, beside: IntArray) -> FloatArray:
        return np.asarray(span.together[:, bogie, channel, place, other, beside])

    across = [
        [span.apart[:, bogie, c, own, d, their] for c, d in ACROSS],
        [span.apart[:, bogie, d, their, c, own] for c, d in ACROSS],
    ]
    return PairMeans(
        power=np.stack([product(c, own, c, own) for c in (YAW, LAT)], axis=1),
        cross=product(YAW, own, LAT, own),
        fine=span.fine,
        variance=span.variance,
        of_partner=np.where(known, np.array(across), 0.0),
        partner=np.where(known, np.stack([product(c, their, c, their) for c in (YAW, LAT)], axis=1), 0.0),
        inputs=np.where(np.isfinite(inputs), inputs, 0.0).T,
    )


def _own(r: PairMeans) -> FloatArray:
    """(OWN, n): log powers, correlations, log powers of noise and of all."""
    power = r.power + FLOOR
    plain = np.log10(np.maximum(np.concatenate((r.fine, r.variance)), 0.0) + FLOOR)
    correlation = r.cross / np.sqrt(power[:, YAW] * power[:, LAT])
    return np.concatenate((np.log10(power).reshape(-1, r.cross.shape[1]), correlation, plain))


def _with_partner(r: PairMeans) -> FloatArray:
    """(8 BANDS, n): correlations with the partner's signals; 0 where there is none."""
    own, their = r.power + FLOOR, r.partner + FLOOR
    mine = own[:, [c for c, _ in ACROSS]].swapaxes(0, 1)
    theirs = their[:, [d for _, d in ACROSS]].swapaxes(0, 1)
    return np.asarray((r.of_partner / np.sqrt(mine * theirs)).reshape(-1, r.cross.shape[1]))


def features(newest: PairMeans, means: list[PairMeans], speed_m_s: float, ratio: FloatArray) -> FloatArray:
    """(n, FEATURES): of the newest span and of the longer means."""
    n = len(ratio)
    parts = [_own(newest)]
    for mean in means:
        parts += [_own(mean), _with_partner(mean), mean.inputs]
    speed = np.full((1, n), math.log10(max(speed_m_s, MIN_SPEED_M_S)))
    torque = np.log10(np.maximum(np.where(np.isfinite(ratio), ratio, 0.0), MIN_RATIO))[None]
    return np.concatenate((*parts, speed, torque, newest.inputs)).T


class PairHealth:
    """Sums up what each pair says, and keeps the log odds of each state over a sound pair.

    They stay as they are while an axle has no data: what is known of the wires holds across gaps and standstills.
    judges: whether the design has a part for it; else every pair counts as sound, and nothing is summed up.
    """

    pairs: PairSums
    _rows: FloatArray  # (SPANS[-1], ROWS, n) of the newest spans in which an axle had data, the newest first
    _held: FloatArray  # (n,): how many there are
    log_odds: FloatArray  # (n, STATES)

    def __init__(
        self, model: HealthModel | None, noise_rms: FloatArray, tick_s: float, axles: int, wheelbase_m: float
    ) -> None:
        self._model, self.judges = model, model is not None
        self.pairs = PairSums(noise_rms, tick_s, axles, wheelbase_m)
        partner = np.arange(axles) ^ 1  # the other axle of a bogie
        self._alone = partner >= axles
        self._partner = np.where(self._alone, 0, partner)
        self._rows = np.zeros((SPANS[-1], ROWS, axles))
        self._held = np.zeros(axles)
        self.log_odds = np.tile(SOUND_ALONE if model is None else model.log_prior, (axles, 1))

    def reset(self, axle: int) -> None:
        """Start an axle's filters and its span anew, after a gap; what was found out before stays."""
        self.pairs.reset(axle)

    def probabilities(self) -> FloatArray:
        """(n, STATES)."""
        return _softmax(self.log_odds)

    @property
    def state(self) -> IntArray:
        """(n,): the PairState that leads where a pair is not more likely sound than not."""
        p = self.probabilities()
        return np.where(p[:, PairState.SOUND] < 0.5, p[:, 1:].argmax(axis=1) + 1, PairState.SOUND)

    def look(self, speed_m_s: float, ratio: FloatArray, inputs: FloatArray) -> None:
        """At a span's end, at a speed: torque ratio of the moment (n,), and what the rules were given (n, COLUMNS)."""
        span = self.pairs.take(speed_m_s)
        known = (span.ticks >= MIN_SHARE * SPAN_TICKS) & span.goes_on
        if self._model is not None and known.any():
            self._put(span, known, inputs)
            odds = updated(self._model, self.log_odds, self.features(speed_m_s, ratio))
            self.log_odds = np.where(known[:, None] & np.isfinite(odds), odds, self.log_odds)

    def _put(self, span: Span, known: BoolArray, inputs: FloatArray) -> None:
        """The span becomes the newest of the axles that are known. A partner counts that has data and is not doubted
        itself."""
        sound = self.probabilities()[:, PairState.SOUND] >= 0.5
        counts = (known & sound)[self._partner] & ~self._alone
        newest = rows_of(span, counts, inputs)
        self._rows = np.where(known, np.concatenate((newest.joined()[None], self._rows[:-1])), self._rows)
        self._held = np.minimum(self._held + known, SPANS[-1])

    def features(self, speed_m_s: float, ratio: FloatArray) -> FloatArray:
        """(n, FEATURES): of every axle's newest span in which it had data, and of the longer means."""
        return features(split(self._rows[0]), [split(self._mean(k)) for k in SPANS], speed_m_s, ratio)

    def _mean(self, spans: int) -> FloatArray:
        """(ROWS, n): over so many spans, or those that there are."""
        out: FloatArray = np.add.reduce(self._rows[:spans]) / np.maximum(np.minimum(self._held, spans), 1.0)
        return out

    def figures(self, axle: int) -> HealthFigures:
        """What an axle's state was found by."""
        mean = split(self._mean(SPANS[-1])[:, axle : axle + 1])
        r = mean.cross / np.sqrt((mean.power[:, YAW] + FLOOR) * (mean.power[:, LAT] + FLOOR))
        yaw, lat = np.sqrt(np.maximum(mean.variance[:, 0], 0.0)).tolist()
        p = self.probabilities()[axle]
        lead = int(p[1:].argmax()) + 1
        return HealthFigures(lead, float(p[lead]), float(p[PairState.SOUND]), float(r[0, 0]), float(r[1, 0]), yaw, lat)


def updated(model: HealthModel, log_odds: FloatArray, x: FloatArray) -> FloatArray:
    """Log odds (n, STATES) a span later, with its features (n, FEATURES)."""
    prior = model.log_prior
    p = _softmax(prior + model.kept * (log_odds - prior))
    p = (1.0 - model.hazard) * p + model.hazard * _softmax(prior)
    odds = np.log(p / p[:, :1]) + model.temper * evidence(model, x)
    return np.minimum(np.maximum(odds, -CERTAIN), CERTAIN)


def evidence(model: HealthModel, x: FloatArray) -> FloatArray:
    """(n, STATES): log of how much likelier features (n, FEATURES) are in each state than of a sound pair."""
    z = np.minimum(np.maximum((x - model.middle) / model.scale, -MOST), MOST)
    out = np.tanh(z @ model.hidden + model.hidden_bias) @ model.out + model.out_bias
    return np.asarray(out - out[:, :1])


def _softmax(log_odds: FloatArray) -> FloatArray:
    e = np.exp(log_odds - log_odds.max(axis=-1, keepdims=True))
    return np.asarray(e / e.sum(axis=-1, keepdims=True))
