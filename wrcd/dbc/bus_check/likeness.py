"""Whether the wheelsets of a train are like the one that the design is for: as far as their signals tell.

The track drives gyro and accelerometer together, so their ratio is free of it. On a straight, linear, with
p = 2 g22 / m and q = 2 Lg^2 g11 / I of the rail, it is

    a / w = (p + b M (s^2 + q s / v + k)) / (s + p / v) - b (s^2 + q s / v + k) / s,    b = g r_0 / q

What it tells of the wheelset is k = k_w / I_w and M = M_v / m_w; the rest is the rail. Each axle's p and q are fitted
over windows of some seconds for every pair (k, M) of a grid; what all axles say is added up, for a train has wheelsets
of one kind. If no pair near the design's fits as well as one far away, they are unlike.

A wheelset with like k and M is not recognised: its torque, its conicity and its contact do not show here.
"""

import itertools
import math

import numpy as np

from wrcd.estimator.design import CHANNELS, Design, FloatArray, IntArray
from wrcd.estimator.paper.bank import BoolArray
from wrcd.estimator.trust.health import LAT, YAW

GRAVITY = 9.80665
PARAMETERS = ("m_w", "I_w", "r_0", "L_g", "k_w", "M_v")  # of the design's wheelset that are needed
SEGMENT_S, HOP_S = 2.0, 1.0  # of the signals, tapered, that spectra are taken of
SEGMENTS = 4  # of a window
# What these and the limits below were set on: 900 axles of the design's and of other worlds (masses and stiffnesses off
# by up to 10 %, load by 15 %, conicity and k_A by 30 %) and 1300 foreign ones, 11 s each, 8 to 52 m/s. Of 320 of the
# former as trains of four axles, 30 s each, none is called unlike.
BAND_HZ = (0.9, 22.0)
NOISE_HZ = (70.0, 95.0)  # where there is nothing but the sensors' noise and vibration
MIN_NOISE = 0.05  # of the design's noise power
INDEPENDENT = 0.55  # of segments that overlap by half
MODEL_ERROR = 0.02  # of the acceleration: what is not linear
P_RANGE = (150.0, 2e4)  # of the rail, m/s2
MIN_Q, MAX_Q = 20.0, 4e4  # 1/s2
STEPS_P = 80
STEP = 0.2  # between two values of k or M of the grid, as a logarithm
STEPS_K, STEPS_M = 8, 6  # on either side of the design's
# Like are those within these factors: bushings, load and wear change them by as much.
LIKE_K, LIKE_M = 1.25, 1.35
# A window counts if the wheelset runs straight (1/m), at a speed that changes by no more than a share, far from
# saturation (g11 over g22 as fitted), and if the best pair explains it (mean square over the expected one).
MAX_CURVATURE, MAX_SPEED_CHANGE, MIN_SLOPE, MAX_MISFIT = 1e-4, 0.06, 0.25, 1.5
MAX_OF_WINDOW = 10.0  # that one window may say against any pair: half of a log-likelihood
MEMORY_WINDOWS = 15.0  # of each axle
SLOWEST = 0.1  # m/s
UNLIKE = 10.0  # by which a pair far away must fit better than any near one
_SPECTRA = 4  # sums of powers and of the product of yaw rate and acceleration, its real and imaginary parts
_REST = ("yaw noise", "acceleration noise", "yaw mean", "first speed", "newest speed")
_PRODUCTS = tuple(itertools.combinations_with_replacement(range(4), 2))


class Likeness:
    """Takes spectra of both signals of all axles and judges one axle after another."""

    def __init__(self, design: Design, axles: int) -> None:
        w, tick_s = design.wheelset, design.tick_s
        self._axles = axles
        self._rho = GRAVITY * float(w["r_0"])
        self._alike = float(w["L_g"]) ** 2 * float(w["m_w"]) / float(w["I_w"])  # q / p where g11 is g22
        self._segment, self._hop = round(SEGMENT_S / tick_s), round(HOP_S / tick_s)
        self._turn = max(1, self._hop // (axles + 1))  # ticks after a segment's end, and between two axles' judgements
        self._noise_rms = np.array(design.noise_rms)
        self._transform, frequencies = _transform(self._segment, tick_s)
        self._s = 2j * math.pi * frequencies
        self._p: FloatArray = np.geomspace(*P_RANGE, STEPS_P)
        k, m = (np.exp(STEP * np.arange(-steps, steps + 1)) for steps in (STEPS_K, STEPS_M))
        near = [np.abs(np.log(a)) <= math.log(b) for a, b in ((k, LIKE_K), (m, LIKE_M))]
        self._near: BoolArray = (near[0][:, None] & near[1]).reshape(-1)
        self._features = _features(k * float(w["k_w"]) / float(w["I_w"]), m * float(w["M_v"]) / float(w["m_w"]))
        # the newest samples in units of the design's noise: a segment, of which a hop is still to come
        self._samples: FloatArray = np.zeros((self._segment, CHANNELS, axles))
        self._filled = self._segment - self._hop
        self._run: FloatArray = np.zeros(axles)  # ticks without a gap
        self._speeds: FloatArray = np.zeros(2)  # means of the hop before, and of the one that is not full yet
        # sums over the segments of each axle's window
        self._window: FloatArray = np.zeros((_SPECTRA * len(frequencies) + len(_REST), axles))
        self._segments: IntArray = np.zeros(axles, dtype=np.int64)  # in it
        self._evidence: FloatArray = np.zeros(len(self._near))  # against each pair (k, M)
        self._margin = 0.0  # by which the best pair is better than any near the design's

    def reset(self, axle: int) -> None:
        """A gap: what an axle's window has gathered does not go on; what was found out before stays."""
        self._run[axle] = 0.0
        self._segments[axle] = 0
        self._window[:, axle] = 0.0
        if not self._run.any():  # nobody has a sample that counts
            self._samples[:] = 0.0
            self._speeds[:] = 0.0
            self._filled = self._segment - self._hop

    @property
    def unlike(self) -> bool:
        """Whether no pair near the design's explains what the axles say."""
        return self._margin > UNLIKE

    @property
    def figures(self) -> tuple[float, float, float]:
        """The factors on the design's k and M of the pair that explains it best, and by how much it is better than any
        pair near the design's: half of that is a log-likelihood."""
        k, m = divmod(int(self._evidence.argmin()), 2 * STEPS_M + 1)
        return math.exp(STEP * (k - STEPS_K)), math.exp(STEP * (m - STEPS_M)), self._margin

    def add(self, x: FloatArray, used: BoolArray, speed_m_s: float, saturated: BoolArray) -> None:
        """A tick x (2, n) in units of the design's noise; which axles have data, and are saturated (n,)."""
        self._samples[self._filled] = x
        self._speeds[1] += speed_m_s / self._hop
        self._run = np.where(used, self._run + 1.0, 0.0)
        self._segments[~used] = 0
        self._filled += 1
        turn, rest = divmod(self._hop_ticks, self._turn)
        if self._filled == self._segment:
            self._close(saturated)
        elif rest == 0 and turn <= self._axles and self._segments[turn - 1] == SEGMENTS:
            self._judge(turn - 1)

    @property
    def _hop_ticks(self) -> int:
        """Ticks since a segment was full."""
        return self._filled - self._segment + self._hop

    def _close(self, saturated: BoolArray) -> None:
        """A segment is full: its spectra go into the windows of the axles that have all of it."""
        whole = (self._run >= self._segment) & ~saturated
        self._segments[~whole] = 0
        if whole.any():
            self._gather(whole, float(self._speeds.mean()))
        self._samples[: -self._hop] = self._samples[self._hop :]
        self._filled = self._segment - self._hop
        self._speeds = np.array((self._speeds[1], 0.0))

    def _gather(self, whole: BoolArray, speed: float) -> None:
        out = (self._transform @ self._samples.reshape(self._segment, -1)).reshape(-1, CHANNELS, self._axles)
        f = len(self._s)
        spectrum, noise, mean = out[:f] + 1j * out[f : 2 * f], out[2 * f : -1], out[-1]
        self._window[:, self._segments == 0] = 0.0
        first = np.where(self._segments == 0, speed, self._window[-2])
        w, a = spectrum[:, YAW] * (speed / np.maximum(first, SLOWEST)), spectrum[:, LAT]
        product = np.conj(w) * a
        sums = (np.abs(w) ** 2, np.abs(a) ** 2, product.real, product.imag, np.mean(noise * noise, axis=0), mean[:1])
        self._window[:-2] += np.where(whole, np.concatenate(sums), 0.0)
        self._window[-2], self._window[-1] = first, speed
        self._segments += whole

    def _judge(self, axle: int) -> None:
        """A window of an axle is full: what it says against each pair is added to the evidence."""
        self._segments[axle] = 0
        yaw_mean, first, newest = self._window[-3:, axle]
        yaw_rate = yaw_mean / SEGMENTS * self._noise_rms[YAW]
        if abs(newest - first) > MAX_SPEED_CHANGE * first or abs(yaw_rate) > MAX_CURVATURE * first:
            return
        against = self._against(self._window[:, axle], first)
        if against is not None:
            self._evidence = (1.0 - 1.0 / (MEMORY_WINDOWS * self._axles)) * self._evidence + against
            self._margin = float(self._evidence[self._near].min() - self._evidence.min())

    def _against(self, window: FloatArray, v: float) -> FloatArray | None:
        """By how much each pair (k, M) fits a window's sums worse than the best; None where it does not count."""
        (yaw, lat), f = self._noise_rms, len(self._s)
        S_ww, S_aa, real, imaginary = window[: _SPECTRA * f].reshape(_SPECTRA, f)
        S_ww, S_aa, S_wa = S_ww * yaw**2, S_aa * lat**2, (real + 1j * imaginary) * (yaw * lat)
        white = np.maximum(window[_SPECTRA * f : _SPECTRA * f + CHANNELS], MIN_NOISE * SEGMENTS)
        n_w, n_a = white[YAW] * yaw**2, white[LAT] * lat**2
        gain2 = (np.abs(S_wa) / np.maximum(S_ww, MIN_NOISE * n_w)) ** 2
        weight = INDEPENDENT / ((n_a + n_w * gain2 + MODEL_ERROR**2 * S_aa) / SEGMENTS)
        S_ww, S_aa = np.maximum(S_ww - n_w, 0.02 * n_w), S_aa - n_a
        s, p = self._s, self._p[:, None]
        pole, rho = s + p / v, self._rho
        # the acceleration is yaw rate times these, with 1, M; b M, b k M, b, b k
        B = np.empty((len(p), 6, len(s)), dtype=complex)
        B[:, 0] = p / pole - rho / v
        B[:, 1] = rho / v * s / pole
        B[:, 2] = rho * s * s / pole
        B[:, 3] = rho / pole
        B[:, 4] = -rho * s
        B[:, 5] = -rho / s
        flat = np.concatenate((B.real, B.imag), axis=2)
        twice = np.tile(weight * S_ww, 2)
        G = (flat * twice) @ flat.transpose(0, 2, 1)
        c = flat @ np.concatenate((weight * S_wa.real, weight * S_wa.imag))
        features = self._features
        fixed = np.stack((G[:, 0, 0] - 2.0 * c[:, 0], 2.0 * (G[:, 0, 1] - c[:, 1]), G[:, 1, 1]), axis=1) @ features[0]
        linear = np.concatenate((c[:, 2:] - G[:, 0, 2:], -G[:, 1, 2:]), axis=1) @ features[1]
        square = np.stack([G[:, 2 + i, 2 + j] * (1.0 if i == j else 2.0) for i, j in _PRODUCTS], axis=1) @ features[2]
        b = np.minimum(np.maximum(linear / square, 1.0 / MAX_Q), 1.0 / MIN_Q)
        misfit = fixed + b * (b * square - 2.0 * linear)
        least, at = _least(misfit)
        expected = INDEPENDENT * SEGMENTS * len(s)
        total = least + float((weight * S_aa).sum()) + expected
        best = int(total.argmin())
        slope = 1.0 / (b[at[best], best] * self._p[at[best]] * self._alike)
        worse = total[best] / expected
        if not worse <= MAX_MISFIT or slope < MIN_SLOPE:
            return None
        return np.asarray(np.minimum((total - total[best]) / max(worse, 1.0), MAX_OF_WINDOW))


def likeness(design: Design, axles: int) -> Likeness | None:
    """To a design's wheelset; None where the design says too little of it, or has ticks too long for NOISE_HZ.

    None in a bogie, too: what holds the wheelset there has modes of its own in the band.
    """
    known = all(_is_positive(design.wheelset.get(name)) for name in PARAMETERS) and not design.wheelset.get("bogie")
    return Likeness(design, axles) if known and 2.0 * NOISE_HZ[1] * design.tick_s <= 1.0 else None


def _is_positive(x: object) -> bool:
    return isinstance(x, float | int) and 0.0 < x < math.inf


def _transform(ticks: int, tick_s: float) -> tuple[FloatArray, FloatArray]:
    """From samples (ticks, …) to real and imaginary parts in BAND_HZ, all parts in NOISE_HZ, and the mean: a matrix,
    and the frequencies of the first. A Hann window and no straight line; white noise of power one leaves power one, the
    noise's parts one each."""
    t = np.arange(ticks) - 0.5 * (ticks - 1)
    window = np.hanning(ticks + 1)[:-1]
    line = np.stack((np.full(ticks, 1.0 / math.sqrt(ticks)), t / math.sqrt(float((t * t).sum()))))  # orthonormal
    f = np.arange(ticks // 2 + 1) / (ticks * tick_s)
    band = f[(f >= BAND_HZ[0]) & (f <= BAND_HZ[1])]
    noise = f[(f >= NOISE_HZ[0]) & (f <= NOISE_HZ[1])][::2]
    angle = -2.0 * math.pi * tick_s * np.arange(ticks)
    size = math.sqrt(float((window**2).sum()))
    rows = [window * turn(np.outer(band, angle)) for turn in (np.cos, np.sin)]
    rows += [math.sqrt(2.0) * window * turn(np.outer(noise, angle)) for turn in (np.cos, np.sin)]
    out = np.concatenate(rows)
    out = (out - (out @ line.T) @ line) / size
    return np.concatenate((out, np.full((1, ticks), 1.0 / ticks))), np.asarray(band)


def _features(k: FloatArray, M: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the sums of squares are linear in, for every pair of the grid: (3, pairs), (8, pairs), (10, pairs)."""
    kk, MM = (a.reshape(-1) for a in np.meshgrid(k, M, indexing="ij"))
    one = np.ones(len(kk))
    g = np.array((MM, kk * MM, one, kk))
    return np.array((one, MM, MM * MM)), np.concatenate((g, g * MM)), np.array([g[i] * g[j] for i, j in _PRODUCTS])


def _least(misfit: FloatArray) -> tuple[FloatArray, IntArray]:
    """The least over the first axis (p, pairs), by a parabola through the lowest three; and where it is."""
    at = np.clip(misfit.argmin(axis=0), 1, len(misfit) - 2)
    pairs = np.arange(misfit.shape[1])
    below, here, above = (misfit[at + k, pairs] for k in (-1, 0, 1))
    bend = np.maximum(below - 2.0 * here + above, 1e-9)
    low = here - (above - below) ** 2 / (8.0 * bend)
    inside = np.abs(above - below) < 2.0 * bend
    return np.where(inside, low, np.minimum(np.minimum(below, above), here)), at
