"""What the frames said of every axle, how old it is, and whether that is enough to go on."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import Sample, Source
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.core.jitter_buffer import NEVER, JitterBuffer
from wrcd.core.plausibility import MAX_STEP, STUCK_CHECKED, JumpCheck, StuckCheck
from wrcd.core.reach import Reach

QUANTITIES = tuple(Quantity)
YAW, LAT, TORQUE, SPEED, BRAKE, LOAD, DIRECTION, RADIUS = range(len(QUANTITIES))
_ROW = {q: i for i, q in enumerate(QUANTITIES)}

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]


class Inputs:
    """One row per quantity, one column per axle. take() while the tick is open, close() when it is over.

    What close() leaves behind: stale (quantities, n), past its time-out or never seen; unavailable (n,), something has
    been silent for so long that there is no estimate; z (2, n) and present (2, n), the tick's measurements in the
    direction of travel; torque_ratio (n,), |torque| / (2 N r0), NaN where what it is made of is unavailable.
    """

    STATE = (
        "_value", "_stamps", "degraded", "contested", "_jitter_buffer", "unchanged", "reach", "_stuck_checks",
        "_jump_checks", "stale", "unavailable", "z", "present", "torque_ratio", "speed_jumped",
    )  # fmt: skip

    def __init__(self, config: Config) -> None:
        n, design = len(config.axles), config.design
        self._design = design
        shape = (len(QUANTITIES), n)
        self._mapped = np.zeros(shape, dtype=bool)
        self._timeout = np.zeros(shape, dtype=np.int64)
        for i in config.inputs:
            at = _ROW[i.source.quantity], list(i.source.axles)
            self._mapped[at] = True
            self._timeout[at] = i.timeout_us
        self._value = np.zeros(shape)
        self._value[SPEED] = math.nan if config.constant_speed_m_s is None else config.constant_speed_m_s
        self._value[LOAD] = 2 * design.normal_N
        self._value[DIRECTION] = 1.0
        self._value[RADIUS] = design.r_0
        self._stamps = np.full(shape, NEVER, dtype=np.int64)
        self.degraded: BoolArray = np.zeros(shape, dtype=bool)  # by what its sender says of itself
        self.contested: BoolArray = np.zeros(shape, dtype=bool)  # by another sender of the same message
        self._jitter_buffer = JitterBuffer(LAT + 1, n, design.recent_ticks)
        self.speed_jumped = False  # since it was last set back
        self.unchanged = np.zeros((LAT + 1, n), dtype=bool)  # for longer than the time-out, while the train moves
        self._speeds = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        self.reach = Reach(self._timeout)
        self._stuck_checks = {
            _place(i.source): StuckCheck() for i in config.inputs if i.source.quantity in STUCK_CHECKED
        }
        self._jump_checks = {
            _place(i.source): JumpCheck(MAX_STEP[i.source.quantity], i.timeout_us)
            for i in config.inputs
            if i.source.quantity in MAX_STEP
        }
        self.apply_limits(config)
        self.close(0)

    def apply_limits(self, config: Config) -> None:
        """Other limits from the next tick on."""
        # slow inputs (load, radius, direction) may take their own time-out; the measurements may not
        self._unavailable_after = np.maximum(self._timeout, config.not_available_after_us)
        self._unavailable_after[: SPEED + 1] = config.not_available_after_us
        self._torque_is_total = config.torque_is_total
        self._min_speed_m_s = config.min_speed_m_s
        if config.constant_speed_m_s is not None and not self._mapped[SPEED].any():
            self._value[SPEED] = config.constant_speed_m_s

    def check(self, samples: Sequence[Sample], stamp_us: int) -> Reason | None:
        """Why a frame's samples cannot be believed, or None. Each is judged, whatever the others are."""
        verdicts = [self._check(s, stamp_us) for s in samples]
        return next((v for v in verdicts if v), None)

    def _check(self, s: Sample, stamp_us: int) -> Reason | None:
        place = _place(s)
        if (restless := self._stuck_checks.get(place)) is not None:
            return restless.check(s.value, stamp_us, self.speed_m_s >= self._min_speed_m_s)
        steady = self._jump_checks.get(place)
        return None if steady is None else steady.check(s.value, stamp_us)

    def reject(self, sources: Sequence[Source], stamp_us: int, reason: Reason) -> None:
        """A frame of these was refused. Where two senders contradict each other, not even what came before holds."""
        for s in sources:
            for axle in s.axles:
                self.reach.reject(_ROW[s.quantity], axle, stamp_us, reason)
                self.contested[_ROW[s.quantity], axle] |= reason is Reason.TWO_SENDERS

    def take(self, s: Sample, stamp_us: int) -> None:
        """A sample of an accepted frame."""
        q = _ROW[s.quantity]
        for axle in s.axles:
            self._stamps[q, axle] = stamp_us
            self.reach.accept(q, axle, stamp_us)
            self.degraded[q, axle], self.contested[q, axle] = s.degraded, s.contested
            if q <= LAT:
                self._jitter_buffer.put(q, axle, s.value, stamp_us)
            else:
                self._value[q, axle] = s.value
        if q == SPEED:
            self.speed_jumped |= self._jump_checks[_place(s)].jumped
            self._jump_checks[_place(s)].jumped = False

    def reset(self) -> None:
        """A step of time, or a long silence: nothing that came before counts."""
        self.speed_jumped = False
        self._stamps[:] = NEVER
        self._jitter_buffer.reset()
        self.reach.reset()
        for restless in self._stuck_checks.values():
            restless.reset()
        for steady in self._jump_checks.values():
            steady.reset()

    def close(self, end_us: int) -> None:
        """A tick is over: judge what there is at its end."""
        age = end_us - self._stamps
        unavailable: BoolArray = self._mapped & (age > self._unavailable_after)
        self.stale: BoolArray = np.logical_and(self._mapped, age > self._timeout)
        self.unavailable: BoolArray = np.any(unavailable, axis=0)
        z, self.present = self._jitter_buffer.take()
        self.z: FloatArray = z * self._value[DIRECTION]
        ratio = np.abs(self._value[TORQUE] + self._value[BRAKE]) / (self._value[LOAD] * self._value[RADIUS])
        for (q, axle), watch in self._stuck_checks.items():
            self.unchanged[q, axle] = watch.unchanged(end_us, int(self._timeout[q, axle]))
        unknown = unavailable[[TORQUE, BRAKE, LOAD, RADIUS]].any(axis=0)
        self.torque_ratio: FloatArray = np.where(unknown, math.nan, ratio)

    @property
    def speed_m_s(self) -> float:
        """The vehicle's speed; NaN before it is known."""
        return float(self._value[SPEED, 0])

    def age_ms(self, axle: int, end_us: int) -> int:
        """Age of the oldest input in use, 255 if it is that old or older."""
        used_us = np.concatenate((self._jitter_buffer.used_us[:, axle], self._stamps[LAT + 1 :, axle]))
        return min(int((end_us - used_us)[self._mapped[:, axle]].max()) // 1000, 255)

    @property
    def speed_covered(self) -> bool:
        """Whether the design is for this speed."""
        low, high = self._speeds
        return low <= self.speed_m_s <= high

    @property
    def friction_share_unknown(self) -> BoolArray:
        """(n,) Where the friction brakes may add what nobody tells of: always but in traction, torque 0 included."""
        out: BoolArray = ~(self._torque_is_total | self._mapped[BRAKE] | (self._value[TORQUE] > 0))
        return out

    @property
    def load_share(self) -> FloatArray:
        """(n,) The axle load over the design's; one where the bus does not tell it."""
        out: FloatArray = self._value[LOAD] / (2 * self._design.normal_N)
        return out

    @property
    def radius_share(self) -> FloatArray:
        """(n,) The same of the wheel radius."""
        out: FloatArray = self._value[RADIUS] / self._design.r_0
        return out


def _place(s: Sample | Source) -> tuple[int, int]:
    """Where a signal is kept: its quantity and the first of its axles."""
    return _ROW[s.quantity], s.axles[0]
