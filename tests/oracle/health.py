"""The oracle of the judgement on sensors: one posterior over what may be wrong with a pair, see health.c."""

import math
from dataclasses import dataclass

import numpy as np

from tests.oracle import bands
from tests.oracle.bands import ACROSS, BANDS, FLOOR, LAT, YAW
from tests.support.stepped import HealthFigures
from wrcd.core.design import BoolArray, FloatArray, HealthModel, IntArray
from wrcd.core.terms import CHANNELS, PairState

CERTAIN = 14.0  # log odds of a pair's state: no more than this is kept
SPAN_TICKS, SPAN_BLOCKS = 48, 12
GIVEN = 27  # of what the rules are given: all but the bands, which are here already
MIN_SHARE = 0.5  # of a span's ticks that an axle must have data in
SPANS = (5, 25)  # of the means beside the newest span, 1.2 and 6 s: what was loud before is gone then
MOST = 5.0  # standard deviations of a feature
SOUND_ALONE = np.r_[0.0, np.full(len(PairState) - 1, -CERTAIN)]  # where nothing is judged
MIN_RATIO, MIN_SPEED_M_S = 0.003, 1.0
OWN = BANDS * CHANNELS + BANDS + 2 * CHANNELS
FEATURES = OWN + len(SPANS) * (OWN + 8 * BANDS + GIVEN) + 2 + GIVEN + len(SPANS) * 4 * BANDS


@dataclass(frozen=True, slots=True)
class PairMeans:
    """Means of one pair's signals over a span or longer (…, n): powers (BANDS, 2, n) of the bands, products (BANDS, n)
    of the two; of_partner (2, 4, BANDS, n): gyro with gyro, accelerometer with accelerometer, gyro with the partner's
    accelerometer, accelerometer with its gyro, the partner's a wheelbase ago, and the own ones; partner (BANDS, 2, n)
    its powers. All 0 where there is no partner. inputs (GIVEN, n): what the rules were given. apart (2, BANDS, n): gyro
    with accelerometer of a wheelbase ago, and the other way round; now (2, BANDS, n): gyro with the partner's
    accelerometer, accelerometer with its gyro."""

    power: FloatArray
    cross: FloatArray
    fine: FloatArray
    variance: FloatArray
    of_partner: FloatArray
    partner: FloatArray
    inputs: FloatArray
    apart: FloatArray
    now: FloatArray

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
    (BANDS, CHANNELS), (BANDS,), (CHANNELS,), (CHANNELS,), (2, 4, BANDS), (BANDS, CHANNELS), (GIVEN,),
    (2, BANDS), (2, BANDS),
)  # fmt: skip
ROWS = sum(math.prod(shape) for shape in SHAPES)


def rows_of(sums: FloatArray, their_ticks: FloatArray, inputs: FloatArray) -> PairMeans:
    """Of every pair with its partner's, from sums (bands.SUMS, n) over a span; their_ticks (n,): of the partner, 0 of
    one that does not count; inputs (n, COLUMNS)."""
    ticks = np.maximum(sums[bands.USED], 1.0)[0]
    counts, theirs = their_ticks > 0.0, np.maximum(their_ticks, 1.0)
    mean = sums[bands.PLAIN] / ticks
    return PairMeans(
        power=(sums[bands.POWER] / ticks).reshape(BANDS, CHANNELS, -1),
        cross=sums[bands.CROSS] / ticks,
        fine=sums[bands.FINE] / ticks,
        variance=sums[bands.SQUARE] / ticks - mean * mean,
        of_partner=np.where(counts, sums[bands.PARTNER] / np.sqrt(ticks * theirs), 0.0).reshape(2, 4, BANDS, -1),
        partner=np.where(counts, sums[bands.THEIRS] / theirs, 0.0).reshape(BANDS, CHANNELS, -1),
        inputs=np.where(np.isfinite(inputs), inputs, 0.0).T[:GIVEN],
        apart=(sums[bands.APART] / ticks).reshape(2, BANDS, -1),
        now=np.where(counts, sums[bands.NOW] / np.sqrt(ticks * theirs), 0.0).reshape(2, BANDS, -1),
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


def _of_wires(r: PairMeans) -> FloatArray:
    """(4 BANDS, n): correlations of own signals a wheelbase apart, and with the partner's of the same moment."""
    own, their = r.power + FLOOR, r.partner + FLOOR
    apart = r.apart / np.sqrt(own[:, YAW] * own[:, LAT])
    now = r.now / np.sqrt(np.stack((own[:, YAW] * their[:, LAT], own[:, LAT] * their[:, YAW])))
    return np.concatenate((apart, now)).reshape(4 * BANDS, -1)


def features(newest: PairMeans, means: list[PairMeans], speed_m_s: float, ratio: FloatArray) -> FloatArray:
    """(n, FEATURES): of the newest span and of the longer means."""
    n = len(ratio)
    parts = [_own(newest)]
    for mean in means:
        parts += [_own(mean), _with_partner(mean), mean.inputs]
    speed = np.full((1, n), math.log10(max(speed_m_s, MIN_SPEED_M_S)))
    torque = np.log10(np.maximum(np.where(np.isfinite(ratio), ratio, 0.0), MIN_RATIO))[None]
    return np.concatenate((*parts, speed, torque, newest.inputs, *map(_of_wires, means))).T


class PairHealth:
    """Sums up what each pair says, and keeps the log odds of each state over a sound pair.

    They stay as they are while an axle has no data: what is known of the wires holds across gaps and standstills.
    Where the design has no part for it every pair counts as sound.
    """

    _rows: FloatArray  # (SPANS[-1], ROWS, n) of the newest spans in which an axle had data, the newest first
    _held: FloatArray  # (n,): how many there are
    log_odds: FloatArray  # (n, STATES)

    def __init__(self, model: HealthModel | None, axles: int) -> None:
        self._model = model
        partner = np.arange(axles) ^ 1  # the other axle of a bogie
        self._alone = partner >= axles
        self._partner = np.where(self._alone, 0, partner)
        self._rows = np.zeros((SPANS[-1], ROWS, axles))
        self._held = np.zeros(axles)
        self.log_odds = np.tile(SOUND_ALONE if model is None else model.log_prior, (axles, 1))

    def probabilities(self) -> FloatArray:
        """(n, STATES)."""
        return _softmax(self.log_odds)

    @property
    def state(self) -> IntArray:
        """(n,): the PairState that leads where a pair is not more likely sound than not."""
        return np.where(self.probabilities()[:, PairState.SOUND] < 0.5, self._lead, PairState.SOUND)

    @property
    def _lead(self) -> IntArray:
        """(n,): the PairState that leads beside a sound pair."""
        return np.asarray(self.log_odds[:, 1:].argmax(axis=1) + 1)

    @property
    def partner_sound(self) -> BoolArray:
        """(n,): whether an axle has a partner that is not doubted."""
        return (self.probabilities()[:, PairState.SOUND] >= 0.5)[self._partner] & ~self._alone

    def look(
        self, sums: FloatArray, goes_on: BoolArray, speed_m_s: float, ratio: FloatArray, inputs: FloatArray
    ) -> None:
        """At a span's end, at a speed: sums (bands.SUMS, n) over it, whether the newest tick had data (n,), torque
        ratio of the moment (n,), and what the rules were given (n, COLUMNS)."""
        ticks = sums[bands.USED][0]
        known = (ticks >= MIN_SHARE * SPAN_TICKS) & goes_on
        if self._model is not None and known.any():
            # a partner counts that has data and is not doubted itself, or only to be another axle's
            swapped = self._lead == PairState.OTHER_AXLE
            counts = known[self._partner] & (self.partner_sound | (swapped[self._partner] & ~self._alone))
            newest = rows_of(sums, np.where(counts, ticks[self._partner], 0.0), inputs)
            self._rows = np.where(known, np.concatenate((newest.joined()[None], self._rows[:-1])), self._rows)
            self._held = np.minimum(self._held + known, SPANS[-1])
            odds = updated(self._model, self.log_odds, self.features(speed_m_s, ratio))
            self.log_odds = np.where(known[:, None] & np.isfinite(odds), odds, self.log_odds)

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
