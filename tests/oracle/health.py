"""The oracle of the judgement on sensors: one posterior over what may be wrong with a pair, see health.c."""

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter

from tests.support.stepped import HealthFigures
from wrcd.core.design import BoolArray, FloatArray, HealthModel, IntArray
from wrcd.core.terms import CHANNELS, COLUMNS, PairState

BANDS_HZ = ((0.0, 1.5), (3.0, 10.0), (10.0, 25.0))
BANDS = len(BANDS_HZ)
OFFSET_S = 2.0  # memory of the running mean that is taken off
FOURTH_DIFFERENCE = (1.0, -4.0, 6.0, -4.0, 1.0)
SLOWEST_M_S = 3.0  # slower, a wheelbase takes longer than is kept
MAX_NOISE_RATIO = 1e6  # times the noise: what is further off does not count for more


class Filters:
    """First-order Butterworth filters at BANDS_HZ (bilinear) and the fourth difference, one matrix product a tick.

    White noise of power one leaves power one in each output.
    """

    _state: FloatArray
    OUTPUTS = BANDS + 1

    def __init__(self, tick_s: float, axles: int) -> None:
        delays = len(FOURTH_DIFFERENCE) - 1
        first, second, delayed = (1 + np.arange(k) for k in (BANDS, BANDS, delays))
        second, delayed = second + BANDS, delayed + 2 * BANDS
        # rows: outputs, then what the states become; columns: the input, then the states
        M = np.zeros((self.OUTPUTS + 2 * BANDS + delays, 1 + 2 * BANDS + delays))
        to = self.OUTPUTS - 1  # from a state's column to its row
        for k, (b0, b1, b2, _, a1, a2) in enumerate(band_filters(tick_s)):
            # transposed direct form II: y = b0 x + s1; s1' = b1 x - a1 y + s2; s2' = b2 x - a2 y
            M[k, [0, first[k]]] = b0, 1.0
            M[to + first[k], [0, first[k], second[k]]] = b1 - a1 * b0, -a1, 1.0
            M[to + second[k], [0, first[k]]] = b2 - a2 * b0, -a2
            M[k] /= math.sqrt(b0)  # of white noise's power such a filter leaves b0
        difference = np.array(FOURTH_DIFFERENCE)
        M[BANDS, [0, *delayed]] = difference / np.linalg.norm(difference)
        M[to + delayed, [0, *delayed[:-1]]] = 1.0
        self._M = M
        self._state = np.zeros((M.shape[1] - 1, CHANNELS * axles))

    def reset(self, axle: int) -> None:
        """Forget an axle's past."""
        n = self._state.shape[1] // CHANNELS
        self._state[:, axle::n] = 0.0

    def step(self, x: FloatArray, used: BoolArray) -> FloatArray:
        """One tick x (2, n), of the axles (n,) that have data. Returns (OUTPUTS, 2, n)."""
        out = self._M @ np.concatenate((x.reshape(1, -1), self._state))
        self._state = np.where(np.tile(used, CHANNELS), out[self.OUTPUTS :], self._state)
        y: FloatArray = out[: self.OUTPUTS].reshape(self.OUTPUTS, *x.shape)
        return y


def band_filters(tick_s: float) -> FloatArray:
    """(BANDS, 6): b0 b1 b2 1 a1 a2 of each."""
    out = []
    for low_hz, high_hz in BANDS_HZ:
        kind, corners = ("low", high_hz) if low_hz == 0.0 else ("band", (low_hz, high_hz))
        b, a = butter(1, corners, kind, fs=1.0 / tick_s)
        out.append([*b, *[0.0] * (3 - len(b)), *a, *[0.0] * (3 - len(a))])
    return np.array(out)


@dataclass(frozen=True, slots=True)
class Span:
    """Means over a span, in units of the design's sensor noise through the same filter. ticks (n,) with data; goes_on
    (n,): whether the newest had.

    together (BANDS, bogies, 2, 2, 2, 2): products of any two signals of a bogie, each by channel and axle; apart: the
    same of a signal with what another one was when the train was a wheelbase further back. fine (2, n): power of the
    fourth differences, above 50 Hz, where there is little but the sensor's noise; variance (2, n) of all.
    """

    ticks: FloatArray
    goes_on: BoolArray
    together: FloatArray
    apart: FloatArray
    fine: FloatArray
    variance: FloatArray


class PairSums:
    """Takes the raw measurements of all axles tick by tick. A signal's running mean is taken off.

    Axles 1 and 2, 3 and 4 … are a bogie's; the last of an odd number is alone in its own. Which one leads is not known.
    """

    _filters: Filters
    _past: FloatArray  # (…, BANDS, bogies, 4) the bands' newest ticks, a ring
    _at: int
    _later: int  # ticks for a wheelbase, at the last span's end
    _mean: FloatArray
    _offset_ticks: FloatArray  # that the mean is of
    _products: FloatArray  # (2, BANDS, bogies, 4, 4): together, apart
    _plain: FloatArray  # (3, 2, n): fine, sum, square
    _ticks: FloatArray
    _goes_on: BoolArray

    def __init__(self, noise_rms: FloatArray, tick_s: float, axles: int, wheelbase_m: float) -> None:
        self._wheelbase_ticks = wheelbase_m / tick_s  # at 1 m/s
        self._longest = round(self._wheelbase_ticks / SLOWEST_M_S)
        self._past = np.zeros((self._longest + 1, BANDS, (axles + 1) // 2, 2 * CHANNELS))
        self._at, self._later = 0, self._longest
        self._unit: FloatArray = noise_rms[:, None]
        self._max_offset_ticks = OFFSET_S / tick_s
        self._filters = Filters(tick_s, axles)
        self._mean = np.zeros((CHANNELS, axles))
        self._offset_ticks = np.zeros(axles)
        self._goes_on = np.zeros(axles, dtype=bool)
        self._begin(axles)

    def _begin(self, axles: int) -> None:
        self._products = np.zeros((2, BANDS, (axles + 1) // 2, 2 * CHANNELS, 2 * CHANNELS))
        self._plain = np.zeros((3, CHANNELS, axles))
        self._ticks = np.zeros(axles)

    def reset(self, axle: int) -> None:
        """Start an axle anew, after a gap: its part of the span does not count."""
        bogie, place = divmod(axle, 2)
        self._filters.reset(axle)
        self._mean[:, axle] = self._offset_ticks[axle] = 0.0
        self._products[:, :, bogie, place::2] = 0.0
        self._products[:, :, bogie, :, place::2] = 0.0
        self._past[:, :, bogie, place::2] = 0.0
        self._plain[:, :, axle] = self._ticks[axle] = 0.0
        self._goes_on[axle] = False
        if not self._offset_ticks.any():  # the ring is empty: it begins anew
            self._at, self._later = 0, self._longest

    def step(self, z: FloatArray, used: BoolArray) -> None:
        """One tick z (2, n), of the axles (n,) whose measurements are used."""
        x = np.where(used, np.clip(z / self._unit, -MAX_NOISE_RATIO, MAX_NOISE_RATIO), 0.0)
        self._offset_ticks = np.minimum(self._offset_ticks + used, self._max_offset_ticks)
        self._mean = self._mean + np.where(used, (x - self._mean) / np.maximum(self._offset_ticks, 1.0), 0.0)
        x = (x - self._mean) * used
        y = self._filters.step(x, used) * used
        bands, fine = _by_bogie(y[:BANDS]).reshape(BANDS, -1, 2 * CHANNELS), y[BANDS]
        self._past[self._at] = bands
        both = np.array((bands, self._past[(self._at - self._later) % len(self._past)]))
        self._products = self._products + bands[..., :, None] * both[..., None, :]
        self._at = (self._at + 1) % len(self._past)
        self._plain = self._plain + np.array((fine * fine, x, x * x))
        self._ticks = self._ticks + used
        self._goes_on = used.copy()

    def take(self, speed_m_s: float) -> Span:
        """What came since the last time. Means of an axle without data are 0. speed_m_s: of what comes next."""
        ticks = np.maximum(self._ticks, 1.0)
        fine, mean, square = self._plain / ticks
        # of two axles what both have data for; that is hardly ever less than either has
        both = np.sqrt(_by_bogie(np.broadcast_to(ticks, (CHANNELS, len(ticks)))))
        both = np.maximum(both.reshape(-1, 2 * CHANNELS), 1.0)
        means = self._products / (both[:, :, None] * both[:, None, :])
        together, apart = means.reshape(*means.shape[:3], 2, 2, 2, 2)
        out = Span(self._ticks, self._goes_on, together, apart, fine, square - mean * mean)
        self._begin(len(ticks))
        self._later = min(round(self._wheelbase_ticks / max(abs(speed_m_s), SLOWEST_M_S)), self._longest)
        return out


def _by_bogie(x: FloatArray) -> FloatArray:
    """(…, 2, n) as (…, bogies, 2, 2), by channel and axle; beside a last one that is alone zeros."""
    n = x.shape[-1]
    if n % 2:
        x = np.concatenate((x, np.zeros((*x.shape[:-1], 1))), axis=-1)
    return x.reshape(*x.shape[:-1], -1, 2).swapaxes(-3, -2)


CERTAIN = 14.0  # log odds of a pair's state: no more than this is kept
SPAN_TICKS = 48
MIN_SHARE = 0.5  # of a span's ticks that an axle must have data in
SPANS = (5, 25)  # of the means beside the newest span, 1.2 and 6 s: what was loud before is gone then
FLOOR = 0.02  # of the noise's power
MOST = 5.0  # standard deviations of a feature
SOUND_ALONE = np.r_[0.0, np.full(len(PairState) - 1, -CERTAIN)]  # where nothing is judged
YAW, LAT = range(CHANNELS)
ACROSS = ((YAW, YAW), (LAT, LAT), (YAW, LAT), (LAT, YAW))  # own signal, partner's
MIN_RATIO, MIN_SPEED_M_S = 0.003, 1.0
OWN = BANDS * CHANNELS + BANDS + 2 * CHANNELS
FEATURES = OWN + len(SPANS) * (OWN + 8 * BANDS + COLUMNS) + 2 + COLUMNS


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
