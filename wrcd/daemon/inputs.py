"""What the frames said of every axle, how old it is, and whether that is enough to go on."""

import math

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import Sample
from wrcd.bus.units import Quantity
from wrcd.daemon.arrivals import NEVER, Arrivals
from wrcd.daemon.config import Config

QUANTITIES = tuple(Quantity)
YAW, LAT, TORQUE, SPEED, BRAKE, LOAD, DIRECTION, RADIUS = range(len(QUANTITIES))
_ROW = {q: i for i, q in enumerate(QUANTITIES)}

BoolArray = NDArray[np.bool_]
FloatArray = NDArray[np.float64]


class Inputs:
    """One row per quantity, one column per axle. take() while the tick is open, close() when it is over.

    What close() leaves behind: stale (quantities, n) past its time-out or never seen; dead (n,) something has been
    silent for so long that there is no estimate; z (2, n) and present (2, n), the tick's measurements in the direction
    of travel; torque_ratio (n,), |torque| / (2 N r0), NaN where what it is made of is dead.
    """

    def __init__(self, config: Config) -> None:
        n, design = len(config.axles), config.design
        shape = (len(QUANTITIES), n)
        self._mapped = np.zeros(shape, dtype=bool)
        self._timeout = np.zeros(shape, dtype=np.int64)
        for i in config.inputs:
            at = _ROW[i.source.quantity], list(i.source.axles)
            self._mapped[at] = True
            self._timeout[at] = i.timeout_us
        # slow inputs (load, radius, direction) may take their own time-out; the measurements may not
        self._dead_after = np.maximum(self._timeout, config.not_available_after_us)
        self._dead_after[: SPEED + 1] = config.not_available_after_us
        self._value = np.zeros(shape)
        self._value[SPEED] = math.nan if config.constant_speed_m_s is None else config.constant_speed_m_s
        self._value[LOAD] = 2 * design.normal_N
        self._value[DIRECTION] = 1.0
        self._value[RADIUS] = design.r_0
        self._stamps = np.full(shape, NEVER, dtype=np.int64)
        self._degraded = np.zeros(shape, dtype=bool)
        self._arrivals = Arrivals(LAT + 1, n)
        self._speeds = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        self._torque_is_total = config.torque_is_total
        self.close(0)

    def take(self, s: Sample, stamp_us: int) -> None:
        """A sample of an accepted frame."""
        q = _ROW[s.quantity]
        for axle in s.axles:
            self._stamps[q, axle] = stamp_us
            self._degraded[q, axle] = s.degraded
            if q <= LAT:
                self._arrivals.put(q, axle, s.value, stamp_us)
            else:
                self._value[q, axle] = s.value

    def forget(self) -> None:
        """A step of time: how old anything is cannot be told any more."""
        self._stamps[:] = NEVER
        self._arrivals.clear()

    def close(self, end_us: int) -> None:
        """A tick is over: judge what there is at its end."""
        age = end_us - self._stamps
        dead: BoolArray = self._mapped & (age > self._dead_after)
        self.stale: BoolArray = np.logical_and(self._mapped, age > self._timeout)
        self.dead: BoolArray = np.any(dead, axis=0)
        z, self.present = self._arrivals.take()
        self.z: FloatArray = z * self._value[DIRECTION]
        ratio = np.abs(self._value[TORQUE] + self._value[BRAKE]) / (self._value[LOAD] * self._value[RADIUS])
        unknown = dead[[TORQUE, BRAKE, LOAD, RADIUS]].any(axis=0)
        self.torque_ratio: FloatArray = np.where(unknown, math.nan, ratio)

    @property
    def speed_m_s(self) -> float:
        """The vehicle's speed; NaN before it is known."""
        return float(self._value[SPEED, 0])

    def age_ms(self, axle: int, end_us: int) -> int:
        """Age of the oldest input in use, 255 if it is that old or older."""
        used_us = np.concatenate((self._arrivals.used_us[:, axle], self._stamps[LAT + 1 :, axle]))
        return min(int((end_us - used_us)[self._mapped[:, axle]].max()) // 1000, 255)

    def sound(self, axle: int) -> bool:
        """Whether nothing speaks against an estimate: no sender says Degraded, the design covers the speed, and the
        torque is the total one (while braking, the friction brakes' share must be known)."""
        low, high = self._speeds
        return (
            not self._degraded[self._mapped[:, axle], axle].any()
            and low <= self.speed_m_s <= high
            and bool(self._torque_is_total or self._mapped[BRAKE, axle] or self._value[TORQUE, axle] >= 0)
        )
