"""The live loop: drain what the kernel holds, tick, send. One thread, no queue."""

import signal
import time
from collections.abc import Callable
from types import FrameType

from wrcd.bus.link import Link
from wrcd.daemon.core import Core, Outgoing
from wrcd.daemon.notify import Notifier

# The loop turns this long after the end of each tick, when the tick's last frames have usually come in.
SETTLE_US = 1_000
# A tick is closed when a frame of a later one arrives. The clock closes it only on a silent bus: after so many turns
# that found nothing. On a busy computer a frame may be stamped milliseconds before the kernel hands it over,
# and a tick closed without it would not be what a replay computes.
SILENT_TURNS = 2


def wall_us() -> int:
    """The clock that stamps frames: CLOCK_REALTIME in whole microseconds."""
    return time.time_ns() // 1000


class Daemon:
    """Ties a link to the core. poll() waits and turns once; run() goes on until it is told to stop."""

    def __init__(
        self, core: Core, link: Link, notifier: Notifier | None = None, clock: Callable[[], int] = wall_us
    ) -> None:
        self.core, self.link = core, link
        self._notifier = notifier or Notifier({})
        self._clock = clock
        self._period_us = round(core.config.design.tick_s * 1e6)
        self._stop = False
        self._turn_us = self._next_turn_us()
        self._silent = 0  # turns in a row that found nothing
        self._next_ping_us = 0
        self.sent = 0

    def poll(self) -> None:
        """Wait for the end of the tick, then one turn."""
        # no wake-up per frame: the kernel holds them until the tick is over
        time.sleep(self.wait_s())
        self.turn()

    def wait_s(self) -> float:
        """How long until the next turn is due. A clock that steps back makes nobody wait longer than a tick."""
        left_us = self._turn_us - self._clock()
        return min(max(left_us, 0), self._period_us + SETTLE_US) * 1e-6

    def turn(self) -> None:
        """Take all frames there are, close the ticks that are over, send what is due."""
        now = self._clock()
        out: list[Outgoing] = []
        before = self.core.counts.seen
        for frame in self.link.receive(now):
            out += self.core.feed(frame)
        self._silent = 0 if self.core.counts.seen > before else self._silent + 1
        if self._silent >= SILENT_TURNS:
            out += self.core.advance(now - SETTLE_US)
        self._send(out)
        self._look_after(now)
        self._turn_us = self._next_turn_us()

    def _next_turn_us(self) -> int:
        return (self._clock() // self._period_us + 1) * self._period_us + SETTLE_US

    def _send(self, out: list[Outgoing]) -> None:
        """Send what still belongs to its slot. A slot that is over is skipped and counted, never sent in a burst."""
        for o in out:
            if self._clock() // o.cycle_us > o.frame.stamp_us // o.cycle_us:
                self.core.health.overruns += 1
            elif self.link.send(o.frame):
                self.sent += 1

    def _look_after(self, now_us: int) -> None:
        health = self.core.health
        health.drops, health.reopens = self.link.drops, self.link.reopens
        health.state = "Running" if self.link.up else "LinkDown"
        every = self._notifier.watchdog_every_us
        if every is not None and not (0 < self._next_ping_us - now_us <= every):
            self._notifier.say("WATCHDOG=1")
            self._next_ping_us = now_us + every

    def catch_up(self) -> None:
        """Take what arrived while the program started. Its slots are over: what would have been sent is not."""
        self.core.muted = True
        # what is older than a window and a bit would have left it again
        since = self._clock() - round(1.25e6 * self.core.config.design.window_s)
        while frames := self.link.receive(self._clock()):
            for frame in frames:
                if frame.stamp_us >= since:
                    self.core.feed(frame)
            if self._clock() - frames[-1].stamp_us < 2 * self._period_us:
                break
        self.core.muted = False
        self.link.drops = 0  # an overflow before the start is no loss of the running daemon's

    def run(self) -> None:
        """Until SIGTERM or SIGINT; the last frames say NotAvailable."""
        self.catch_up()
        for s in (signal.SIGTERM, signal.SIGINT):
            signal.signal(s, self._on_signal)
        self._notifier.say("READY=1")
        while not self._stop:
            self.poll()
        self._notifier.say("STOPPING=1")
        for frame in self.core.farewell(self._clock()):
            self.link.send(frame)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._stop = True
