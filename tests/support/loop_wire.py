"""A bus without a kernel, on a time that a test sets: rig and controller of the real-time loop, in one process; and a
stop of the loop in lockstep, with what a bus may make of its timing."""

from collections.abc import Callable, Sequence

from sim_ecu import bench
from sim_ecu.bench import Bench, Figures, Timing
from sim_ecu.loop.bus_end import End, StatusLines
from sim_ecu.loop.control.adhesion_consumer import TrainController
from sim_ecu.loop.control.control_on_bus import InputWatch, OnBus, Watch
from sim_ecu.loop.drive_scenario import DriveScenario, read_drive_scenario
from sim_ecu.loop.drive_session import DriveSession
from wrcd.bus.frame import Frame
from wrcd.bus.link import Link, LinkHealth
from wrcd.config.settings import parse_toml

SHORT = """
title = "full braking from 12 m/s on greasy rail"
duration_s = 1.0
speed_m_s = 12
rail = [{ curve = "E" }]
driver = { demand = -1.0 }
"""
STOP = "emergency-greasy"  # the stop of docs/how-to/close-the-loop.md
# Demands that act at once, a sample late, and half a cycle and a sample late.
TIMINGS = (Timing(), Timing(delay_us=5000), Timing(phase_us=5000, delay_us=5000))
EPOCH_US = 1_700_000_000_000_000
TURN_US = 5_000


def scenario(text: str = "", seconds: float = 3.0) -> DriveScenario:
    """One axle on greasy rail, braked in full from 12 m/s, for so long; with more TOML before its driver."""
    rail = f'title = "t"\nduration_s = {seconds}\nspeed_m_s = 12\nrail = [{{ curve = "E" }}]\n'
    return read_drive_scenario(parse_toml(f"{rail}{text}\n[driver]\ndemand = -1.0\n", "test"), "test")


def stop_in_lockstep(timing: Timing, seed: int = 1) -> Figures:
    """Thresholds with adhesion, to the end of STOP."""
    stop = bench.scenario(STOP, seed=seed)
    return Bench(stop, daemon=True, controller="thresholds", with_adhesion=True, timing=timing).run()


class SetClock:
    """Stands still until a test moves it. Its wall clock may be stepped."""

    def __init__(self) -> None:
        self.us = 0
        self.step_us = 0

    def monotonic_ns(self) -> int:
        return self.us * 1000

    def time_ns(self) -> int:
        return (EPOCH_US + self.us + self.step_us) * 1000


class WireLink(Link):
    """An end of a Wire. `up` False: nothing comes, nothing goes."""

    name = "wire"

    def __init__(self, wire: "Wire") -> None:
        self.health = LinkHealth()
        self.waiting: list[Frame] = []
        self.sent: list[Frame] = []
        self._wire = wire

    def receive(self, now_us: int) -> list[Frame]:
        self.health.state = "Up" if self._wire.up else "Down"
        frames, self.waiting = self.waiting, []
        return frames

    def send(self, frame: Frame) -> bool:
        if not self._wire.up:
            self.health.unsent += 1
            return False
        self.sent.append(frame)
        for end in self._wire.links:
            if end is not self:
                end.waiting.append(self._wire.touch(frame))
        return True

    def close(self) -> None:
        """Nothing is held."""


class KeptLines(StatusLines):
    """Lines for a test to read, by the time that they tell."""

    def __init__(self) -> None:
        self.moves = True
        self.events: list[tuple[float, str]] = []
        self.states: list[str] = []

    def event(self, at_us: int, text: str) -> None:
        self.events.append((at_us * 1e-6, text))

    def status(self, text: str) -> None:
        self.states.append(text)

    def at_s(self, text: str) -> list[float]:
        """When a line with a text was told."""
        return [at for at, line in self.events if text in line]


class Wire:
    """Rig and controller on one wire. A test may take either's turn away, the wire, or frames on it."""

    def __init__(self, rides: DriveScenario, controller: TrainController, more: Sequence[Watch] = ()) -> None:
        self.up = True
        self.touch: Callable[[Frame], Frame] = lambda frame: frame
        self.links: list[WireLink] = []
        self.clock = SetClock()
        self.rig_lines, self.lines = KeptLines(), KeptLines()
        self.rig_link, self.link = WireLink(self), WireLink(self)
        self.links += [self.rig_link, self.link]
        self.controls = OnBus(controller, [InputWatch(rides.axles), *more], End(self.link, self.lines, self.clock))
        self.drive = DriveSession(rides, End(self.rig_link, self.rig_lines, self.clock))

    def turn(self, rig: bool = True, controller: bool = True) -> bool:
        """5 ms on. False when the scenario is over."""
        self.clock.us += TURN_US
        on = self.drive.step() if rig else True
        if controller:
            self.controls.turn()
        return on

    def turns(self, seconds: float, *, rig: bool = True, controller: bool = True) -> None:
        """So long."""
        for _ in range(round(seconds * 1e6 / TURN_US)):
            self.turn(rig, controller)

    def to_the_end(self, *, controller: bool = True) -> None:
        """Until the scenario is over."""
        while self.turn(controller=controller):
            assert self.clock.us < 200_000_000
