"""Sums of the innovations over blocks of ticks: any window is the newest so many blocks."""

import itertools
from dataclasses import dataclass

import numpy as np

from wrcd.estimator.bank import BoolArray
from wrcd.estimator.design import CHANNELS, MODELS, FloatArray, IntArray

BLOCK_TICKS = 4
LAG = 4  # ticks between the two innovations of an autocorrelation: a quarter of a period at the band's upper end
SMALLEST = 1e-12  # a power this far below what the model expects is as good as zero
_W = MODELS * CHANNELS

# Columns of a block: ticks N, of them live ones, sums of t and t^2; of the whitened innovations w, filtered: w, t w,
# w^2, w(k) w(k - LAG) for each of the eight, and yaw times lateral for each model. Then plain sums: of the torque ratio
# and its ticks; of the unfiltered innovations, which show a change sooner, over the ticks RAW_N that are calm: w, w^2.
N, LIVE, T, TT = range(4)
_AT = np.cumsum([4, _W, _W, _W, _W, MODELS, 3, _W, _W])
SUM_W, SUM_TW, SUM_WW, SUM_LAG, SUM_CROSS, _SCALARS, SUM_RAW, SUM_RAW2 = (
    slice(int(a), int(b)) for a, b in itertools.pairwise(_AT)
)
RATIO, RATIO_N, RAW_N = range(_SCALARS.start, _SCALARS.stop)
COLUMNS = int(_AT[-1])
PLAIN = RATIO  # columns from here on are plain sums


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of one window of every axle (n,), NaN where it holds too little data.

    power (n, 4, 2): mean square of the whitened innovations about a straight line, per model and channel.
    lag (n, 8), cross (n, 4): their correlations with themselves LAG ticks before, and of yaw rate with lateral
    acceleration. ratio (n,): mean torque ratio. ticks (n,): length. live_share (n,): of them with data far from pulses.
    """

    power: FloatArray
    lag: FloatArray
    cross: FloatArray
    ratio: FloatArray
    ticks: FloatArray
    live_share: FloatArray

    @property
    def residuals(self) -> FloatArray:
        """(n, 4): RMS of each model's normalised residual."""
        return np.asarray(np.sqrt(self.power.sum(axis=2) / CHANNELS))

    def take(self, rows: IntArray) -> "Statistics":
        """Of some of the windows."""
        return Statistics(
            self.power[rows], self.lag[rows], self.cross[rows], self.ratio[rows], self.ticks[rows],
            self.live_share[rows],
        )  # fmt: skip


def statistics(sums: FloatArray, min_ticks: float) -> Statistics:
    """Of sums (COLUMNS, n) over a window. NaN with less than min_ticks live ticks.

    A sensor's bias and what a filter still has to learn of it is a straight line in the innovations: it is taken out.
    Ticks that are not live count as zeros in the sums; the power is that of the live ones.
    """
    n, live = sums[N], sums[LIVE]
    w, tw, ww = sums[SUM_W], sums[SUM_TW], sums[SUM_WW]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean, mean_t = w / n, sums[T] / n
        slope_part = tw - mean_t * w  # sum of (t - its mean) w
        spread = np.maximum(sums[TT] - sums[T] * mean_t, 1e-9)
        line = mean * mean + slope_part * slope_part / (spread * n)
        power = np.maximum(ww / n - line, SMALLEST)
        lag = (sums[SUM_LAG] / n - line) / power
        pairs, slopes = mean.reshape(MODELS, CHANNELS, -1), slope_part.reshape(MODELS, CHANNELS, -1)
        together = pairs[:, 0] * pairs[:, 1] + slopes[:, 0] * slopes[:, 1] / (spread * n)
        each = power.reshape(MODELS, CHANNELS, -1)
        cross = (sums[SUM_CROSS] / n - together) / np.sqrt(each[:, 0] * each[:, 1])
        ratio = sums[RATIO] / sums[RATIO_N]
        power = np.where(live >= min_ticks, power * (n / live), np.nan)
    return Statistics(
        power=np.moveaxis(power.reshape(MODELS, CHANNELS, -1), -1, 0),
        lag=np.clip(lag, -1.0, 1.0).T,
        cross=np.clip(cross, -1.0, 1.0).T,
        ratio=ratio,
        ticks=n,
        live_share=live / np.maximum(n, 1.0),
    )


def raw_power(sums: FloatArray, min_ticks: float) -> FloatArray:
    """(n, 4): from plain sums the mean square of the unfiltered innovations about their mean; NaN with less than
    min_ticks calm ticks."""
    calm = sums[RAW_N - PLAIN]
    raw, square = sums[SUM_RAW.start - PLAIN : SUM_RAW.stop - PLAIN], sums[SUM_RAW2.start - PLAIN :]
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = raw / calm
        power = np.maximum(square / calm - mean * mean, SMALLEST)
    both = power.reshape(MODELS, CHANNELS, -1).mean(axis=1)
    return np.asarray(np.where(calm >= min_ticks, both, np.nan).T)


def mean_ratio(plain: FloatArray) -> FloatArray:
    """(n,): from plain sums the mean torque ratio; NaN without any."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(plain[0] / plain[RATIO_N - PLAIN])


class Window:
    """The last `blocks` blocks of every axle; the newest may be part of a block.

    A block's place is its number modulo the length, so the contents follow from the ticks' numbers. Where the rail has
    changed, what is older is dropped, and the window grows again; kept() still knows of it.
    """

    STATE = ("_sums", "_since", "_past", "_newest")

    def __init__(self, blocks: int, axles: int) -> None:
        self._blocks = blocks
        self._sums: FloatArray = np.zeros((blocks, COLUMNS, axles))
        self._since: IntArray = np.zeros(axles, dtype=np.int64)  # number of the first block after the newest change
        self._past: FloatArray = np.zeros((LAG, _W, axles))  # w of the last LAG ticks, newest first
        self._newest = -1  # number of the newest block
        self._cumulative: FloatArray | None = None

    TRANSIENT = ("_cumulative",)

    def put(
        self, tick: int, w: FloatArray, raw: FloatArray, running: BoolArray, live: BoolArray, calm: BoolArray,
        ratio: FloatArray,
    ) -> None:  # fmt: skip
        """One tick: whitened innovations (4, 2, n) filtered and unfiltered, which axles run (n,), which had data,
        which of those are far from any pulse, torque ratio (n,)."""
        block, t = divmod(tick, BLOCK_TICKS)
        if block != self._newest:
            for passed in range(max(self._newest + 1, block - self._blocks + 1), block + 1):
                self._sums[passed % self._blocks] = 0.0
            self._newest = block
        w = np.where(running, w, 0.0).reshape(_W, -1)
        known = running & np.isfinite(ratio)
        sums = self._sums[block % self._blocks]
        sums[N] += running
        sums[LIVE] += live & running
        sums[T] += t * running
        sums[TT] += t * t * running
        raw = np.where(calm & running, raw, 0.0).reshape(_W, -1)
        plain = np.concatenate((np.stack((np.where(known, ratio, 0.0), known, calm & running)), raw, raw * raw))
        sums[PLAIN:] += plain
        sums[SUM_W] += w
        sums[SUM_TW] += t * w
        sums[SUM_WW] += w * w
        sums[SUM_LAG] += w * self._past[-1]
        sums[SUM_CROSS] += w[::2] * w[1::2]
        self._past = np.concatenate((w[None], self._past[:-1]))
        self._cumulative = None

    def reset(self, axle: int) -> None:
        """Empty an axle's window."""
        self._sums[:, :, axle] = 0.0
        self._since[axle] = 0
        self._past[:, :, axle] = 0.0
        self._cumulative = None

    def truncate(self, blocks: int, axles: BoolArray) -> None:
        """Drop what is older than the newest blocks of some axles (n,)."""
        self._since = np.where(axles, np.maximum(self._since, self._newest - blocks + 1), self._since)
        self._cumulative = None

    def cumulative(self) -> FloatArray:
        """(blocks + 1, COLUMNS, n): sums over the newest 0, 1, 2 … blocks, t counted from the newest block's start."""
        if self._cumulative is None:
            age = np.arange(self._blocks)
            sums = self._sums[self._places(0, self._blocks)] * self._held(0, self._blocks)[:, None]
            shift = (-float(BLOCK_TICKS) * age)[:, None]
            sums[:, TT] += shift * (2.0 * sums[:, T] + shift * sums[:, N])
            sums[:, T] += shift * sums[:, N]
            sums[:, SUM_TW] += shift[:, :, None] * sums[:, SUM_W]
            self._cumulative = np.concatenate((np.zeros_like(sums[:1]), np.cumsum(sums, axis=0)))
        return self._cumulative

    def plain(self, first: int, end: int) -> FloatArray:
        """Plain sums (COLUMNS - PLAIN, n) over the blocks first … end - 1, counted back from the newest (0)."""
        out: FloatArray = (self._sums[self._places(first, end), PLAIN:] * self._held(first, end)[:, None]).sum(axis=0)
        return out

    def kept(self, first: int, end: int) -> FloatArray:
        """The same, what lies before a change included."""
        out: FloatArray = self._sums[self._places(first, end), PLAIN:].sum(axis=0)
        return out

    def _held(self, first: int, end: int) -> BoolArray:
        """(end - first, n): which blocks of each axle came after the newest change."""
        return np.asarray((self._newest - np.arange(first, end))[:, None] >= self._since)

    def _places(self, first: int, end: int) -> IntArray:
        return np.asarray((self._newest - np.arange(first, end)) % self._blocks)

    def torque_range(self, blocks: int) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest torque ratio (n,) of any of the newest blocks, those before a change included."""
        total, count = np.moveaxis(self._sums[self._places(0, blocks), RATIO : RATIO_N + 1], 1, 0)
        with np.errstate(invalid="ignore", divide="ignore"):
            mean = total / count
        return np.where(count > 0, mean, np.inf).min(axis=0), np.where(count > 0, mean, -np.inf).max(axis=0)

    def filled(self) -> IntArray:
        """(n,): how many of the newest blocks hold ticks without a gap."""
        there = (self._sums[self._places(0, self._blocks), N] > 0) & self._held(0, self._blocks)
        return np.asarray(np.where(there.all(axis=0), self._blocks, np.argmin(there, axis=0)))


def newest(cumulative: FloatArray, blocks: IntArray) -> FloatArray:
    """Sums (COLUMNS, m) over the newest blocks, of each axle its own number (m,); m may be several times the axles."""
    out: FloatArray = cumulative[blocks, :, np.arange(len(blocks)) % cumulative.shape[2]].T
    return out
