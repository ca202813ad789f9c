"""One mapped signal in figures: how often it comes, what is refused of it, what it says and how finely."""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrcd.bus.dbc import cycle_ms, find_message
from wrcd.bus.reasons import Reason
from wrcd.core.configuration import Config, Input
from wrcd.tools.bus_check.gather import FloatArray, Gathered, IntArray

FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
STEADY = 0.5  # of the usual gap: neighbours further apart than that are none


@dataclass(frozen=True, slots=True)
class Figures:
    """Of one input. Times in ms, values in SI units; NaN where there is nothing to tell it from."""

    name: str  # Message.Signal
    quantity: str
    unit: str
    axles: tuple[int, ...]  # numbers
    frames: int  # of its message
    per_s: float
    cycle_ms: int | None  # as the DBC says
    usual_ms: float  # the mean gap in which nothing is missing
    jitter_ms: float  # 99 of 100 gaps lie within so much of the usual one
    longest_ms: float  # gap
    timeout_ms: float
    refused: Mapping[Reason, int]
    low: float
    high: float
    step: float  # of its raw value
    noise: float  # rms of what is no movement: of the fourth difference
    at_limit: float  # share of the values that stand at an end of its range

    @property
    def refused_share(self) -> float:
        """Of the frames of its message."""
        return sum(self.refused.values()) / self.frames if self.frames else 0.0


def figures(config: Config, gathered: Gathered, rejected: Mapping[tuple[str, Reason], int]) -> list[Figures]:
    """Of every input of a configuration; rejected: by message, as the core counts them."""
    refused: dict[str, Counter[Reason]] = {}
    for (name, reason), count in rejected.items():
        refused.setdefault(name, Counter())[reason] += count
    return [
        _figures(config, gathered, number, i, refused.get(i.source.message, Counter()))
        for number, i in enumerate(config.inputs)
    ]


def _figures(config: Config, gathered: Gathered, number: int, i: Input, refused: Counter[Reason]) -> Figures:
    s = i.source
    message = find_message(config.database, s.message)
    reader = next(r for r in gathered.receiver.readers.values() if r.name == s.message)
    signal = next(r for r in reader.signals if r.number == number)
    values, frames = gathered.inputs[number].si, gathered.frames[s.message]
    # of a multiplexed message only some frames carry the signal
    whole = len(values) == 0 or not reader.is_multiplexed
    stamps = np.array(gathered.times[s.message], dtype=np.int64) if whole else gathered.inputs[number].stamps_us
    usual, jitter, longest = _gaps(stamps)
    step = abs(float(signal.scale) * signal.factor)
    ends = sorted((signal.low * signal.factor, signal.high * signal.factor))
    n = len(values)
    stands = np.zeros(n, bool)
    if ends[0] < -step:  # 0 is no limit: a train that stands
        stands |= values <= ends[0] + step
    if ends[1] > step:
        stands |= values >= ends[1] - step
    return Figures(
        name=f"{s.message}.{s.signal}",
        quantity=s.quantity.key,
        unit=s.quantity.unit,
        axles=tuple(config.axles[place].number for place in s.axles),
        frames=frames,
        per_s=frames / gathered.seconds if gathered.seconds > 0 else 0.0,
        cycle_ms=cycle_ms(message),
        usual_ms=usual,
        jitter_ms=jitter,
        longest_ms=longest,
        timeout_ms=i.timeout_us / 1000,
        refused=dict(refused),
        low=float(values.min()) if n else math.nan,
        high=float(values.max()) if n else math.nan,
        step=step,
        noise=noise(gathered.inputs[number].stamps_us, values),
        at_limit=float(stands.mean()) if n else math.nan,
    )


def _gaps(stamps_us: IntArray) -> tuple[float, float, float]:
    """The usual gap, the 99th percentile of how far gaps are from it, and the longest, in ms."""
    if len(stamps_us) < 2:
        return math.nan, math.nan, math.nan
    gaps = np.diff(stamps_us) / 1000
    usual = float(np.mean(gaps[gaps <= 2 * np.median(gaps)]))  # of those in which nothing is missing
    return usual, float(np.percentile(np.abs(gaps - usual), 99)), float(gaps.max())


def noise(stamps_us: IntArray, values: FloatArray) -> float:
    """Rms of the white part of a series: the median square of its fourth difference over neighbours on end."""
    if len(values) < 100:
        return math.nan
    gaps = np.diff(stamps_us)
    steady = np.abs(gaps - np.median(gaps)) < STEADY * np.median(gaps)
    whole = np.convolve(steady, np.ones(4), "valid") == 4
    difference = np.convolve(values, FOURTH_DIFFERENCE, "valid")[whole] / np.linalg.norm(FOURTH_DIFFERENCE)
    return float(np.sqrt(np.mean(difference * difference))) if len(difference) else math.nan
