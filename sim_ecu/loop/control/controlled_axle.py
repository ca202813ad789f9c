"""What a controller keeps of one axle: its newest frames, its law, a model of its actuators, its time guard."""

from collections import deque
from dataclasses import dataclass
from enum import Enum

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, Facts
from sim_ecu.loop.control.adhesion_limit import AdhesionLimit
from sim_ecu.loop.rig_messages import NewestFrame, rig_message
from sim_ecu.physics.actuators import Valve
from sim_ecu.play.encoder import Channel


@dataclass(frozen=True, slots=True)
class Release:
    """When an axle is released for the reference's sake, and how far."""

    after_s: float = 2.0  # without any axle that proved the reference
    share: float = 0.6  # of its torque: what it keeps,
    # The same where an adhesion limit alone holds the torque: the wheel creeps little, and rolls with more left. Found
    # on training seeds: with 0.8 a wheel that a false high lets slide comes back too late (errors up to 1.0 m/s).
    limited_share: float = 0.7
    min_s: float = 0.1  # of a release
    max_s: float = 0.4
    back_m_s2: float = 1.0  # a wheel that comes back faster than this has not arrived


@dataclass(frozen=True, slots=True)
class AxleCycle:
    """One axle in one cycle. Torques are amounts; slip and acceleration count in the direction of the slide."""

    period_s: float
    now_us: int
    speed_m_s: float  # the reference speed
    slip_m_s: float  # against it: positive when the wheel slides
    slide_m_s2: float  # how fast the wheel runs away; negative: it comes back
    most_N_m: float  # that the law may give: the driver's demand, or the adhesion's limit below it
    actual_N_m: float  # what the actuators are thought to give now


@dataclass(frozen=True, slots=True)
class ThresholdConstants:
    """Found by a search on training rides; see docs/explanation/slip-control.md."""

    on_m_s: float = 0.71  # slip at which a slide begins: this, or the share of the speed where that is more
    on_share: float = 0.048
    on_m_s2: float = 9.2  # or at half the slip, when the wheel runs away faster than this
    off_share: float = 0.50  # of the slip at which it begins: below it, it is over
    back_m_s2: float = 3.0  # a wheel that comes back faster than this has not arrived
    hold_m_s2: float = 1.54  # a wheel that comes back faster than this needs no further cut
    reapply_share: float = 0.8  # of the torque at which the slide began: given back at once
    rise_N_m_s: float = 4800.0  # then it grows by this,
    growth_s: float = 0.10  # and the faster the longer no slide has come: e-fold in this time


class Phase(Enum):
    """What is done with the torque."""

    FOLLOW = 0
    CUT = 1
    HOLD = 2
    REAPPLY = 3


class Thresholds:
    """The law of one axle."""

    release: Release = Release(after_s=3.0, share=0.6)

    def __init__(self, constants: ThresholdConstants | None = None) -> None:
        self._c = constants or ThresholdConstants()
        self.phase = Phase.FOLLOW
        self._torque_N_m = 0.0
        self._began_N_m = 0.0
        self._rise_N_m_s = self._c.rise_N_m_s

    @property
    def sliding(self) -> bool:
        """Whether torque is cut or held."""
        return self.phase in (Phase.CUT, Phase.HOLD)

    def reset(self) -> None:
        """Give what is demanded again."""
        self.phase = Phase.FOLLOW

    def step(self, seen: AxleCycle) -> float:
        """One cycle on."""
        c = self._c
        on = max(c.on_m_s, c.on_share * seen.speed_m_s)
        over = seen.slip_m_s > on or (seen.slip_m_s > 0.5 * on and seen.slide_m_s2 > c.on_m_s2)
        if self.sliding:
            back = seen.slip_m_s < c.off_share * on and -seen.slide_m_s2 < c.back_m_s2
            if back:
                self.phase = Phase.REAPPLY
                self._torque_N_m = c.reapply_share * self._began_N_m
                self._rise_N_m_s = c.rise_N_m_s
            elif -seen.slide_m_s2 > c.hold_m_s2:
                if self.phase is Phase.CUT:
                    self._torque_N_m = seen.actual_N_m
                self.phase = Phase.HOLD
            else:
                self.phase, self._torque_N_m = Phase.CUT, 0.0
        elif over:
            self.phase = Phase.CUT
            self._began_N_m = min(seen.actual_N_m, seen.most_N_m)
            self._torque_N_m = 0.0
        elif self.phase is Phase.REAPPLY:
            self._torque_N_m += self._rise_N_m_s * seen.period_s
            self._rise_N_m_s *= 1.0 + seen.period_s / c.growth_s
            if self._torque_N_m >= seen.most_N_m:
                self.phase = Phase.FOLLOW
        if self.phase is Phase.FOLLOW:
            self._torque_N_m = seen.most_N_m
        return min(self._torque_N_m, seen.most_N_m)


BAND_BAR = 0.08  # half of what a cycle of filling or venting changes at medium pressure


class Blending:
    """Follows one axle's torque with drive and valve, and keeps a model of both: the drive's torque is not on the bus.

    The valve acts after a delay: it is set by the pressure that will be there by then.
    """

    def __init__(self, facts: Facts, period_s: float) -> None:
        self._facts, self._period_s = facts, period_s
        cycles = round(facts.actuators.pneumatics.valve_delay_s / period_s)
        self._coming = deque([Valve.FILL] * cycles, maxlen=max(cycles, 1))
        self._drive_N_m = 0.0
        self.pressure_bar = 0.0

    @property
    def actual_N_m(self) -> float:
        """What drive and cylinder are thought to give now, an amount."""
        return abs(self._drive_N_m) + self.pressure_bar * self._facts.actuators.pneumatics.torque_per_bar_N_m

    def take(self, pressure_bar: float) -> None:
        """Take a measured pressure."""
        self.pressure_bar = pressure_bar

    def step(self, torque_N_m: float, share: float, braking: bool, speed_m_s: float | None) -> tuple[float, Valve]:
        """Drive torque (signed) and valve for a wanted amount of torque; share is the driver's.

        speed None: not known; all is demanded of the drive, and what it is not allowed the actuators keep from it.
        """
        if not braking:
            most = self._facts.actuators.drive.traction_N_m(speed_m_s or 0.0, self._facts.wheelset.r_0)
            self._follow(min(torque_N_m, most))
            return torque_N_m, self._set(Valve.FILL, 0.0)
        facts, pneumatics = self._facts, self._facts.actuators.pneumatics
        if speed_m_s is None:
            electric, demand_bar = torque_N_m, facts.actuators.demand_bar(share, 0.0)
        else:
            electric, demand_bar = (
                facts.actuators.electric_N_m(share, speed_m_s),
                facts.actuators.demand_bar(share, speed_m_s),
            )
        target_bar = max(torque_N_m - electric, 0.0) / pneumatics.torque_per_bar_N_m
        coming_bar = self._coming_bar(demand_bar)
        if torque_N_m >= facts.demand_N_m(share, True):
            valve = Valve.FILL
        elif coming_bar > target_bar + BAND_BAR or (target_bar == 0.0 and coming_bar > 0.0):
            valve = Valve.VENT
        else:
            valve = Valve.FILL if coming_bar < target_bar - BAND_BAR else Valve.HOLD
        drive = -min(max(torque_N_m - self.pressure_bar * pneumatics.torque_per_bar_N_m, 0.0), electric)
        self._follow(drive)
        return drive, self._set(valve, demand_bar)

    def _coming_bar(self, demand_bar: float) -> float:
        pressure = self.pressure_bar
        for valve in self._coming:
            pressure = self._after(valve, pressure, demand_bar)
        return pressure

    def _after(self, valve: Valve, pressure_bar: float, demand_bar: float) -> float:
        """Pressure a cycle later."""
        if valve is Valve.HOLD:
            return pressure_bar
        pneumatics = self._facts.actuators.pneumatics
        target = demand_bar if valve is Valve.FILL else 0.0
        constant_s = pneumatics.vent_s if target < pressure_bar else pneumatics.fill_s
        return pressure_bar + (target - pressure_bar) * min(self._period_s / constant_s, 1.0)

    def _set(self, valve: Valve, demand_bar: float) -> Valve:
        acts = self._coming[0] if self._coming else valve
        self.pressure_bar = self._after(acts, self.pressure_bar, demand_bar)
        self._coming.append(valve)
        return valve

    def _follow(self, wanted_N_m: float) -> None:
        d = self._facts.actuators.drive
        change = (wanted_N_m - self._drive_N_m) / max(d.lag_s, self._period_s)
        rate = d.rise_N_m_s if self._drive_N_m * change >= 0.0 else d.fall_N_m_s
        self._drive_N_m += min(max(change, -rate), rate) * self._period_s


WITHOUT_SHARE = 0.02  # of the full brake: an axle that is given less has no brake
MAX_WITHOUT_S = 3.0
APPLIED_S = 0.5  # then it has what the driver demands for so long
MAX_WITHOUT_ROLLING = 2  # interventions; then the axle's protection is off
ROLLED_M_S = 0.5  # a wheel without brake that has gained so much rolls


class Guard:
    """The guard of one axle. interventions: how often it took the brake out of the protection's hands.

    off: the wheel never rolled up between interventions, so its speed shows nothing. The axle has what the driver
    demands until the protection would give it too, or the effort ends.
    """

    def __init__(self) -> None:
        self.interventions = 0
        self.off = False
        self._without_rolling = 0
        self._lowest_m_s: float | None = None
        self._with_us: int | None = None
        self._until_us = 0

    def begin(self, now_us: int) -> None:
        """Count the time without brake from now on."""
        self._with_us = now_us

    def reset(self) -> None:
        """Forget the effort that has ended."""
        self.off, self._without_rolling, self._lowest_m_s = False, 0, None

    def step(self, now_us: int, wheel_m_s: float, torque_N_m: float, demand_N_m: float, full_N_m: float) -> float:
        """|torque| of a cycle when braking, from what the protection gives and what the driver demands."""
        if now_us < self._until_us:
            return demand_N_m
        without = torque_N_m < WITHOUT_SHARE * full_N_m <= demand_N_m
        if not without or self._rolls(wheel_m_s):
            self._without_rolling = 0
        self.off = self.off and torque_N_m < demand_N_m and not self._rolls(wheel_m_s)
        if self.off:
            return demand_N_m
        if self._with_us is None or not without:
            self._with_us, self._lowest_m_s = now_us, wheel_m_s
        elif now_us - self._with_us >= MAX_WITHOUT_S * 1e6:
            self.interventions += 1
            self._without_rolling += 1
            self.off = self._without_rolling >= MAX_WITHOUT_ROLLING
            self._with_us, self._lowest_m_s, self._until_us = None, None, now_us + round(APPLIED_S * 1e6)
            return demand_N_m
        return torque_N_m

    def _rolls(self, wheel_m_s: float) -> bool:
        """Whether the wheel has gained speed since the newest intervention."""
        self._lowest_m_s = wheel_m_s if self._lowest_m_s is None else min(self._lowest_m_s, wheel_m_s)
        return wheel_m_s - self._lowest_m_s > ROLLED_M_S


PERIOD_S = CYCLE_US * 1e-6
SLOPE_CYCLES = 3  # the wheel's acceleration is taken over so many: noise of 0.5 m/s2 with the rig's tachometer


class ControlledAxle:
    """One axle. inputs: its messages; given_N_m: |torque| demanded of its actuators in the cycle before."""

    def __init__(self, number: int, facts: Facts, limit: AdhesionLimit | None) -> None:
        self.wheel = NewestFrame(rig_message(f"WheelSpeed_A{number}"))
        self.pressure = NewestFrame(rig_message(f"BrakePressure_A{number}"))
        self.channel = Channel(rig_message(f"Demand_A{number}"))
        self.law, self.limit = Thresholds(), limit
        self.blending = Blending(facts, PERIOD_S)
        self.guard = Guard()
        self.given_N_m = 0.0
        self.wheel_silent = True
        self.slide_m_s2 = 0.0
        self._facts = facts
        self._speeds: deque[tuple[int, float]] = deque(maxlen=SLOPE_CYCLES + 1)

    @property
    def speed_m_s(self) -> float:
        """The wheel's circumferential newest speed that was received."""
        return float(self.wheel.values["WheelSpeed"])

    def observe(self, now_us: int, braking: bool) -> None:
        """Take the wheel's state of a cycle: whether it is silent, and how fast it runs away (0 while not known)."""
        self.wheel_silent = not self.wheel.fresh(now_us)
        self.slide_m_s2 = 0.0
        if self.wheel_silent:
            self._speeds.clear()
            return
        self._speeds.append((now_us, self.speed_m_s))
        (before_us, before), (_, speed) = self._speeds[0], self._speeds[-1]
        if now_us > before_us:
            slope = (speed - before) / (now_us - before_us) * 1e6
            self.slide_m_s2 = -slope if braking else slope

    def force_N(self) -> float:
        """Force at the rail in the direction of the effort: torque less what turns the wheelset itself."""
        f = self._facts
        torque = self.blending.actual_N_m - f.inertia_kg_m2 * self.slide_m_s2 / f.wheelset.r_0
        return max(torque, 0.0) / f.wheelset.r_0
