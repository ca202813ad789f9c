"""What every gyro and accelerometer say, and how they go together: sums over spans of ticks, of the raw signals."""

import math
from dataclasses import dataclass

import numpy as np

from wrcd.estimator.design import CHANNELS, FloatArray
from wrcd.estimator.paper.bank import BoolArray

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
        low, high = (math.tan(math.pi * f * tick_s) for f in (low_hz, high_hz))
        if low_hz == 0.0:
            b = high / (1.0 + high)
            out.append((b, b, 0.0, 1.0, (high - 1.0) / (high + 1.0), 0.0))
        else:
            width, square = high - low, low * high
            whole = 1.0 + width + square
            b = width / whole
            out.append((b, 0.0, -b, 1.0, 2.0 * (square - 1.0) / whole, (1.0 - width + square) / whole))
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
