"""The oracle of what a bogie's signals are in three bands: products of any two of them, see bands.c."""

import itertools
import math

import numpy as np
from scipy.signal import butter

from wrcd.core.design import BoolArray, Design, FloatArray
from wrcd.core.terms import CHANNELS

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


FLOOR = 0.02  # of the noise's power
YAW, LAT = range(CHANNELS)
ACROSS = ((YAW, YAW), (LAT, LAT), (YAW, LAT), (LAT, YAW))  # own signal, partner's
# Of a tick, (SUMS, n): whether it is used; powers of the fourth differences; the signals, and their squares; powers of
# the bands; products of the two; the same, one of them a wheelbase ago; powers of the partner's; own and partner's, a
# wheelbase ago, and the other way round; own gyro with the partner's accelerometer now, and the other way round.
_AT = np.cumsum([0, 1, *[CHANNELS] * 3, *[BANDS * k for k in (CHANNELS, 1, 2, CHANNELS, 2 * len(ACROSS), 2)]])
USED, FINE, PLAIN, SQUARE, POWER, CROSS, APART, THEIRS, PARTNER, NOW = (
    slice(int(a), int(b)) for a, b in itertools.pairwise(_AT)
)
SUMS = int(_AT[-1])


class Bands:
    """Takes the raw measurements of all axles tick by tick. A signal's running mean is taken off.

    Axles 1 and 2, 3 and 4 … are a bogie's; the last of an odd number is alone in its own. Which one leads is not known.
    """

    _filters: Filters
    _past: FloatArray  # (…, BANDS, bogies, 4) the bands' newest ticks, a ring
    _at: int
    _mean: FloatArray
    _offset_ticks: FloatArray  # that the mean is of
    goes_on: BoolArray

    def __init__(self, design: Design, axles: int) -> None:
        self._wheelbase_ticks = design.wheelbase_m / design.tick_s  # at 1 m/s
        self._longest = round(self._wheelbase_ticks / SLOWEST_M_S)
        self._past = np.zeros((self._longest + 1, BANDS, (axles + 1) // 2, 2 * CHANNELS))
        self._at = 0
        self._unit: FloatArray = design.noise_rms[:, None]
        self._max_offset_ticks = OFFSET_S / design.tick_s
        self._filters = Filters(design.tick_s, axles)
        self._mean = np.zeros((CHANNELS, axles))
        self._offset_ticks = np.zeros(axles)
        self.goes_on = np.zeros(axles, dtype=bool)
        bogie, own = np.divmod(np.arange(axles), 2)
        place = 2 * np.arange(CHANNELS)[:, None]
        self._own, self._their = (bogie, place + own), (bogie, place + 1 - own)  # (2, n) each

    def reset(self, axle: int) -> None:
        """Start an axle anew, after a gap."""
        bogie, place = divmod(axle, 2)
        self._filters.reset(axle)
        self._mean[:, axle] = self._offset_ticks[axle] = 0.0
        self._past[:, :, bogie, place::2] = 0.0
        self.goes_on[axle] = False
        if not self._offset_ticks.any():  # the ring is empty: it begins anew
            self._at = 0

    def step(self, z: FloatArray, used: BoolArray, speed_m_s: float) -> FloatArray:
        """One tick z (2, n), of the axles (n,) whose measurements are used. Returns (SUMS, n)."""
        x = np.where(used, np.clip(z / self._unit, -MAX_NOISE_RATIO, MAX_NOISE_RATIO), 0.0)
        self._offset_ticks = np.minimum(self._offset_ticks + used, self._max_offset_ticks)
        self._mean = self._mean + np.where(used, (x - self._mean) / np.maximum(self._offset_ticks, 1.0), 0.0)
        x = (x - self._mean) * used
        y = self._filters.step(x, used) * used
        now, fine = _by_bogie(y[:BANDS]).reshape(BANDS, -1, 2 * CHANNELS), y[BANDS]
        self._past[self._at] = now
        later = min(round(self._wheelbase_ticks / max(abs(speed_m_s), SLOWEST_M_S)), self._longest)
        before = self._past[(self._at - later) % len(self._past)]
        self._at = (self._at + 1) % len(self._past)
        self.goes_on = used.copy()
        own, theirs = (now[:, of[0], of[1]] for of in (self._own, self._their))  # (BANDS, 2, n)
        own_before, theirs_before = (before[:, of[0], of[1]] for of in (self._own, self._their))
        apart = [own[:, c] * theirs_before[:, d] for c, d in ACROSS] + [
            theirs[:, d] * own_before[:, c] for c, d in ACROSS
        ]
        own_apart = own[:, YAW] * own_before[:, LAT], own_before[:, YAW] * own[:, LAT]
        swapped = own[:, YAW] * theirs[:, LAT], own[:, LAT] * theirs[:, YAW]
        of_pair = own * own, own[:, YAW] * own[:, LAT], own_apart
        parts = (used[None], fine * fine, x, x * x, *of_pair, theirs * theirs, apart, swapped)
        return np.concatenate([np.reshape(part, (-1, len(used))) for part in parts])


def _by_bogie(x: FloatArray) -> FloatArray:
    """(…, 2, n) as (…, bogies, 2, 2), by channel and axle; beside a last one that is alone zeros."""
    n = x.shape[-1]
    if n % 2:
        x = np.concatenate((x, np.zeros((*x.shape[:-1], 1))), axis=-1)
    return x.reshape(*x.shape[:-1], -1, 2).swapaxes(-3, -2)


def columns(sums: FloatArray, partner_counts: BoolArray) -> FloatArray:
    """(m, 11 BANDS): of sums (SUMS, m) over windows the log powers of own signals, their correlation, and correlations
    with the partner's; 0 where that does not count (m,)."""
    ticks = np.maximum(sums[USED], 1.0)
    own, theirs = (sums[at].reshape(BANDS, CHANNELS, -1) + FLOOR * ticks for at in (POWER, THEIRS))
    cross = sums[CROSS] / np.sqrt(own[:, YAW] * own[:, LAT])
    across = np.array([own[:, c] * theirs[:, d] for c, d in (*ACROSS, *ACROSS)])
    apart = np.where(partner_counts, sums[PARTNER] / np.sqrt(across.reshape(sums[PARTNER].shape)), 0.0)
    powers = np.log10(own / ticks).reshape(BANDS * CHANNELS, -1)
    return np.concatenate((powers, np.clip(np.concatenate((cross, apart)), -1.0, 1.0))).T
