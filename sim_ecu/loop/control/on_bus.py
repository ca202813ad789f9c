"""`sim-ecu control`: a controller as an ordinary process on a bus."""

import gc
import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import Protocol

from sim_ecu.loop.control.controller import CYCLE_US, Controller
from sim_ecu.loop.control.pacer import Pacer
from sim_ecu.loop.counted import down
from sim_ecu.loop.end import End, Lines, open_end, until_told


class Watch(Protocol):
    """Hears what the controller hears, and tells of it."""

    @property
    def ids(self) -> tuple[int, ...]:
        """Of the messages that it hears."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def look(self, now_us: int) -> list[str]:
        """The lines of what has changed in this cycle."""

    def summary(self) -> list[str]:
        """Lines of what came of it."""


class OnBus:
    """Turns a controller every 10 ms: hears what has come, and sends its demands.

    Deadlines are absolute. A cycle for which the computer came too late is left out and counted: no demand is sent
    twice, none that is old. paced_by: the message that the cycles follow, so that each has the newest.
    """

    def __init__(
        self, controller: Controller, watches: Sequence[Watch], end: End, paced_by: int | None = None
    ) -> None:  # fmt: skip
        self._controller, self._watches, self.end = controller, watches, end
        self._pacer = Pacer()
        self._paced_by = paced_by
        self._cycle = 0
        self.cycles = self.skipped = self.frames = self.unsent = 0
        end.begin()

    def wait_s(self) -> float:
        """How long until the next cycle."""
        return max((self._cycle + 1) * CYCLE_US - self.end.now_us, 0) * 1e-6

    def turn(self) -> None:
        """One cycle; nothing if it is not time yet."""
        cycle = self.end.now_us // CYCLE_US
        if cycle <= self._cycle:
            return
        late_us = None
        for stamp_us, f in self.end.receive():
            if f.can_id == self._paced_by:
                late_us = self._pacer.hear(stamp_us)
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
        """What came of it, for a person."""
        bus = self.end.counts()
        return [
            f"  time      {self.end.now_us * 1e-6:.1f} s, {self.cycles} cycles of 10 ms, {self.skipped} left out",
            f"  demand    {self.frames} frames, {self.unsent} not sent{down(bus)}",
            *(f"  {line}" for watch in self._watches for line in watch.summary()),
        ]


def control_on_bus(
    controller: Controller, watches: Sequence[Watch], interface: str, channel: str, seconds: float | None = None,
    paced_by: int | None = None,
) -> list[str]:  # fmt: skip
    """Until SIGTERM or Ctrl-C comes, or so many seconds are over. It hears the messages of its watches, and its cycles
    follow one of them.

    Returns what it came to, as lines. Raises InputError, BusError.
    """
    lines = Lines()
    with ExitStack() as cleanup:
        link = open_end(interface, channel, tuple(i for watch in watches for i in watch.ids))
        cleanup.callback(link.close)
        told = cleanup.enter_context(until_told())
        # what the start has left is not looked through again and again for garbage
        gc.collect()
        gc.freeze()
        cleanup.callback(gc.unfreeze)
        controls = OnBus(controller, watches, End(link, lines), paced_by)
        while not told() and (seconds is None or controls.end.now_us < seconds * 1e6):
            time.sleep(controls.wait_s())
            controls.turn()
        return controls.summary()
