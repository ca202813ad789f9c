"""Calm stretches of a log: some seconds of steady running on straight track, and their cross-spectra by blocks.

The fit is linear and stationary. What is neither is left out, with the reason: a curve, a change of speed, a pulse of a
joint or of a flange that meets the rail, inputs that are not there. The trailing wheelset's signals are taken a
wheelbase later, so that both have met the same track.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]
CHANNELS = 4  # yaw rate and lateral acceleration of the leading wheelset, then of the trailing one
_YAW, _LATERAL = [0, 2], [1, 3]
STRETCH_S, BAND_HZ = 5.12, (1.0, 16.0)
# Below it the fit is off: the share of the power that no track explains doubles, the primary yaw stiffness halves.
MIN_SPEED_M_S = 8.5
CREEPING_M_S = 0.1  # of a train that stands, so that its way goes on
STEADY, ALIKE = 0.06, 0.03  # shares by which the speed differs at most, within a stretch and within a block
MAX_STRETCHES = 14  # of a block
STRAIGHT_1_M = 1e-4  # mean curvature at most; twice as much for either wheelset alone, in each quarter of a stretch
PULSE_HZ, PULSE_SIGMA = 18.0, 6.0  # above it flanges and joints show; a gate at 30 Hz lets flanges pass
_TAPS = 101  # of the high-pass at PULSE_HZ
MAX_HOLE, MAX_FILLED = 3, 0.02  # ticks without an input that are filled in, and the share of a stretch
OVERLAP = 0.5
INDEPENDENT = 0.5  # of Hann windows that overlap by half
MAD = 0.6745  # median absolute deviation of a normal distribution


class LeftOut(StrEnum):
    """Why a stretch is not used."""

    GAP = "gap in the log, or no input is believed"
    INPUTS = "an input is missing or not believed"
    SLOW = f"slower than {MIN_SPEED_M_S:g} m/s, or backwards"
    UNSTEADY = "the speed is not steady"
    CURVE = "curve, or as uneven as one"
    PULSE = "pulse: a joint, or a flange at the rail"
    ALONE = "no other stretch of its speed beside it"
    MISFIT = "far stronger than the others say"


@dataclass(frozen=True, slots=True)
class BogieSignals:
    """What both wheelsets of a bogie measure, at T consecutive ticks.

    z (T, CHANNELS): rad/s, m/s2, NaN where there is none. speed_m_s (T,): NaN where it is not known. ticked (T,): False
    in a gap of the log.
    """

    tick_s: float
    z: FloatArray
    speed_m_s: FloatArray
    ticked: BoolArray


@dataclass(frozen=True, slots=True)
class CalmStretch:
    """One of them. spectrum (F, CHANNELS): of the windowed signals."""

    begin_s: float
    speed_m_s: float
    spectrum: ComplexArray


@dataclass(frozen=True, slots=True)
class Blocks:
    """B blocks of stretches of alike speed in a row, at F frequencies.

    cross (B, F, CHANNELS, CHANNELS): mean cross-spectra, scaled so that white noise has its variance. speed_m_s (B,):
    mean; the trailing wheelset's signals are taken a wheelbase later by it. stretches (B,): how many.
    """

    cross: ComplexArray
    speed_m_s: FloatArray
    stretches: FloatArray
    frequency_hz: FloatArray
    tick_s: float = 0.005

    def __len__(self) -> int:
        return len(self.speed_m_s)

    @property
    def independent(self) -> FloatArray:
        """(B,): of how many independent values each mean is."""
        return INDEPENDENT * self.stretches

    def some(self, which: BoolArray) -> "Blocks":
        """Return those that are True in (B,)."""
        return replace(self, cross=self.cross[which], speed_m_s=self.speed_m_s[which], stretches=self.stretches[which])

    def every(self, bins: int) -> "Blocks":
        """Return them with every so many-th frequency: neighbours share what the window smears."""
        return replace(self, cross=self.cross[:, ::bins], frequency_hz=self.frequency_hz[::bins])


def blocks_of(runs: Sequence[BogieSignals], wheelbase_m: float) -> tuple[Blocks, Counter[LeftOut]]:
    """Return the blocks of several runs of one vehicle, and how many stretches were left out for what."""
    left_out, blocks = Counter[LeftOut](), list[list[CalmStretch]]()
    for run in runs:
        calm = []
        for found in _judged(run, wheelbase_m):
            if isinstance(found, LeftOut):
                left_out[found] += 1
            else:
                calm.append(found)
        of_run = [block for block in _by_speed(calm) if len(block) > 1]
        left_out[LeftOut.ALONE] += len(calm) - sum(map(len, of_run))
        blocks += of_run
    return _averaged(blocks, runs[0].tick_s if runs else 0.005), left_out


def _ticks(tick_s: float) -> int:
    return round(STRETCH_S / tick_s)


def _frequencies(tick_s: float) -> tuple[FloatArray, BoolArray]:
    """Those of a stretch's spectrum, and which lie in the band."""
    f = np.asarray(np.fft.rfftfreq(_ticks(tick_s), tick_s), np.float64)
    return f, (f >= BAND_HZ[0]) & (f <= BAND_HZ[1])


def _judged(run: BogieSignals, wheelbase_m: float) -> Iterator[CalmStretch | LeftOut]:
    """Every stretch of a run, overlapping by half, or why it is none."""
    n = _ticks(run.tick_s)
    if len(run.z) < n:
        return
    z, filled = _without_holes(run.z)
    met = _meeting_one_track(z, run, wheelbase_m)
    if np.isnan(met).all(axis=0).any():
        yield from [LeftOut.INPUTS] * (len(run.z) // n)
        return
    high = np.abs(_highpassed(met[:, _LATERAL], run.tick_s))
    zero = np.nanmedian(run.z[:, _YAW], axis=0)
    _, used = _frequencies(run.tick_s)
    for first in range(0, len(z) - n + 1, round(n * (1 - OVERLAP))):
        own = slice(first, first + n)
        reason = _unlike(run, own)
        if reason is None:
            reason = _not_calm(met[own], high[own], filled[own], zero, float(run.speed_m_s[own].mean()))
        if reason is not None:
            yield reason
        else:
            spectrum = _windowed_spectrum(met[own])[used]
            yield CalmStretch(first * run.tick_s, float(run.speed_m_s[own].mean()), spectrum)


def _meeting_one_track(z: FloatArray, run: BogieSignals, wheelbase_m: float) -> FloatArray:
    """The signals (T, CHANNELS) with the trailing wheelset's taken where the train is a wheelbase further, read between
    ticks by cubics; NaN where that is behind the end."""
    known, at = ~np.isnan(run.speed_m_s), np.arange(len(z))
    speed = np.interp(at, at[known], run.speed_m_s[known]) if known.any() else np.ones(len(z))
    way = np.cumsum(np.maximum(speed, CREEPING_M_S)) * run.tick_s
    place = np.interp(way + wheelbase_m, way, at)
    before = np.clip(place.astype(np.int64), 1, len(z) - 3)
    x = (place - before)[:, None]
    a, b, c, d = (z[before + k, 2:] for k in (-1, 0, 1, 2))
    behind = (
        -x * (x - 1) * (x - 2) / 6 * a + (x + 1) * (x - 1) * (x - 2) / 2 * b - (x + 1) * x * (x - 2) / 2 * c
        + (x + 1) * x * (x - 1) / 6 * d
    )  # fmt: skip
    behind[way + wheelbase_m > way[-1]] = np.nan
    return np.concatenate((z[:, :2], behind), axis=1)


def _unlike(run: BogieSignals, own: slice) -> LeftOut | None:
    """Why a stretch is none by its ticks and its speed."""
    speed = run.speed_m_s[own]
    if not run.ticked[own].all():
        return LeftOut.GAP
    if np.isnan(speed).any():
        return LeftOut.INPUTS
    if speed.mean() < MIN_SPEED_M_S:
        return LeftOut.SLOW
    return LeftOut.UNSTEADY if np.ptp(speed) > STEADY * speed.mean() else None


def _not_calm(
    part: FloatArray, high: FloatArray, filled: BoolArray, zero: FloatArray, speed_m_s: float
) -> LeftOut | None:
    """Why it is none by its signals (n, CHANNELS). high (n, 2): magnitudes above PULSE_HZ. zero (2,): the gyros'."""
    if np.isnan(part).any() or filled.any(axis=1).mean() > MAX_FILLED:
        return LeftOut.INPUTS
    usual = np.median(high, axis=0) / MAD
    if (high.max(axis=0) > PULSE_SIGMA * usual).any():
        return LeftOut.PULSE
    quarters = np.array_split(part[:, _YAW] - zero, 4)
    turning = np.array([q.mean(axis=0) for q in quarters]) / speed_m_s
    curved = np.abs(turning.mean(axis=1)).max() > 2 * STRAIGHT_1_M or abs(turning.mean()) > STRAIGHT_1_M
    return LeftOut.CURVE if curved else None


def _without_holes(z: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The signals with holes of up to MAX_HOLE ticks filled by straight lines, and where."""
    out, filled = z.copy(), np.zeros(z.shape, bool)
    for c in range(z.shape[1]):
        missing = np.isnan(z[:, c])
        if missing.all():
            continue
        edges = np.flatnonzero(np.diff(missing.astype(np.int8), prepend=0, append=0))
        for first, end in edges.reshape(-1, 2).tolist():
            filled[first:end, c] = first > 0 and end < len(z) and end - first <= MAX_HOLE
        out[filled[:, c], c] = np.interp(np.flatnonzero(filled[:, c]), np.flatnonzero(~missing), z[~missing, c])
    return out, filled


def _highpassed(signals: FloatArray, tick_s: float) -> FloatArray:
    """What of signals (T, C) lies above PULSE_HZ. In what is missing goes a straight line."""
    t = (np.arange(_TAPS) - _TAPS // 2) * tick_s
    lowpass = np.sinc(2 * PULSE_HZ * t) * np.hanning(_TAPS + 2)[1:-1]
    lowpass /= lowpass.sum()
    out, at = np.zeros_like(signals), np.arange(len(signals))
    for c in range(signals.shape[1]):
        known = ~np.isnan(signals[:, c])
        whole = np.interp(at, at[known], signals[known, c])
        padded = np.pad(whole, _TAPS // 2, mode="edge")
        out[:, c] = whole - np.convolve(padded, lowpass, mode="valid")
    return out


def _windowed_spectrum(part: FloatArray) -> ComplexArray:
    """Spectrum of signals (n, C) without mean and slope, through a Hann window of unit energy."""
    n = len(part)
    t = np.linspace(-1.0, 1.0, n)
    straight = np.stack((np.full(n, n**-0.5), t / np.sqrt(t @ t)), axis=1)
    window = np.hanning(n + 1)[:-1]
    window /= np.sqrt(window @ window)
    return np.asarray(np.fft.rfft((part - straight @ (straight.T @ part)) * window[:, None], axis=0))


def _by_speed(calm: Sequence[CalmStretch]) -> Iterator[list[CalmStretch]]:
    """Stretches that follow one another at a speed like that of the first."""
    block: list[CalmStretch] = []
    for s in calm:
        goes_on = (
            block
            and len(block) < MAX_STRETCHES
            and abs(s.speed_m_s / block[0].speed_m_s - 1) < ALIKE
            and s.begin_s - block[-1].begin_s < STRETCH_S
        )
        if block and not goes_on:
            yield block
            block = []
        block.append(s)
    if block:
        yield block


def _averaged(blocks: Sequence[Sequence[CalmStretch]], tick_s: float) -> Blocks:
    f, used = _frequencies(tick_s)
    cross = np.zeros((len(blocks), int(used.sum()), CHANNELS, CHANNELS), np.complex128)
    for k, block in enumerate(blocks):
        x = np.array([s.spectrum for s in block])
        cross[k] = np.einsum("sfi,sfj->fij", x, x.conj()) / len(block)
    return Blocks(
        cross,
        np.array([np.mean([s.speed_m_s for s in block]) for block in blocks]),
        np.array([float(len(block)) for block in blocks]),
        f[used],
        tick_s,
    )
