"""The measurements of every axle, how old it is, and whether a frame's samples can be believed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from wrcd.bus.codec import Sample
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.core.input_buffers import NEVER, JitterBuffer, Reach, Refusals
from wrcd.core.plausibility import MAX_STEP, MIN_RUN, STUCK_CHECKED, JumpCheck, StuckCheck

QUANTITIES = tuple(Quantity)
YAW, LAT, TORQUE, SPEED, BRAKE, LOAD, DIRECTION, RADIUS = range(len(QUANTITIES))
_ROW = {q: i for i, q in enumerate(QUANTITIES)}
_OF_TORQUE_RATIO = (TORQUE, BRAKE, LOAD, RADIUS)
_OF_AGE = (YAW, LAT, TORQUE, BRAKE, SPEED)  # the measurements: load, radius and direction may come once a second
# Torques against each other by more than this share of 2 N r_0 contradict each other. A motor's torque is estimated, a
# brake's follows from its pressure: either is wrong by up to that much where it should be nothing, and where less
# cancels, MuUsed is wrong by less than four percentage points.
AGAINST_SHARE = 0.02
# Of 2 N r_0: so far below zero a torque may be its signal's noise, or the swing of a controller that lets go of a
# slipping wheel. Where leaf film begins it is 0.002 for 30 ms; the noise's standard deviation is 0.0007. A torque that
# was larger than this up to TRACTION_HELD_US ago is still taken for traction: no friction brake bites sooner.
DEAD_SHARE, TRACTION_HELD_US = 0.005, 60_000
BACKWARDS_M_S = 0.5  # a speed further below zero is of a train in reverse


@dataclass(frozen=True, slots=True)
class TickInputs:
    """What a tick brought. Lists by axle; places are quantity * axles + axle."""

    speed_m_s: float  # NaN before it is known, negative backwards
    speed_jumped: bool
    z: list[float]  # by place: yaw rates, lateral accelerations, in the direction of travel
    present: list[bool] | None  # by place, which of them there are; None: all
    torque_ratio: list[float]  # |torque| / (2 N r0), NaN where what it is made of is unavailable
    stale: tuple[int, ...]  # places past their time-out, or never seen
    unavailable: tuple[int, ...]  # axles of which something has been silent for so long that there is no estimate


def rows_of(config: Config) -> tuple[list[int], list[int]]:
    """The quantity of each row, and the row of each input of a configuration. The first rows are the quantities; one
    that is the sum of several signals has a row more for each but the first."""
    later = dict.fromkeys((_ROW[i.source.quantity], i.source.part) for i in config.inputs if i.source.part)
    row_of = {part: row for row, part in enumerate(later, len(QUANTITIES))}
    rows = [row_of.get((_ROW[i.source.quantity], i.source.part), _ROW[i.source.quantity]) for i in config.inputs]
    return [*range(len(QUANTITIES)), *(q for q, _ in later)], rows


class Inputs:
    """Values by place. check(), then accept() or reject() while the tick is open, close_tick() when it is over.

    A place is row * axles + axle, with the rows of rows_of().
    """

    _value: list[float]  # in SI units
    _stamp_us: list[int]
    degraded: list[bool]  # by what its sender says of itself
    contested: list[bool]  # by another sender of the same message
    _jitter_buffer: JitterBuffer
    reach: Reach
    _stuck_checks: dict[int, StuckCheck]
    _jump_checks: dict[int, JumpCheck]
    _torque_ratio: list[float]
    _torque_ratio_known: bool
    refusals: Refusals
    _traction_us: list[int]  # when the torque was larger than that last, where its sign counts
    _speed_jumped: bool = False  # in the open tick
    _reverse: bool = False  # whether an axle runs backwards

    def __init__(self, config: Config, ends: Sequence[tuple[float, float]]) -> None:
        """ends: of each of the configuration's inputs, the values from which on it is clipped (Receiver.ends)."""
        n, design = len(config.axles), config.design
        self._ends = ends
        self._axles, self._design = n, design
        self._quantity, rows = rows_of(config)
        size = len(self._quantity) * n
        self._timeout_us = [0] * size
        mapped: set[int] = set()
        self._places: list[tuple[int, ...]] = []  # of each of the configuration's inputs
        self._quantities: list[int] = []  # likewise
        self._stuck_checks = {}
        self._jump_checks = {}
        for i, row, end in zip(config.inputs, rows, ends, strict=True):
            q = i.source.quantity
            places = tuple(row * n + axle for axle in i.source.axles)
            self._places.append(places)
            self._quantities.append(_ROW[q])
            mapped.update(places)
            for place in places:
                self._timeout_us[place] = i.timeout_us
            if q in STUCK_CHECKED:
                self._stuck_checks[places[0]] = StuckCheck(end)
            elif q in MAX_STEP:
                self._jump_checks[places[0]] = JumpCheck(MAX_STEP[q], i.timeout_us)
        self._mapped = sorted(mapped)
        self._parts = [
            (place, *(p for p in self._mapped if p >= len(QUANTITIES) * n and self._of_same(p, place)))
            for place in range(len(QUANTITIES) * n)
        ]
        self._deadlines = [(place, self._timeout_us[place]) for place in self._mapped]
        starts = {
            SPEED: math.nan if config.constant_speed_m_s is None else config.constant_speed_m_s,
            LOAD: 2 * design.normal_N, DIRECTION: 1.0, RADIUS: design.r_0,
        }  # fmt: skip
        self._value = [starts.get(place // n, 0.0) for place in range(size)]
        self._stamp_us = [NEVER] * size
        self.degraded = [False] * size
        self.contested = [False] * size
        self._jitter_buffer = JitterBuffer((LAT + 1) * n, design.recent_ticks)
        self.reach = Reach(self._timeout_us)
        self.refusals = Refusals(size)
        self._checks: list[StuckCheck | JumpCheck | None] = [
            self._stuck_checks.get(places[0]) or self._jump_checks.get(places[0]) for places in self._places
        ]
        self._speed_tells_direction = set(range(DIRECTION * n, (DIRECTION + 1) * n)).isdisjoint(mapped)
        self._speed_place = SPEED * n
        self._of_axle = [
            ([p for p in self._mapped if p % n == a and p < (LAT + 1) * n],
             [p for p in self._mapped if p % n == a and LAT < self._quantity[p // n] in _OF_AGE]) for a in range(n)
        ]  # fmt: skip
        self._unavailable_after_us: list[int] = []
        self._torque_ratio, self._torque_ratio_known = [0.0] * n, False  # False: to be worked out
        self._torque_is_one_signal = set(range(BRAKE * n, (BRAKE + 1) * n)).isdisjoint(mapped) and all(
            len(parts) == 1 for parts in self._parts
        )
        self._against_Nm = AGAINST_SHARE * 2 * design.normal_N * design.r_0
        self._dead_Nm = DEAD_SHARE * 2 * design.normal_N * design.r_0
        self._traction_us = [NEVER] * n
        self._shares_known = self._shares_ok = False
        self._speeds = float(design.speeds_m_s[0]), float(design.speeds_m_s[-1])
        self._set_limits(config)

    def _set_limits(self, config: Config) -> None:
        # slow inputs (load, radius, direction) may take their own time-out; the measurements may not
        after = config.not_available_after_us
        self._unavailable_after_us = [
            after if self._quantity[place // self._axles] <= SPEED else max(timeout, after)
            for place, timeout in enumerate(self._timeout_us)
        ]
        self._torque_is_total = config.torque_is_total
        brakes = set(range(BRAKE * self._axles, (BRAKE + 1) * self._axles))
        mapped = set(self._mapped)
        self._torque_sign_counts = (
            not (config.torque_is_total or brakes <= mapped)
            or bool(brakes & mapped)
            or any(len(self._parts[self.place(TORQUE, axle)]) > 1 for axle in range(self._axles))
        )
        self._min_speed_m_s = config.min_speed_m_s
        speeds = range(SPEED * self._axles, (SPEED + 1) * self._axles)
        if config.constant_speed_m_s is not None and not set(speeds) & mapped:
            for place in speeds:
                self._value[place] = config.constant_speed_m_s

    def check(self, samples: Sequence[Sample], stamp_us: int) -> Reason | None:
        """Return the first reason to reject the frame, or None. Check every sample: the checks keep state."""
        rejected = None
        for source, value, _, _ in samples:
            check = self._checks[source]
            if isinstance(check, StuckCheck):
                reason = check.check(value, stamp_us, abs(self._value[self._speed_place]) >= self._min_speed_m_s)
            elif check is not None:
                reason = check.check(value, stamp_us)
                if check.jumped and self._quantities[source] == SPEED:
                    self._speed_jumped = True
            else:
                continue
            if reason is not None and rejected is None:
                rejected = reason
        return rejected

    def reject(self, sources: Sequence[int], stamp_us: int, reason: Reason) -> None:
        """A frame of these was rejected. Where two senders contradict each other, not even what came before holds."""
        for source in sources:
            for place in self._places[source]:
                self.reach.reject(place, stamp_us, reason)
                self.refusals.reject(place, self._stamp_us[place], reason)
                if reason is Reason.TWO_SENDERS:
                    self.contested[place] = True

    def accept(self, s: Sample, stamp_us: int) -> bool:
        """A sample of an accepted frame. Return whether it is clipped: a measurement at an end of its range, which is
        there in time, and which no tick uses, for nobody knows how much larger the truth is."""
        source, value, degraded, contested = s
        quantity = self._quantities[source]
        low, high = self._ends[source]
        clipped = quantity <= LAT and not low < value < high
        for place in self._places[source]:
            self._stamp_us[place] = stamp_us
            self.reach.accept(place, stamp_us)
            self.degraded[place], self.contested[place] = degraded, contested
            if quantity <= LAT:
                self._jitter_buffer.put(place, math.nan if clipped else value, stamp_us)
            else:
                self._value[place] = value
        if quantity > LAT:
            self._torque_ratio_known = False
            if quantity != SPEED and (quantity != TORQUE or self._torque_sign_counts):
                self._shares_known = False
            if quantity == DIRECTION:
                n = self._axles
                self._reverse = min(self._value[DIRECTION * n : (DIRECTION + 1) * n]) < 0.0
            elif quantity == SPEED:
                if self._speed_tells_direction and abs(value) > BACKWARDS_M_S:
                    self._turn(value < 0.0)
            elif quantity == TORQUE and self._torque_sign_counts:
                for place in self._places[source]:
                    axle = place % self._axles
                    if self.total(TORQUE, axle) > self._dead_Nm:
                        self._traction_us[axle] = stamp_us
        return clipped

    def _turn(self, reverse: bool) -> None:
        """Note which way the train runs, where only its speed's sign says so."""
        if reverse != self._reverse:
            n = self._axles
            self._reverse = reverse
            self._value[DIRECTION * n : (DIRECTION + 1) * n] = [-1.0 if reverse else 1.0] * n

    def reset(self) -> None:
        """A step of time, or a long silence: nothing that came before counts."""
        self._speed_jumped = False
        self._traction_us = [NEVER] * self._axles
        self._stamp_us = [NEVER] * len(self._stamp_us)
        self._jitter_buffer.reset()
        self.reach.reset()
        self.refusals.reset()
        for stuck in self._stuck_checks.values():
            stuck.reset()
        for jump in self._jump_checks.values():
            jump.reset()

    def close_tick(self, end_us: int) -> TickInputs:
        """A tick is over: what there is at its end."""
        stamps, n = self._stamp_us, self._axles
        stale = tuple([p for p, timeout in self._deadlines if end_us - stamps[p] > timeout])
        z, present = self._jitter_buffer.take()
        if self._reverse:  # seen in the direction of travel left is right; counter-clockwise stays so
            z = [*z[:n], *(x * self._value[DIRECTION * n + axle] for axle, x in enumerate(z[n:]))]
        if not self._torque_ratio_known:
            v = self._value
            if self._torque_is_one_signal:
                self._torque_ratio = [abs(v[TORQUE * n + a]) / (v[LOAD * n + a] * v[RADIUS * n + a]) for a in range(n)]
            else:
                self._torque_ratio = [self._torque_Nm(a) / (self.total(LOAD, a) * v[RADIUS * n + a]) for a in range(n)]
            self._torque_ratio_known = True
        ratio = self._torque_ratio
        unavailable: tuple[int, ...] = ()
        if stale:
            silent = [p for p in stale if end_us - stamps[p] > self._unavailable_after_us[p]]
            unavailable = tuple(sorted({p % n for p in silent}))
            unknown = {p % n for p in silent if self._quantity[p // n] in _OF_TORQUE_RATIO}
            if unknown:
                ratio = [math.nan if a in unknown else r for a, r in enumerate(ratio)]
        jumped, self._speed_jumped = self._speed_jumped, False
        return TickInputs(self.speed_m_s, jumped, z, present, ratio, stale, unavailable)

    def unchanged(self, end_us: int) -> tuple[int, ...]:
        """Places of sensors that have sent the same for longer than their time-out while the train moved."""
        return tuple(
            [
                place
                for place, check in self._stuck_checks.items()
                if check.run >= MIN_RUN and check.unchanged(end_us, self._timeout_us[place])
            ]
        )

    @property
    def speed_m_s(self) -> float:
        """The vehicle's speed; NaN before it is known, negative backwards."""
        return self._value[self._speed_place]

    @speed_m_s.setter
    def speed_m_s(self, speed_m_s: float) -> None:
        self._value[self._speed_place] = speed_m_s

    def age_ms(self, axle: int, end_us: int) -> int:
        """Age of the oldest of gyro, acceleration, torque (the friction brakes' is part of it) and speed, up to 255."""
        used_us, stamps = self._jitter_buffer.used_us, self._stamp_us
        measured, others = self._of_axle[axle]
        oldest = min([used_us[p] for p in measured] + [stamps[p] for p in others])
        return min((end_us - oldest) // 1000, 255)

    def any_of(self, flags: Sequence[bool], axle: int) -> bool:
        """Whether any of an axle's places is flagged."""
        return any(flags[axle :: self._axles])

    def quantities(self, places: Sequence[int], axle: int) -> set[int]:
        """Which quantities of an axle are among some places."""
        n = self._axles
        return {self._quantity[p // n] for p in places if p % n == axle}

    def place(self, quantity: int, axle: int) -> int:
        """Where a quantity of an axle is kept: of several signals that add up, the first."""
        return quantity * self._axles + axle

    def _of_same(self, one: int, other: int) -> bool:
        """Whether two places are of the same quantity and axle."""
        n = self._axles
        return one % n == other % n and self._quantity[one // n] == self._quantity[other // n]

    def total(self, quantity: int, axle: int) -> float:
        """The sum of all signals that a quantity of an axle is made of."""
        first, *others = self._parts[quantity * self._axles + axle]
        total = self._value[first]
        for place in others:
            total += self._value[place]
        return total

    def reached(self, quantity: int, axle: int, end_us: int) -> tuple[int, str]:
        """How well a quantity is reached (Reach.read): of several signals that add up, the one that is least."""
        read = [self.reach.read(place, end_us) for place in self._parts[self.place(quantity, axle)]]
        return min(read, key=lambda one: (one[0].bit_count(), one[1] == "None"))

    def torques_contradict(self, axle: int) -> bool:
        """Whether torque and brake torque are against each other, or two parts of the torque. One of them has the wrong
        sign, and their sum would be what is left of either."""
        most = self._against_Nm
        torques = [self._value[place] for place in self._parts[self.place(TORQUE, axle)]]
        if len(torques) > 1 and min(torques) < -most and max(torques) > most:
            return True
        torque, brake = self.total(TORQUE, axle), self.total(BRAKE, axle)
        return min(torque, brake) < -most and max(torque, brake) > most

    def _torque_Nm(self, axle: int) -> float:
        """How large the torque at an axle is: where its parts contradict each other, as large as the larger side."""
        if self._torque_sign_counts and self.torques_contradict(axle):
            places = *self._parts[self.place(TORQUE, axle)], *self._parts[self.place(BRAKE, axle)]
            values = [self._value[place] for place in places]
            return max(sum(x for x in values if x > 0), -sum(x for x in values if x < 0))
        return abs(self.total(TORQUE, axle) + self.total(BRAKE, axle))

    @property
    def all_trusted(self) -> bool:
        """Whether no sender says Degraded of itself, nor seems to have a rival."""
        return not (True in self.degraded or True in self.contested)

    def doubtful_axles(self, doubtful: Callable[["Inputs", int], object]) -> bool:
        """Whether any axle's slow inputs have a value that something speaks against; looked at when one has come."""
        if not self._shares_known:
            self._shares_ok = not any(doubtful(self, axle) for axle in range(self._axles))
            self._shares_known = True
        return not self._shares_ok

    @property
    def speed_covered(self) -> bool:
        """Whether the design is for this speed."""
        low, high = self._speeds
        return low <= abs(self.speed_m_s) <= high

    def friction_share_unknown(self, axle: int) -> bool:
        """Whether the friction brakes may add what nobody tells of: always but in traction, torque 0 included. What
        is as good as 0 just after traction is still traction."""
        torque = self.total(TORQUE, axle)
        if self._torque_is_total or self.place(BRAKE, axle) in self._mapped or torque > 0:
            return False
        newest_us = max(self._stamp_us[place] for place in self._parts[self.place(TORQUE, axle)])
        return torque < -self._dead_Nm or newest_us - self._traction_us[axle] > TRACTION_HELD_US

    def load_share(self, axle: int) -> float:
        """The axle load over the design's; one where the bus does not tell it."""
        return self.total(LOAD, axle) / (2 * self._design.normal_N)

    def radius_share(self, axle: int) -> float:
        """The same of the wheel radius."""
        return self._value[self.place(RADIUS, axle)] / self._design.r_0

    # --- what details.py tells of

    def value(self, quantity: int, axle: int) -> float:
        """The newest value of a quantity, in SI units."""
        return self.total(quantity, axle)

    def torques(self, axle: int) -> dict[int, float]:
        """All torques of an axle that are mapped, in N m, by row."""
        places = (*self._parts[self.place(TORQUE, axle)], *self._parts[self.place(BRAKE, axle)])
        return {place // self._axles: self._value[place] for place in places if place in self._mapped}

    def stuck_at(self, quantity: int, axle: int) -> tuple[float, int]:
        """The value of a sensor that stands still, and how many frames have repeated it."""
        check = self._stuck_checks[self.place(quantity, axle)]
        return check.value, check.run

    def overdue(self, axle: int, end_us: int, silent: bool) -> list[tuple[int, int | None, int, str]]:
        """The rows of an axle that are past their time-out, or with silent past that for the estimate: each with
        its age (None: it has not come), the limit, and what was refused since."""
        limits, n, out = self._unavailable_after_us if silent else self._timeout_us, self._axles, []
        for place in self._mapped:
            stamp_us = self._stamp_us[place]
            if place % n == axle and end_us - stamp_us > limits[place]:
                age_us = None if stamp_us == NEVER else end_us - stamp_us
                out.append((place // n, age_us, limits[place], self.refusals.since(place, stamp_us)))
        return out

    def flagged(self, flags: Sequence[bool], axle: int) -> list[tuple[int, str]]:
        """The rows of an axle whose places are flagged, each with what was refused since its last good frame."""
        n = self._axles
        return [
            (place // n, self.refusals.since(place, self._stamp_us[place]))
            for place in self._mapped
            if place % n == axle and flags[place]
        ]
