"""What the daemon said in a run, held against the truth: whether Confidence kept what it claims."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.judge import MIN_JUDGED_M_S
from sim_ecu.loop.rig import Step
from sim_ecu.play.encoder import databases
from sim_ecu.score.heard import Heard, Hears, heard_own
from sim_ecu.score.play import HALF_WIDTHS
from wrcd.core.configuration import Config

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
# The truth may lie outside the 90 % interval for some tenths of a second after a drop (docs/reference/score.md, drops:
# 0.46 s at most). An axle that is Valid and outside for longer at a stretch is wrong.
ALLOWED_S = 0.5
GAP_US = 60_000  # the frame's time-out: a longer silence ends a stretch


@dataclass(frozen=True, slots=True)
class Told:
    """The adhesion frames of one axle: (n,). half_width_pp is inf where no bound is claimed, NaN where not Valid."""

    stamps_us: NDArray[np.int64]
    mu_pct: FloatArray
    half_width_pp: FloatArray
    valid: BoolArray


@dataclass(frozen=True, slots=True)
class Honesty:
    """Of one axle while the train is fast enough to be judged.

    outside: share of the Valid frames with the truth outside the interval. outside_s, over_s: the longest stretch on
    end that it was so, and that the truth was below it.
    """

    axle: int
    valid: float
    outside: float
    outside_s: float
    over_s: float

    @property
    def wrong(self) -> bool:
        """For longer than the interval allows."""
        return self.outside_s > ALLOWED_S


class Ear:
    """Hears the adhesion frames of a run. Times are microseconds from its start. own: the configuration of a train
    whose messages are not the packaged ones."""

    def __init__(self, axles: Sequence[int], own: Config | None = None) -> None:
        production = databases()[0]
        self._of: dict[int, Hears] = {
            n: Heard(production.get_message_by_name(f"Adhesion_A{n}")) if own is None else heard_own(own, n)[0]
            for n in axles
        }
        self._by_id = {h.message.frame_id: h for h in self._of.values()}

    def hear(self, stamp_us: int, can_id: int, data: bytes) -> None:
        """A frame; others than adhesion are nobody's business here."""
        found = self._by_id.get(can_id)
        if found is not None:
            found.stamps_us.append(stamp_us)
            found.data.append(data)

    def told(self) -> dict[int, Told]:
        """What there was, by axle."""
        out = {}
        for axle, h in self._of.items():
            valid = h.words("Validity") == "Valid"
            levels = h.words("Confidence").tolist()
            half = np.array([HALF_WIDTHS.get(word, np.nan) for word in levels], np.float64)
            out[axle] = Told(np.array(h.stamps_us, np.int64), h.numbers("MuAvailable"), half, valid)
        return out


def honesty(told: Mapping[int, Told], steps: Sequence[Step]) -> list[Honesty]:
    """By axle. The truth of a frame is that of the newest step by then."""
    due_us = np.array([s.due_us for s in steps])
    speed = np.array([s.speed_m_s for s in steps])
    true_pct = 100 * np.array([s.mu_available for s in steps])
    out = []
    for place, (axle, t) in enumerate(told.items()):
        at = np.searchsorted(due_us, t.stamps_us, side="right") - 1
        judged = (at >= 0) & (speed[np.maximum(at, 0)] >= MIN_JUDGED_M_S)
        at, stamps = at[judged], t.stamps_us[judged]
        over = t.mu_pct[judged] - true_pct[at, place]
        valid, half = t.valid[judged], t.half_width_pp[judged]
        with np.errstate(invalid="ignore"):
            outside, too_high = valid & ~(np.abs(over) <= half), valid & (over > half)
        out.append(
            Honesty(
                axle=axle,
                valid=float(np.mean(valid)) if len(valid) else 0.0,
                outside=float(np.sum(outside) / np.sum(valid)) if valid.any() else 0.0,
                outside_s=longest_s(outside, stamps),
                over_s=longest_s(too_high, stamps),
            )
        )
    return out


def longest_s(hits: BoolArray, stamps_us: NDArray[np.int64]) -> float:
    """The longest stretch of frames on end, from its first stamp to its last, without a silence between."""
    longest = 0
    for hit, part in itertools.groupby(zip(hits.tolist(), stamps_us.tolist(), strict=True), lambda p: p[0]):
        if not hit:
            continue
        begin = end = None
        for _, stamp in part:
            if begin is None or end is None or stamp - end > GAP_US:
                begin = stamp
            end = stamp
            longest = max(longest, end - begin)
    return longest * 1e-6
