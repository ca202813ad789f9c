"""Rig, daemon's core and controller on virtual time, in one process."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, TrainController
from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.rig import LOOP, TRUTH, WRCD, Rig, Step
from sim_ecu.loop.rig_messages import COAST, rig_message
from sim_ecu.play.encoder import SAMPLE_US, Channel, Sent
from sim_ecu.play.mapped import Train
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.train import PACKAGED
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.errors import InputError

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
    too. train: the messages of the sensors. timing: when the controller acts. Raises InputError for a fault or an axle
    that they leave no way to.
    """

    def __init__(
        self, scenario: DriveScenario, controller: TrainController | None, config: Config | None,
        frame: Listener | None = None, truth: bool = False, sensors: bool = False,
        train: Train = PACKAGED, timing: Timing = ON_TIME,
    ) -> None:  # fmt: skip
        self.core = None if config is None else Core(config)
        wrcd = [WRCD] if sensors or config is not None else []
        self.rig = Rig(scenario, [LOOP, *wrcd, *([TRUTH] if truth else [])], train)
        self._controller, self._frame = controller, frame
        self._end_us = round(scenario.train.duration_s * 1e6)
        self._stop_m_s = scenario.stop_m_s
        self._timing = timing
        self._on_the_way: deque[tuple[int, Sent]] = deque()
        self.over = self._end_us <= 0
        if controller is not None:  # it runs already, and the driver coasts: without a demand it would be mute
            first = Channel(rig_message("DriverDemand")).encode(0, {"Mode": COAST, "Share": 0.0})
            controller.hear(first.can_id, first.data, 0)

    def step(self) -> Step:
        """5 ms on; over says whether its time is up, or the train slower than the scenario's stop_m_s."""
        rig = self.rig
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
        for out in self.core.feed(frame):
            self._send(out.frame.can_id, out.frame.data, out.frame.stamp_us - LOG_START_US)

    def _send(self, can_id: int, data: bytes, stamp_us: int) -> None:
        if self._controller is not None:
            self._controller.hear(can_id, data, stamp_us)
        if self._frame is not None:
            self._frame(stamp_us, can_id, data)
