"""Whether an axle is Valid, and if not, why: decided here and nowhere else.

A tick is sound if nothing speaks against what it brought. An estimate is as old as its window: it is Valid only after
a full window of sound ticks, from a pair of sensors that nothing speaks against, and if it does not doubt itself. An
interval that is wide keeps no axle from staying Valid, only from becoming so.
A short silence of an input is not unsound: it brings nothing, and the bank predicts over it. While it lasts the axle
is Degraded; the window goes on after it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import MAX_AXLES
from wrcd.core.inputs import Inputs, TickInputs
from wrcd.estimator.doubts import Doubt
from wrcd.estimator.records import Estimate, EstimateDoubt

OF_PAIR = {
    Doubt.SILENT: Cause.SENSORS_SILENT,
    Doubt.REVERSED: Cause.GYRO_REVERSED,
    Doubt.UNRELATED: Cause.SENSORS_UNRELATED,
    Doubt.ACCEL_SMALL: Cause.ACCEL_SMALL,
    Doubt.GYRO_DEAD: Cause.GYRO_DEAD,
}
DOUBT_OF = {cause: doubt for doubt, cause in OF_PAIR.items()}
OF_ESTIMATE = {
    EstimateDoubt.NO_RULE: Cause.NO_RULE,
    EstimateDoubt.BEYOND_TRAINING: Cause.BEYOND_TRAINING,
    EstimateDoubt.HARSH: Cause.HARSH,
    EstimateDoubt.SILENT: Cause.SENSORS_SILENT,
    EstimateDoubt.VAGUE: Cause.TOO_LITTLE_DATA,
    EstimateDoubt.GAPS: Cause.TOO_LITTLE_DATA,
    EstimateDoubt.WIDE: Cause.TOO_LITTLE_DATA,
}
# Of the design's. With the true load told by the bus, the interval of nominal conditions still holds the truth in 77 %
# of the frames at 0.7 and 1.3 (89 % at 1.0, 67 % at 0.6): beyond, a design for that load is needed.
LOAD_SHARES = (0.7, 1.3)
# A wheel wears by less than a tenth of its radius; as far, the interval still holds the truth in 85 % and more.
RADIUS_SHARES = (0.9, 1.1)
# So many ticks past a time-out are bridged. With 40 ms of both sensors missing in every 0.5 s the grid's mean error
# grows by 6 %, with 60 ms by 10 %; the interval still holds the truth in 95 % (a stalled bus or computer does that).
BRIDGED_TICKS = 8
SOUND = (Cause.NONE,) * MAX_AXLES


class Standing(NamedTuple):
    """What the ticks and the sensors of an axle say of its Validity, whatever its estimate is."""

    has_estimate: bool  # a full window has been seen
    cause: Cause  # of not being Valid


def tick_causes(i: Inputs, tick: TickInputs, end_us: int) -> Sequence[Cause]:
    """What speaks against the tick that was closed, of each axle: the first of all that does."""
    axles = range(len(tick.torque_ratio))
    unchanged = i.unchanged(end_us)
    if not (tick.stale or unchanged) and i.speed_covered and i.all_trusted and not i.doubtful_axles(_doubtful):
        return SOUND[: len(axles)]
    return tuple([_cause(i, tick, unchanged, axle) for axle in axles])


def _cause(i: Inputs, tick: TickInputs, unchanged: Sequence[int], axle: int) -> Cause:
    if i.quantities(tick.stale, axle):
        return Cause.INPUT_STALE
    if i.any_of(i.contested, axle):
        return Cause.TWO_SENDERS
    if i.any_of(i.degraded, axle):
        return Cause.SENSOR_DEGRADED
    if i.quantities(unchanged, axle):
        return Cause.UNCHANGED
    if not i.speed_covered:
        return Cause.SPEED_OUT_OF_RANGE
    return _doubtful(i, axle)


def _doubtful(i: Inputs, axle: int) -> Cause:
    """What speaks against the slow inputs' values."""
    if i.torques_contradict(axle):
        return Cause.TORQUES_CONTRADICT
    if i.friction_share_unknown(axle):
        return Cause.FRICTION_SHARE_UNKNOWN
    if not LOAD_SHARES[0] <= i.load_share(axle) <= LOAD_SHARES[1]:
        return Cause.LOAD_BEYOND
    if not RADIUS_SHARES[0] <= i.radius_share(axle) <= RADIUS_SHARES[1]:
        return Cause.RADIUS_BEYOND
    return Cause.NONE


class ValidityMonitor:
    """Counts the sound ticks of every axle, and says what follows."""

    STATE = {
        "window": "_window", "stale_ticks": "_stale_ticks", "fresh_ticks": "_fresh_ticks",
        "sound_ticks": "_sound_ticks", "window_full": "_window_full", "newest": "_newest", "unsound": "_unsound",
        "begun": "_begun",
    }  # fmt: skip

    def __init__(self, window_ticks: int, axles: int) -> None:
        self._window = window_ticks
        self._stale_ticks = [0] * axles  # in a row, with a stale input
        self._fresh_ticks = [0] * axles  # without a stale input since the last silence that was too long to be bridged
        self._sound_ticks = [0] * axles  # in a row, but for bridged ones
        self._window_full = [False] * axles  # whether a full window of fresh ticks has been seen since it began
        self._newest = [Cause.NONE] * axles  # what spoke against the newest tick
        self._unsound = [Cause.NONE] * axles  # against the newest that something spoke against
        self._begun = [Cause.WARMING_UP] * axles  # why it began, or has not

    @property
    def window_full(self) -> list[bool]:
        """Which axles have an estimate."""
        return self._window_full

    def reset(self, axle: int, why: Cause) -> None:
        """What was known before does not hold any more, or nothing is known."""
        self._stale_ticks[axle] = 0
        self._fresh_ticks[axle] = self._sound_ticks[axle] = 0
        self._window_full[axle] = False
        self._begun[axle] = why
        self._newest[axle] = self._unsound[axle] = Cause.NONE

    def update(self, axle: int, cause: Cause, ticks: int = 1) -> None:
        """Ticks with all that an estimate needs, and what speaks against them. More than one only where nothing
        does."""
        if not cause:
            self._stale_ticks[axle] = 0
            self._fresh_ticks[axle] += ticks
            self._sound_ticks[axle] += ticks
            if self._fresh_ticks[axle] >= self._window:
                self._window_full[axle] = True
            self._newest[axle] = cause
            if self._begun[axle] in (Cause.STANDSTILL, Cause.INPUT_SILENT):  # that is over
                self._begun[axle] = Cause.WARMING_UP
            return
        stale = self._stale_ticks[axle] = self._stale_ticks[axle] + 1 if cause is Cause.INPUT_STALE else 0
        bridged = 0 < stale <= BRIDGED_TICKS
        if not bridged:
            self._fresh_ticks[axle] = 0 if stale else self._fresh_ticks[axle] + 1
            self._sound_ticks[axle] = 0
            self._unsound[axle] = cause
        elif self._begun[axle] in (Cause.STANDSTILL, Cause.INPUT_SILENT):
            self._begun[axle] = Cause.WARMING_UP
        if self._fresh_ticks[axle] >= self._window:
            self._window_full[axle] = True
        self._newest[axle] = cause

    def fresh_ticks(self, axle: int) -> int:
        """Ticks of the window that is not full yet."""
        return self._fresh_ticks[axle]

    def standing(self, axle: int, pair: int) -> Standing:
        """Of an axle now, with the Doubt of its pair of sensors: all that there is to say without its estimate."""
        if not self._window_full[axle]:
            return Standing(False, self._newest[axle] or self._begun[axle])
        if self._newest[axle]:
            return Standing(True, self._newest[axle])
        if self._sound_ticks[axle] < self._window:
            return Standing(True, self._unsound[axle])
        return Standing(True, OF_PAIR[Doubt(pair)] if pair else Cause.NONE)


def verdict(standing: Standing, axle: int, estimate: Estimate | None, before: Validity) -> tuple[Validity, Cause]:
    """Valid or not, and why not: decided here. before: at the slot before."""
    if not standing.has_estimate or estimate is None:
        return Validity.NOT_AVAILABLE, standing.cause
    cause = standing.cause or _of_estimate(axle, estimate, before)
    return (Validity.DEGRADED if cause else Validity.VALID), cause


def _of_estimate(axle: int, estimate: Estimate, before: Validity) -> Cause:
    """What an estimate says against itself."""
    doubt = int(estimate.doubt[axle])
    if doubt and not (doubt == EstimateDoubt.WIDE and before is Validity.VALID):
        return OF_ESTIMATE[EstimateDoubt(doubt)]
    if not math.isfinite(estimate.mu_available_pct[axle]):
        return Cause.TOO_LITTLE_DATA
    return Cause.CONTRADICTION if estimate.contradicted[axle] else Cause.NONE
