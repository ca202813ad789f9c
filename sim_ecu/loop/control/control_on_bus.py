"""`sim-ecu control`: a controller as an ordinary process on a bus, and what is reported of its inputs."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

from sim_ecu.loop.bus_end import End, lost, on_bus
from sim_ecu.loop.control.adhesion_consumer import CYCLE_US, NOTHING_YET, AdhesionReceiver, TrainController, receiver
from sim_ecu.loop.control.controlled_axle import APPLIED_S, MAX_WITHOUT_S
from sim_ecu.loop.control.slip_controller import SlipController
from sim_ecu.loop.rig_messages import (
    NONE_YET,
    SILENT,
    NewestFrame,
    Silences,
    counted,
    driver_demand,
    rig_message,
    times,
)  # fmt: skip
from wrcd.core.configuration import Config

SETTLE_US = 1_000  # from a frame to the cycle that works with it: the other axles' come meanwhile
WINDOW = 50  # frames
STEP_US = 200  # that the cycles are moved by after a window, once they are right: two clocks drift apart slowly
AWAY_US = 2_000  # further than this they are wrong
EVERY_US = 1_000_000  # between two lines of an axle's adhesion


class Pacer:
    """Takes when frames of a message of the same cycle came, returns by how much the cycles are too early (us).

    A frame is late at times and early never: the earliest of a window counts. The first one counts at once.
    """

    def __init__(self) -> None:
        self._earliest_us: int | None = None
        self._frames, self._first = 0, True

    def take(self, stamp_us: int) -> int:
        """Return by how much later the cycles are to come from now on (us); below zero: earlier."""
        # one that is late by nearly a cycle is none of the next that is early
        after_us = (stamp_us + SETTLE_US + AWAY_US) % CYCLE_US - AWAY_US
        self._earliest_us = after_us if self._earliest_us is None else min(self._earliest_us, after_us)
        self._frames += 1
        if self._frames < WINDOW and not self._first:
            return 0
        at_once = self._first or self._earliest_us > AWAY_US
        move_us, self._earliest_us, self._frames, self._first = self._earliest_us, None, 0, False
        return move_us if at_once else min(max(move_us, -STEP_US), STEP_US)


class Watch:
    """Receives what the controller receives, and reports of it. ids: of its messages."""

    ids: tuple[int, ...] = ()

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus; those of other messages are ignored."""

    def look(self, now_us: int) -> list[str]:
        """Return the lines of what has changed in this cycle."""
        return []

    def summary(self) -> list[str]:
        """Return lines of what came of it, for a person."""
        return []


class InputWatch(Watch):
    """The rig's messages that a controller lives by, each with its time-out. It judges nothing for the controller."""

    def __init__(self, axles: Sequence[int]) -> None:
        names = [f"{kind}_A{n}" for n in axles for kind in ("WheelSpeed", "BrakePressure")]
        frames = [driver_demand(), *(NewestFrame(rig_message(name)) for name in names)]
        self._frames = {f.message.frame_id: f for f in frames}
        self._silences = Silences(["DriverDemand", *names], CYCLE_US, {NONE_YET: "has not come yet", SILENT: "silent"})
        self._taken = dict.fromkeys(self._frames, 0)
        self.ids = tuple(self._frames)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        if can_id in self._frames:
            self._taken[can_id] += self._frames[can_id].take(data, stamp_us)

    def look(self, now_us: int) -> list[str]:
        """Return the lines of what has changed."""
        found = self._silences.look(now_us, [not f.fresh(now_us) for f in self._frames.values()])
        return [f"{', '.join(names)}: {what}" for what, names in found.items()]

    def summary(self) -> list[str]:
        """Return lines of what came of it."""
        out = []
        for (name, s), (can_id, frame) in zip(self._silences.by_name.items(), self._frames.items(), strict=True):
            what = f"{self._taken[can_id]} frames" if s.came else "never came"
            what += f", silent {times(s.silences)}, {s.longest_us * 1e-6:.2f} s the longest" if s.silences else ""
            out.append(f"{name:16} {what}{counted(frame.rejected)}")
        return out


@dataclass(slots=True)
class _WatchedAxle:
    receiver: AdhesionReceiver
    used_cycles: int = 0
    why: str = NOTHING_YET  # it was not used, as reported last
    reported_us: int = -EVERY_US


class AdhesionWatch(Watch):
    """The adhesion messages of a configuration, with receivers beside the controller's."""

    def __init__(self, config: Config, axles: Sequence[int]) -> None:
        self._axles = {a.number: _WatchedAxle(receiver(config, a)) for a in config.axles if a.number in axles}
        self._cycles = 0
        self.ids = tuple(a.receiver.can_id for a in self._axles.values())

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""
        for a in self._axles.values():
            a.receiver.hear(can_id, data, stamp_us)

    def look(self, now_us: int) -> list[str]:
        """Return the lines of what has changed."""
        self._cycles += 1
        lines = []
        for n, a in self._axles.items():
            why = a.receiver.why_unused(now_us)
            a.used_cycles += why == ""
            if why != a.why and now_us - a.reported_us >= EVERY_US:
                a.why, a.reported_us = why, now_us
                lines.append(f"axle {n}: adhesion {f'not used: {why}' if why else 'used'}")
        return lines

    def summary(self) -> list[str]:
        """Return lines of what came of it."""
        cycles = max(self._cycles, 1)
        return [
            f"adhesion, axle {n}: usable in {a.used_cycles / cycles:.0%} of the cycles{counted(a.receiver.rejected)}"
            for n, a in self._axles.items()
        ]


class ProtectionWatch(Watch):
    """The guard's interventions, and how the reference was proved, of a controller that is looked at in every cycle."""

    def __init__(self, controller: SlipController) -> None:
        self._axles = dict(zip(controller.facts.axles, controller.axles, strict=True))
        self._proof = controller.proof
        self._interventions = dict.fromkeys(self._axles, 0)
        self._off = dict.fromkeys(self._axles, False)
        self._freed: int | None = None

    def look(self, now_us: int) -> list[str]:
        """Return the lines of what has changed."""
        lines = []
        for n, a in self._axles.items():
            if a.guard.interventions > self._interventions[n]:
                self._interventions[n] = a.guard.interventions
                lines.append(f"axle {n}: guard: no brake for {MAX_WITHOUT_S:g} s, applied for {APPLIED_S:g} s")
            if a.guard.off is not self._off[n]:
                self._off[n] = a.guard.off
                why = "off: its wheel speed never rose without brake" if a.guard.off else "on again"
                lines.append(f"axle {n}: protection {why}")
        if self._proof.freed is not self._freed:
            self._freed = self._proof.freed
            if self._freed is not None:
                lines.append(f"axle {list(self._axles)[self._freed]}: released to prove the reference speed")
            elif self._proof.proved:
                lines.append("reference speed proved")
        return lines

    def summary(self) -> list[str]:
        """Return lines of what came of it."""
        guard = ", ".join(f"axle {n}: {times(count)}" for n, count in self._interventions.items() if count)
        lost, released = times(self._proof.losses), times(self._proof.releases)
        return [
            f"guard acted      {guard or 'never'}",
            f"reference speed  lost {lost}, axles released {released} to prove it",
        ]


class OnBus:
    """Turns a controller every 10 ms: takes what has come, and sends its demands.

    Deadlines are absolute. A cycle for which the computer came too late is left out and counted: no demand is sent
    twice, none that is old. paced_by: the message that the cycles follow, so that each has the newest.
    """

    def __init__(
        self, controller: TrainController, watches: Sequence[Watch], end: End, paced_by: int | None = None
    ) -> None:  # fmt: skip
        self._controller, self._watches, self.end = controller, watches, end
        self._pacer = Pacer()
        self._paced_by = paced_by
        self._cycle = 0
        self.cycles = self.skipped = self.frames = self.unsent = 0
        end.begin()

    def wait_s(self) -> float:
        """Return how long until the next cycle (s)."""
        return max((self._cycle + 1) * CYCLE_US - self.end.now_us, 0) * 1e-6

    def turn(self) -> None:
        """One cycle; nothing if it is not time yet."""
        cycle = self.end.now_us // CYCLE_US
        if cycle <= self._cycle:
            return
        late_us = None
        for stamp_us, f in self.end.receive():
            if f.can_id == self._paced_by:
                late_us = self._pacer.take(stamp_us)
            self._controller.hear(f.can_id, f.data, stamp_us)
            for watch in self._watches:
                watch.hear(f.can_id, f.data, stamp_us)
        self.skipped += cycle - self._cycle - 1
        self.cycles += 1
        self._cycle = cycle
        due_us, wall_us = cycle * CYCLE_US, self.end.wall_us()
        for demand in self._controller.tick(due_us):
            sent = self.end.send(demand.can_id, demand.data, wall_us)
            self.frames += sent
            self.unsent += not sent
        for line in (line for watch in self._watches for line in watch.look(due_us)):
            self.end.lines.event(due_us, line)
        if late_us:
            self.end.wait(late_us)  # the cycles that come

    def summary(self) -> list[str]:
        """Return what came of it, for a person."""
        bus = self.end.counts()
        return [
            f"  time      {self.end.now_us * 1e-6:.1f} s, {self.cycles} cycles of 10 ms, {self.skipped} left out",
            f"  demand    {self.frames} frames, {self.unsent} not sent{lost(bus)}",
            *(f"  {line}" for watch in self._watches for line in watch.summary()),
        ]


def control_on_bus(
    controller: TrainController, watches: Sequence[Watch], interface: str, channel: str, seconds: float | None = None,
    paced_by: int | None = None,
) -> list[str]:  # fmt: skip
    """Until SIGTERM or Ctrl-C comes, or so many seconds are over. It receives the messages of its watches; one may
    pace its cycles.

    Returns what it came to, as lines. Raises InputError, BusError.
    """
    with on_bus(interface, channel, tuple(i for watch in watches for i in watch.ids)) as (end, signalled):
        controls = OnBus(controller, watches, end, paced_by)
        while not signalled() and (seconds is None or end.now_us < seconds * 1e6):
            time.sleep(controls.wait_s())
            controls.turn()
        return controls.summary()
