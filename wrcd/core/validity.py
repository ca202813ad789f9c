"""Whether an axle is Valid, and if not, why: decided here and nowhere else.

A tick is sound if nothing speaks against what it brought. An estimate is as old as its window: it is Valid only after
a full window of sound ticks, from a pair of sensors that nothing speaks against, and if it does not doubt itself. An
interval that is wide is no doubt: Confidence says it.
A short silence of an input is not unsound: it brings nothing, and the bank predicts over it. While it lasts the axle
is Degraded; the window goes on after it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from wrcd.core.causes import Cause, Validity
from wrcd.core.inputs import Inputs, TickInputs
from wrcd.core.records import Estimate
from wrcd.core.terms import MAX_AXLES, EstimateDoubt, PairState

OF_PAIR = {
    PairState.BOTH_DEAD: Cause.SENSORS_SILENT,
    PairState.REVERSED: Cause.GYRO_REVERSED,
    PairState.OTHER_AXLE: Cause.SENSORS_UNRELATED,
    PairState.LATE: Cause.SENSORS_UNRELATED,
    PairState.ACCEL_DEAD: Cause.ACCEL_SMALL,
    PairState.WRONG_UNIT: Cause.ACCEL_SMALL,
    PairState.GYRO_DEAD: Cause.GYRO_DEAD,
}
OF_ESTIMATE = {
    EstimateDoubt.NO_RULE: Cause.NO_RULE,
    EstimateDoubt.BEYOND_TRAINING: Cause.BEYOND_TRAINING,
    EstimateDoubt.HARSH: Cause.HARSH,
    EstimateDoubt.SHORT: Cause.TOO_LITTLE_DATA,
    EstimateDoubt.GAPS: Cause.TOO_LITTLE_DATA,
}
# Of the design's. With the true load on the bus, the interval of nominal conditions still holds the truth in 77 %
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

    _window: int
    _stale_ticks: list[int]  # in a row, with a stale input
    _fresh_ticks: list[int]  # without a stale input since the last silence that was too long to be bridged
    _sound_ticks: list[int]  # in a row, but for bridged ones
    _window_full: list[bool]  # whether a full window of fresh ticks has been seen since it began
    _newest: list[Cause]  # what spoke against the newest tick
    _unsound: list[Cause]  # against the newest that something spoke against
    _begun: list[Cause]  # why it began, or has not

    def __init__(self, window_ticks: int, axles: int) -> None:
        self._window = window_ticks
        self._stale_ticks = [0] * axles
        self._fresh_ticks = [0] * axles
        self._sound_ticks = [0] * axles
        self._window_full = [False] * axles
        self._newest = [Cause.NONE] * axles
        self._unsound = [Cause.NONE] * axles
        self._begun = [Cause.WARMING_UP] * axles

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

    def update(self, axle: int, cause: Cause) -> None:
        """A tick with all that an estimate needs, and what speaks against it."""
        if not cause:
            self._stale_ticks[axle] = 0
            self._fresh_ticks[axle] += 1
            self._sound_ticks[axle] += 1
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

    def went_on(self, ticks: int) -> None:
        """Ticks of all axles that nothing speaks against, after one of these."""
        for axle in range(len(self._fresh_ticks)):
            self._fresh_ticks[axle] += ticks
            self._sound_ticks[axle] += ticks
            self._window_full[axle] |= self._fresh_ticks[axle] >= self._window

    def fresh_ticks(self, axle: int) -> int:
        """Ticks of the window that is not full yet."""
        return self._fresh_ticks[axle]

    def standing(self, axle: int, pair: int) -> Standing:
        """Of an axle now, with the PairState of its pair of sensors: all that there is to say without its estimate."""
        if not self._window_full[axle]:
            return Standing(False, self._newest[axle] or self._begun[axle])
        if self._newest[axle]:
            return Standing(True, self._newest[axle])
        if self._sound_ticks[axle] < self._window:
            return Standing(True, self._unsound[axle])
        return Standing(True, OF_PAIR[PairState(pair)] if pair else Cause.NONE)


def verdict(standing: Standing, axle: int, estimate: Estimate | None) -> tuple[Validity, Cause]:
    """Valid or not, and why not: decided here."""
    if not standing.has_estimate or estimate is None:
        return Validity.NOT_AVAILABLE, standing.cause
    cause = standing.cause or _of_estimate(axle, estimate)
    return (Validity.DEGRADED if cause else Validity.VALID), cause


def _of_estimate(axle: int, estimate: Estimate) -> Cause:
    """What an estimate says against itself."""
    if doubt := int(estimate.doubt[axle]):
        return OF_ESTIMATE[EstimateDoubt(doubt)]
    if not math.isfinite(estimate.mu_available_pct[axle]):
        return Cause.TOO_LITTLE_DATA
    return Cause.CONTRADICTION if estimate.contradicted[axle] else Cause.NONE


# So many resets in a row are for nothing: a signal that steps resets the axle twice, when the step comes and when it
# goes, and a second signal beside it may do so again.
FREE_RESETS = 4
FIRST_WAIT_S, LAST_WAIT_S = 1.0, 8.0  # twice as long each time


class Backoff:
    """Counts each axle's resets that no full window of good ticks came between."""

    _in_a_row: list[int]
    _until: list[int]  # number of the tick with which the axle is tried again
    waits: int = 0  # of all axles so far

    def __init__(self, axles: int, tick_s: float) -> None:
        self._tick_s = tick_s
        self._in_a_row = [0] * axles
        self._until = [0] * axles

    def was_reset(self, axle: int, tick: int) -> None:
        """An axle was reset in a tick."""
        self._in_a_row[axle] = min(self._in_a_row[axle] + 1, FREE_RESETS + 10)
        doublings = self._in_a_row[axle] - FREE_RESETS - 1
        if doublings >= 0:
            self.waits += 1
            self._until[axle] = tick + 1 + round(min(FIRST_WAIT_S * 2**doublings, LAST_WAIT_S) / self._tick_s)

    def recovered(self, axle: int) -> None:
        """A full window of good ticks has come."""
        self._in_a_row[axle] = 0

    def waiting(self, axle: int, tick: int) -> bool:
        """Whether the axle is left alone in a tick."""
        return tick < self._until[axle]

    def wait_s(self, axle: int, tick: int) -> float:
        """For how long the axle is left alone from a tick on."""
        return max(self._until[axle] - tick - 1, 0) * self._tick_s

    def reset(self) -> None:
        """A step of time, or a silence: a tick's number tells nothing of what came before."""
        self._in_a_row = [0] * len(self._in_a_row)
        self._until = [0] * len(self._until)
