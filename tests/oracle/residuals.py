"""Running sums of the innovations: those of any window are the difference of two rows.

A window is cut here (`Window.sums`), and what lies before a change is dropped here (`Window.truncate`).
"""

import itertools
from dataclasses import dataclass

import numpy as np

from tests.oracle import bands
from wrcd.core.design import BoolArray, Design, FloatArray, IntArray
from wrcd.core.terms import CHANNELS, MODELS

BLOCK_TICKS = 4
LAG = 4  # ticks between the two innovations of an autocorrelation: a quarter of a period at the band's upper end
SMALLEST = 1e-12  # a power this far below what the model expects is as good as zero
_W = MODELS * CHANNELS

# Columns of a block: ticks N, of them with data, of those live ones, sums of t and t^2; of the whitened innovations w,
# filtered: w, t w, w^2, w(k) w(k - LAG) for each of the eight, and yaw times lateral for each model. Then plain sums:
# of the torque ratio and its ticks; of the unfiltered innovations, which show a change sooner, over the ticks RAW_N
# that are calm: w, w^2. Then those of the signals in bands.
N, HEARD, LIVE, T, TT = range(5)
_AT = np.cumsum([5, _W, _W, _W, _W, MODELS, 3, _W, _W, bands.SUMS])
SUM_W, SUM_TW, SUM_WW, SUM_LAG, SUM_CROSS, _SCALARS, SUM_RAW, SUM_RAW2, IN_BANDS = (
    slice(int(a), int(b)) for a, b in itertools.pairwise(_AT)
)
RATIO, RATIO_N, RAW_N = range(_SCALARS.start, _SCALARS.stop)
COLUMNS = int(_AT[-1])
PLAIN = RATIO  # columns from here on are plain sums
_RAW, _RAW2, PLAIN_IN_BANDS = (slice(a.start - PLAIN, a.stop - PLAIN) for a in (SUM_RAW, SUM_RAW2, IN_BANDS))
NOW_S = 0.06  # the torque of so long is the torque of the moment
STEP_S = 0.16  # and of so long before, that before a step
LASTS_S = 0.4  # so long lasts what the rail carries; a wheel that speeds up takes more torque for less


def quiet() -> np.errstate:
    """Without numpy's warnings of NaN and of divisions by zero: what is unknown comes out as NaN."""
    return np.errstate(invalid="ignore", divide="ignore")


class Lengths:
    """How many blocks the parts of a window are."""

    def __init__(self, design: Design) -> None:
        def blocks(seconds: float) -> int:
            return max(1, round(seconds / design.tick_s / BLOCK_TICKS))

        self.usual = -(-design.window_ticks // BLOCK_TICKS)
        self.longest = -(-design.longest_ticks // BLOCK_TICKS)
        self.recent = max(2, round(design.recent_ticks / BLOCK_TICKS))
        self.now, self.step, self.lasts = blocks(NOW_S), blocks(STEP_S), blocks(LASTS_S)
        self.min_ticks = 0.5 * self.recent * BLOCK_TICKS


@dataclass(frozen=True, slots=True)
class Statistics:
    """Of one window of every axle (n,), NaN where it holds too little data.

    power (n, 4, 2): mean square of the whitened innovations about a straight line, per model and channel; mean_square
    (n, 4): of both channels.
    lag (n, 8), cross (n, 4): their correlations with themselves LAG ticks before, and of yaw rate with lateral
    acceleration. ratio (n,): mean torque ratio. ticks (n,): length. heard_share (n,): of them with data; live_share
    (n,): with data far from pulses.
    """

    power: FloatArray
    mean_square: FloatArray
    lag: FloatArray
    cross: FloatArray
    ratio: FloatArray
    ticks: FloatArray
    heard_share: FloatArray
    live_share: FloatArray

    @property
    def residuals(self) -> FloatArray:
        """(n, 4): RMS of each model's normalised residual."""
        return np.asarray(np.sqrt(self.mean_square))

    def take(self, rows: IntArray | slice) -> "Statistics":
        """Of some of the windows."""
        return Statistics(
            self.power[rows], self.mean_square[rows], self.lag[rows], self.cross[rows], self.ratio[rows],
            self.ticks[rows], self.heard_share[rows], self.live_share[rows],
        )  # fmt: skip


def statistics(sums: FloatArray, min_ticks: float) -> Statistics:
    """Of sums (COLUMNS, n) over a window. NaN with less than min_ticks live ticks.

    A sensor's bias and what a filter still has to learn of it is a straight line in the innovations: it is taken out.
    Ticks that are not live count as zeros in the sums; the power is that of the live ones.

    Here and below the caller silences numpy's warnings (`quiet`): what is unknown comes out as NaN.
    """
    n, live = sums[N], sums[LIVE]
    w, tw = sums[SUM_W], sums[SUM_TW]
    per_tick = 1.0 / n
    mean, mean_t = w * per_tick, sums[T] * per_tick
    slope = tw - mean_t * w  # sum of (t - its mean) w
    spread = np.maximum(sums[TT] - sums[T] * mean_t, 1e-9)
    per_spread = per_tick / spread
    line = mean * mean
    line += slope * slope * per_spread
    power = np.maximum(sums[SUM_WW] * per_tick - line, SMALLEST)
    lag = (sums[SUM_LAG] * per_tick - line) / power
    together = mean[::2] * mean[1::2]
    together += slope[::2] * slope[1::2] * per_spread
    cross = (sums[SUM_CROSS] * per_tick - together) / np.sqrt(power[::2] * power[1::2])
    ratio = sums[RATIO] / sums[RATIO_N]
    power *= n / live
    power[:, live < min_ticks] = np.nan
    return Statistics(
        power=power.T.reshape(-1, MODELS, CHANNELS),
        mean_square=(0.5 * (power[::2] + power[1::2])).T,
        lag=np.minimum(np.maximum(lag, -1.0), 1.0).T,
        cross=np.minimum(np.maximum(cross, -1.0), 1.0).T,
        ratio=ratio,
        ticks=n,
        heard_share=sums[HEARD] / np.maximum(n, 1.0),
        live_share=live / np.maximum(n, 1.0),
    )


def raw_power(sums: FloatArray, min_ticks: float) -> FloatArray:
    """(n, 4): from plain sums the mean square of the unfiltered innovations about their mean; NaN with less than
    min_ticks calm ticks."""
    calm = sums[RAW_N - PLAIN]
    per_tick = 1.0 / calm
    mean = sums[_RAW] * per_tick
    power = np.maximum(sums[_RAW2] * per_tick - mean * mean, SMALLEST)
    both = 0.5 * (power[::2] + power[1::2])
    both[:, calm < min_ticks] = np.nan
    out: FloatArray = both.T
    return out


def mean_ratio(plain: FloatArray) -> FloatArray:
    """(n,): from plain sums the mean torque ratio; NaN without any."""
    out: FloatArray = plain[0] / plain[RATIO_N - PLAIN]
    return out


class Window:
    """Running sums at the end of each of the last `blocks` blocks of every axle, and of as many before them.

    The sums count from the start of a generation, `blocks` blocks long, so that they neither grow nor drift; when one
    is over, its rows are taken back by its end: they count down to it from below. So the contents follow from the
    ticks' numbers and from what the last two generations brought. The newest block may be part of one.

    Where the rail has changed, what is older is dropped, and the window grows again; kept() still knows of it.
    """

    _rows: FloatArray
    _since: IntArray  # number of the first block after the newest change
    _first: IntArray  # and of the first since when there is no gap
    _last: IntArray  # newest block with ticks
    _past: FloatArray  # w of the last LAG ticks, oldest first
    _latest_change: int = 0  # of all axles
    _newest: int = -1  # number of the newest block

    def __init__(self, blocks: int, axles: int) -> None:
        self._blocks = blocks
        self._axle = np.arange(axles)
        self._rows = np.zeros((2 * blocks, COLUMNS, axles))
        self._since = np.zeros(axles, dtype=np.int64)
        self._first = np.zeros(axles, dtype=np.int64)
        self._last = np.full(axles, -2, dtype=np.int64)
        self._past = np.zeros((LAG, _W, axles))

    def put(
        self, tick: int, w: FloatArray, raw: FloatArray, running: BoolArray, heard: BoolArray, live: BoolArray,
        calm: BoolArray, ratio: FloatArray,
    ) -> None:  # fmt: skip
        """Add a tick by its number: whitened innovations (4, 2, n) filtered and unfiltered, which axles run (n,); which
        of them had data, which of those are not about a pulse, and which are far from any; torque ratios (n,)."""
        block, t = divmod(tick, BLOCK_TICKS)
        if block != self._newest:
            self._move_to(block)
        # an axle may begin within a block
        self._first = np.where(running & (self._last < block - 1), block, self._first)
        self._last = np.where(running, block, self._last)
        t += BLOCK_TICKS * (block % self._blocks)
        flat, plain = w.reshape(_W, -1), np.where(calm, raw.reshape(_W, -1), 0.0)
        known = np.isfinite(ratio)
        new = np.ones((COLUMNS, len(running)))
        new[HEARD], new[LIVE] = heard, live
        new[T], new[TT] = t, t * t
        new[SUM_W], new[SUM_TW], new[SUM_WW] = flat, t * flat, flat * flat
        new[SUM_LAG], new[SUM_CROSS] = flat * self._past[0], flat[::2] * flat[1::2]
        new[RATIO], new[RATIO_N], new[RAW_N] = np.where(known, ratio, 0.0), known, calm
        new[SUM_RAW], new[SUM_RAW2], new[IN_BANDS] = plain, plain * plain, 0.0
        self._rows[self._end] += np.where(running, new, 0.0)
        self._past = np.concatenate((self._past[1:], flat[None]))

    def add(self, in_bands: FloatArray) -> None:
        """Add what the newest tick is in bands (bands.SUMS, n)."""
        self._rows[self._end, IN_BANDS] += in_bands

    def forget_partner(self, axle: int) -> None:
        """Drop what an axle's partner was."""
        self._rows[:, IN_BANDS.start + bands.THEIRS.start :, axle] = 0.0

    def _move_to(self, block: int) -> None:
        """Begin a block: its row is what the one before it came to."""
        if block - self._newest > 2 * self._blocks:
            self._rows[:] = 0.0
            self._newest = block - 1
        for passed in range(self._newest + 1, block + 1):
            if passed % self._blocks == 0:
                self._next_generation()
            at = self._blocks + passed % self._blocks
            self._rows[at] = self._rows[at - 1]
        self._newest = block

    def _next_generation(self) -> None:
        """A generation is over: count from its end, in time as well."""
        half, span = self._blocks, float(self._blocks * BLOCK_TICKS)
        old = self._rows[half:] - self._rows[-1]
        old[:, TT] += span * (span * old[:, N] - 2.0 * old[:, T])
        old[:, T] -= span * old[:, N]
        old[:, SUM_TW] -= span * old[:, SUM_W]
        old[-1] = 0.0
        self._rows[:half] = old

    @property
    def _end(self) -> int:
        """The newest block's row."""
        return self._blocks + self._newest % self._blocks

    def reset(self, axle: int) -> None:
        """Empty an axle's window."""
        self._rows[:, :, axle] = 0.0
        self._since[axle] = self._first[axle] = 0
        self._last[axle] = -2
        self._past[:, :, axle] = 0.0
        self._latest_change = int(self._since.max())

    def truncate(self, blocks: int, axles: BoolArray) -> None:
        """Drop what is older than the newest blocks of some axles (n,)."""
        self._since = np.where(axles, np.maximum(self._since, self._newest - blocks + 1), self._since)
        self._latest_change = int(self._since.max())

    def sums(self, blocks: IntArray) -> FloatArray:
        """Sums (COLUMNS, k, n) over the newest blocks, of each axle its own numbers (k, n), as far as they came after
        the newest change."""
        if self._newest - int(blocks.max()) + 1 < self._latest_change:
            blocks = np.minimum(blocks, self._held)
        oldest = self._rows[self._end - blocks, :, self._axle]
        return np.ascontiguousarray((self._rows[self._end].T - oldest).transpose(2, 0, 1))

    @property
    def _held(self) -> IntArray:
        """(n,): how many of the newest blocks came after the newest change."""
        return np.asarray(np.maximum(self._newest - self._since + 1, 0))

    def plain(self, first: int, end: int) -> FloatArray:
        """Plain sums (COLUMNS - PLAIN, n) over the blocks first … end - 1, counted back from the newest (0), as far as
        they came after the newest change."""
        if self._newest - end + 1 >= self._latest_change:
            return self.kept(first, end)
        rows = self._end - np.minimum([[first], [end]], self._held)
        newer, older = self._rows[rows, PLAIN:, self._axle]
        out: FloatArray = (newer - older).T
        return out

    def kept(self, first: int, end: int) -> FloatArray:
        """The same, what lies before a change included."""
        out: FloatArray = self._rows[self._end - first, PLAIN:] - self._rows[self._end - end, PLAIN:]
        return out

    def torque_range(self, blocks: int) -> tuple[FloatArray, FloatArray]:
        """The lowest and the highest torque ratio (n,) of any of the newest blocks, those before a change included."""
        rows = self._rows[self._end - blocks : self._end + 1, RATIO : RATIO_N + 1]
        both = rows[1:] - rows[:-1]
        mean = both[:, 0] / both[:, 1]
        lowest, highest = np.fmin.reduce(mean), np.fmax.reduce(mean)
        if np.isnan(lowest).any():
            return np.where(np.isnan(lowest), np.inf, lowest), np.where(np.isnan(lowest), -np.inf, highest)
        return lowest, highest

    def filled(self) -> IntArray:
        """(n,): how many of the newest blocks hold ticks without a gap."""
        whole = self._newest - np.maximum(self._first, self._since) + 1
        return np.asarray(np.where(self._last == self._newest, np.clip(whole, 0, self._blocks), 0))
