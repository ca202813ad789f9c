"""Rig, daemon's core and controller on virtual time, in one process; and stand-ins for daemon and controller."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, TrainController
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.driver import LEVER_US, Driver
from sim_ecu.loop.rig import LOOP, TRUTH, WRCD, Rig, Step
from sim_ecu.loop.rig_messages import COAST, rig_message
from sim_ecu.physics.actuators import Valve
from sim_ecu.physics.contact import peak
from sim_ecu.physics.rail import rail_at
from sim_ecu.play.encoder import COUNTERS, SAMPLE_US, Channel, Sent, data_id, databases, protect
from sim_ecu.play.mapped import Train
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.train import PACKAGED
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import surface
from wrcd.errors import InputError


def cost_of_driving(axles: int, daemon: bool) -> float:
    """Processor time of a second that is driven, about, in any unit."""
    more = axles - 1
    return 1.0 + 0.5 * more + daemon * (1.2 + 0.8 * more)


class ConstantAdhesion:
    """Passes a controller what is on the bus, and a constant estimate that is Valid, and precise to a point."""

    def __init__(self, controller: TrainController, axles: Sequence[int], mu_pct: float) -> None:
        self._controller = controller
        self._messages = [databases()[0].get_message_by_name(f"Adhesion_A{n}") for n in axles]
        self._values: dict[str, int | float | str] = {
            "Crc": 0, "Validity": "Valid", "MuAvailable": mu_pct, "MuUsed": 0.0, "SampleAge": 5,
            "Surface": surface(mu_pct), "ContactState": "Adhering",
            "Confidence": "Within1pp",
        }  # fmt: skip

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Pass a frame on."""
        self._controller.hear(can_id, data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """Send it where a frame is due, then let the controller act."""
        for m in self._messages:
            cycle_us = int(m.cycle_time or 0) * 1000
            if now_us % cycle_us == 0:
                data = m.encode({**self._values, "Counter": now_us // cycle_us % COUNTERS})
                self._controller.hear(m.frame_id, protect(data, data_id(m)), now_us)
        return self._controller.tick(now_us)


Listener = Callable[[int, int, bytes], None]


@dataclass(frozen=True, slots=True)
class Timing:
    """How a controller's cycle lies to the rig's messages. On a bus that is chance, and a stop's wear depends on it.

    phase_us: it acts so long after the rig's 10 ms messages: 0 or 5000. delay_us: its demands are on their way for so
    long, in whole samples of 5 ms. Raises InputError for another number.
    """

    phase_us: int = 0
    delay_us: int = 0

    def __post_init__(self) -> None:
        if self.phase_us not in range(0, CYCLE_US, SAMPLE_US):
            raise InputError(f"takes 0 or {SAMPLE_US}, not {self.phase_us}", key="phase_us")
        if self.delay_us < 0 or self.delay_us % SAMPLE_US:
            raise InputError(f"takes whole samples of {SAMPLE_US} us, not {self.delay_us}", key="delay_us")


ON_TIME = Timing()


class Lockstep:
    """One run, step by step: `step`, or all of them until it is over.

    controller None: nobody on the bus demands anything. config None: there is no daemon on it. frame is called with all
    data frames on the bus: time (us from the start), id, data. sensors: the frames for wrcd are made without a daemon,
    too. driver: who demands instead of the scenario's course, hears what is on the bus, and knows where the train is.
    train: the messages of the sensors. timing: when the controller acts. Raises InputError for a fault or an axle
    that they leave no way to.
    """

    def __init__(
        self, scenario: DriveScenario, controller: TrainController | None, config: Config | None,
        frame: Listener | None = None, truth: bool = False, sensors: bool = False,
        train: Train = PACKAGED, timing: Timing = ON_TIME, driver: Driver | None = None,
    ) -> None:  # fmt: skip
        self.core = None if config is None else Core(config)
        if self.core is not None:
            self.core.explains = False
        wrcd = [WRCD] if sensors or config is not None else []
        self.rig = Rig(scenario, [LOOP, *wrcd, *([TRUTH] if truth else [])], train)
        self._controller, self._frame = controller, frame
        self._end_us = round(scenario.train.duration_s * 1e6)
        self._stop_m_s = scenario.stop_m_s
        self._timing, self._driver, self._mark_m = timing, driver, scenario.mark_m
        self._on_the_way: deque[tuple[int, Sent]] = deque()
        self.over = self._end_us <= 0
        if controller is not None:  # it runs already, and the driver coasts: without a demand it would be mute
            first = Channel(rig_message("DriverDemand")).encode(0, {"Mode": COAST, "Share": 0.0})
            controller.hear(first.can_id, first.data, 0)

    def end_daemon(self) -> None:
        """From now on there is no daemon: its frames end, as of one that is killed."""
        self.core = None
        self.rig.end_daemon()

    def step(self) -> Step:
        """5 ms on; over says whether its time is up, or the train slower than the scenario's stop_m_s."""
        rig = self.rig
        if self._driver is not None and rig.time_us % LEVER_US == 0:
            rig.set_share(self._driver.demand(rig.time_us, rig.distance_m, rig.speed_m_s, self._mark_m))
        step = rig.step()
        for f in step.frames:
            self._deliver(f)
        carried = self.rig.carries(self.rig.time_us)
        if self.core is not None and not carried:
            self.core.advance(LOG_START_US + self.rig.time_us)  # what it sends reaches nobody
        if self.rig.time_us % CYCLE_US == self._timing.phase_us and self._controller is not None:
            for f in self._controller.tick(self.rig.time_us):
                self._on_the_way.append((self.rig.time_us + self._timing.delay_us, f))
                if self._frame is not None and carried:
                    self._frame(f.due_us, f.can_id, f.data)
        while self._on_the_way and self._on_the_way[0][0] <= self.rig.time_us:
            f = self._on_the_way.popleft()[1]
            self.rig.hear(f.can_id, f.data, self.rig.time_us)
        self.over = self.rig.time_us >= self._end_us or step.speed_m_s < self._stop_m_s
        return step

    def __iter__(self) -> Iterator[Step]:
        while not self.over:
            yield self.step()

    def _deliver(self, f: Sent) -> None:
        if not f.error:
            self._send(f.can_id, f.data, f.due_us)
        if self.core is None:
            return
        frame = Frame(LOG_START_US + f.due_us, f.can_id, f.data, f.extended, error=f.error)
        for out in self.core.feed_batch(FrameBatch.of([frame])):
            self._send(out.frame.can_id, out.frame.data, out.frame.stamp_us - LOG_START_US)

    def _send(self, can_id: int, data: bytes, stamp_us: int) -> None:
        if self._controller is not None:
            self._controller.hear(can_id, data, stamp_us)
        if self._driver is not None:
            self._driver.hear(can_id, data, stamp_us)
        if self._frame is not None:
            self._frame(stamp_us, can_id, data)


HELD = 0.98  # of the lowest peak under the wheel and as far ahead as the actuators need to follow
# How far: of an electric drive, and where the friction brake takes part.
AHEAD_S, AHEAD_OF_FRICTION_S = (0.1, 0.2), (0.15, 0.3, 0.45)
CUT = 0.5  # of the torque in use, beyond the peak's creep, until the wheel is back below it
PAST_PEAK = 1.5  # of the peak's creep
BAND_BAR = 0.05  # about the wanted pressure: held


class Ideal:
    """Sees the truth and the rail ahead, and demands of each axle HELD of what it will carry."""

    def __init__(self, scenario: DriveScenario) -> None:
        train = scenario.train
        self._scenario, self._contact = scenario, train.wheelset.contact
        w = train.wheelset
        # the wheelset's own rotation takes torque beside what the rail carries
        self._unit_N_m = 2 * w.normal_N * w.r_0 * (1.0 + (w.I_R + w.I_L) / (w.r_0**2 * w.M_v))
        self._radius_m = w.r_0
        a = scenario.actuators
        friction = float(scenario.driver.at(np.array([np.inf]))[0]) < 0.0 and a.full_brake_N_m > a.drive.max_brake_N_m
        self._ahead_s = AHEAD_OF_FRICTION_S if friction else AHEAD_S
        self._past = [False] * len(train.axles)

    def demands(self, step: Step | None) -> Sequence[tuple[float, Valve]]:
        """Torque and valve of every axle, from the newest step."""
        if step is None:
            return [(0.0, Valve.FILL)] * len(self._past)
        a = self._scenario.actuators
        full_N_m = a.full_brake_N_m if step.share < 0.0 else a.drive.traction_N_m(step.speed_m_s, self._radius_m)
        out = []
        for k in range(len(self._past)):
            most = min(abs(step.share) * full_N_m, self._carried(k, step))
            if step.share >= 0.0:
                out.append((most, Valve.VENT if step.pressure_bar[k] > 0.0 else Valve.FILL))
            else:
                out.append(self._brakes(k, step, most))
        return out

    def _carried(self, k: int, step: Step) -> float:
        """Torque that the axle may have."""
        axle, speed = self._scenario.train.axles[k], max(step.speed_m_s, 1.0)
        at = step.distance_m + axle.position_m
        creep, here = peak(speed, self._contact, *rail_at(axle.rail, at)[:5])
        ahead = [peak(speed, self._contact, *rail_at(axle.rail, at + speed * t)[:5])[1] for t in self._ahead_s]
        # what is under the wheel may be better than the rail was: those before have cleaned it
        better = float(step.mu_available[k]) / here
        slip = abs(float(step.slip_m_s[k])) / speed
        self._past[k] = slip > (1.0 if self._past[k] else PAST_PEAK) * creep
        if self._past[k]:
            return CUT * abs(float(step.mu_used[k])) * self._unit_N_m
        return HELD * better * min(here, *ahead) * self._unit_N_m

    def _brakes(self, k: int, step: Step, most_N_m: float) -> tuple[float, Valve]:
        """Friction brake to what the electric one leaves; the electric one to what the friction brake leaves."""
        a = self._scenario.actuators
        electric = a.electric_N_m(-step.share, step.speed_m_s)
        wanted = max(most_N_m - electric, 0.0) / a.pneumatics.torque_per_bar_N_m
        bar = float(step.pressure_bar[k])
        lead = a.pneumatics.valve_delay_s
        rate = (a.demand_bar(-step.share, step.speed_m_s) - bar) / a.pneumatics.fill_s
        if bar + max(rate, 0.0) * lead < wanted - BAND_BAR:
            valve = Valve.FILL
        elif bar * (1.0 - lead / a.pneumatics.vent_s) > wanted + BAND_BAR:
            valve = Valve.VENT
        else:
            valve = Valve.HOLD
        friction = bar * a.pneumatics.torque_per_bar_N_m
        return -float(np.clip(most_N_m - friction, 0.0, electric)), valve


def ride_ideal(scenario: DriveScenario) -> Iterator[Step]:
    """The steps of a run whose demands come from the ideal; nothing is on the bus."""
    rig, ideal = Rig(scenario, []), Ideal(scenario)
    end_us = round(scenario.train.duration_s * 1e6)
    step: Step | None = None
    while rig.time_us < end_us:
        for axle, (torque, valve) in zip(scenario.axles, ideal.demands(step), strict=True):
            rig.demand(axle, torque, valve)
        step = rig.step()
        yield step
        if step.speed_m_s < scenario.stop_m_s:
            return
