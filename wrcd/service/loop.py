"""The live loop: drain what the kernel holds, tick, send. One thread, no queue."""

import gc
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import compress, groupby
from types import FrameType

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.bus.link import Link
from wrcd.core.core import BACKWARD_STEP_US, FORWARD_STEP_US, Core
from wrcd.core.reports import Made
from wrcd.recorder.kept import KeptSlides
from wrcd.recorder.recorder import Recorder
from wrcd.service.journal import CounterLog, log_line
from wrcd.service.notify import Notifier

# The loop turns this long after the end of a tick with which frames are due, when its last frames have usually come in;
# then at every tick until that one is closed. Between slots it pauses, for so long at the most: a kernel's default
# buffer holds the frames of a full bus. Where a link may stamp frames as they are fetched, it turns at every tick.
SETTLE_US = 1_000
MAX_PAUSE_US = 20_000
# A tick is closed when a frame of a later one arrives. The clock closes it only on a silent bus: after so many ticks
# without a frame. On a busy computer a frame may be stamped milliseconds before the kernel hands it over, and a tick
# closed without it would not be what a replay computes.
SILENT_TICKS = 2
# Systemd's watchdog gets turns that ended this long after they were due and no later: an Adhesion frame's slot.
# A loop that is always later sends next to nothing, and a new one may do better.
LATE_US = 20_000
# A loop that stood still for no longer than this closes every tick of that time; for longer it is a step of time.
MAX_STALL_US = 60_000_000


def wall_us() -> int:
    """The clock that stamps frames: CLOCK_REALTIME in whole microseconds."""
    return time.time_ns() // 1000


def steady_us() -> int:
    """A clock that nobody steps, in whole microseconds."""
    return time.monotonic_ns() // 1000


class Daemon:
    """Ties a link to the core. poll() waits and turns once; run() goes on until it is stopped. write takes a line of
    the log."""

    def __init__(
        self,
        core: Core,
        link: Link,
        notifier: Notifier | None = None,
        clock: Callable[[], int] = wall_us,
        steady: Callable[[], int] = steady_us,
        recorder: Recorder | None = None,
        kept: KeptSlides | None = None,
        write: Callable[[str], None] = log_line,
    ) -> None:
        self.core, self.link = core, link
        self._recorder, self._kept = recorder, kept
        core.health.link = link.health
        self._watch = CounterLog(core, link, write)
        self._notifier = notifier or Notifier({})
        self._clock, self._monotonic = clock, steady
        self._advanced_us = steady()  # the steady clock's time up to which the core was advanced
        self._offset_us = clock() - self._advanced_us  # of the wall clock from it
        self._period_us = round(core.config.design.tick_s * 1e6)
        self._stop = False
        self._turn_us, self._paused = self._next_turn()
        self._silent = 0  # ticks in a row that brought nothing
        self._slot_in_time = True  # whether the newest slot's frames still belonged to it
        self._next_ping_us = 0
        self.sent = 0

    def poll(self) -> None:
        """Wait until something is due, then one turn."""
        # no wake-up per frame: the kernel holds them until then
        time.sleep(self.wait_s())
        self.turn()

    def wait_s(self) -> float:
        """How long until the next turn is due. A clock that steps back makes nobody wait longer than was planned."""
        left_us = self._turn_us - self._clock()
        return min(max(left_us, 0), self._paused * self._period_us + SETTLE_US) * 1e-6

    def turn(self) -> None:
        """Take all frames there are, close the ticks that are over, send what is due."""
        # both at once: what lies between them while frames are read on a busy computer would look like a step
        now, steady_us = self._clock(), self._monotonic()
        out: list[Made] = []
        counts = self.core.counts
        before, ticks = counts.seen, counts.ticks
        frames = self.link.receive_batch(now)
        stood_us = steady_us - self._advanced_us
        if stood_us <= FORWARD_STEP_US:
            out.append(self._feed(frames))
        else:
            for frame in frames:
                out += [*self._bridge(frame.stamp_us, stood_us), self._feed([frame])]
        self._silent = self._silent_ticks(now, found=counts.seen > before)
        if self._silent >= SILENT_TICKS:
            out += [*self._bridge(now - SETTLE_US, stood_us), self.core.advance(now - SETTLE_US)]
        self._note_time(now, steady_us)
        for made in out:
            self._send(made)
        self._look_after(now, in_time=counts.ticks > ticks and self._in_time())
        self._turn_us, self._paused = self._next_turn()

    def _silent_ticks(self, now_us: int, found: bool) -> int:
        """For how many ticks nothing has come; stamps tell of those that the loop slept through. A loop that comes late
        may come before the kernel's own work: it has looked once."""
        slept = self._paused if abs(now_us - self._turn_us) <= self._period_us else 1
        if not found:
            return self._silent + slept
        past = (self._turn_us - self.core.newest_us) // self._period_us
        return past if 0 <= past < slept else 0

    def _feed(self, frames: FrameBatch | Sequence[Frame]) -> Made:
        if self._recorder is not None:
            self._recorder.received(frames)
        return self.core.feed(frames)

    def _bridge(self, until_us: int, stood_us: int) -> Iterator[Made]:
        """Where the core is behind because the loop stood still, take it through that time: no step of time."""
        at_us = self.core.time_us
        if at_us is not None and until_us - at_us <= min(stood_us, MAX_STALL_US) + FORWARD_STEP_US:
            for moment_us in range(at_us + FORWARD_STEP_US, until_us, FORWARD_STEP_US):
                yield self.core.advance(moment_us)

    def _note_time(self, now_us: int, steady_us: int) -> None:
        """Note up to when the core is advanced now, by the clock that nobody steps."""
        offset_us, at_us = now_us - steady_us, self.core.time_us
        stepped = abs(offset_us - self._offset_us) > BACKWARD_STEP_US
        self._advanced_us = steady_us if stepped or at_us is None else min(at_us - offset_us, steady_us)
        self._offset_us = offset_us

    def _in_time(self) -> bool:
        return self._slot_in_time and self._clock() - self._turn_us <= LATE_US

    def _next_turn(self) -> tuple[int, int]:
        """When the next turn is due, and how many ticks it is away."""
        tick = self._clock() // self._period_us
        may_pause = self.link.health.up and self.link.stamps_arrivals
        until_us = min(self.core.next_slot_us, tick * self._period_us + MAX_PAUSE_US) if may_pause else 0
        ticks = max(until_us // self._period_us - tick, 1)
        return (tick + ticks) * self._period_us + SETTLE_US, ticks

    def _send(self, made: Made) -> None:
        """Send what still belongs to its slot. A slot that is over is skipped and counted, never sent in a burst."""
        stamps, cycles = (made.frames[name].tolist() for name in ("stamp_us", "cycle_us"))
        for stamp_us, slot in groupby(range(len(stamps)), stamps.__getitem__):
            now_us, places = self._clock(), list(slot)
            due = [k for k in places if now_us // cycles[k] <= stamp_us // cycles[k]]
            self._slot_in_time = due[-1:] == places[-1:]
            self.core.health.overruns += len(places) - len(due)
            self.sent += self._send_all(made.batch(due))

    def _send_all(self, frames: FrameBatch | Sequence[Frame]) -> int:
        """Send a slot's frames. Returns how many went."""
        went = self.link.send_all(frames)
        if self._recorder is not None:
            for frame in compress(frames, went):
                self._recorder.sent(frame)
        return went.count(True)

    def _look_after(self, now_us: int, in_time: bool) -> None:
        health = self.core.health
        health.state = "Running" if self.link.health.up else "LinkDown"
        if self._recorder is not None:
            self._recorder.turn(now_us)
        if self._kept is not None:
            self._kept.turn(now_us)
        self._watch.look(now_us)
        every = self._notifier.watchdog_every_us
        if in_time and every is not None and not (0 < self._next_ping_us - now_us <= every):
            self._notifier.notify("WATCHDOG=1")
            self._next_ping_us = now_us + every

    def catch_up(self) -> None:
        """Take what arrived while the program started. Its slots are over: what would have been sent is not."""
        self.core.muted = True
        # what is older than a window and a bit would have left it again
        since = self._clock() - round(1.25e6 * self.core.config.design.window_s)
        while frames := self.link.receive(self._clock()):
            self._feed([frame for frame in frames if frame.stamp_us >= since])
            if self._clock() - frames[-1].stamp_us < 2 * self._period_us:
                break
        self.core.muted = False
        self._note_time(self._clock(), self._monotonic())
        self.link.health.drops = 0  # an overflow before the start is no loss of the running daemon's

    def run(self) -> None:
        """Until SIGTERM, SIGINT or SIGHUP. However it ends, an exception included, the last frames say NotAvailable,
        and it is off the bus before the recorder writes what is pending: that takes seconds."""
        for s in (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1):
            signal.signal(s, self.on_signal)
        if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup: it outlives its terminal
            signal.signal(signal.SIGHUP, self.on_signal)
        try:
            self.catch_up()
            self._go_on()
        finally:
            try:
                self._leave()
            finally:
                try:
                    if self._recorder is not None:
                        self._recorder.close(self._clock())
                finally:
                    if self._kept is not None:
                        self._kept.close()

    def _go_on(self) -> None:
        # what the start has left is not looked through again and again for garbage
        gc.collect()
        gc.freeze()
        self._notifier.notify("READY=1")
        while not self._stop:
            self.poll()

    def _leave(self) -> None:
        """The last frames, and off the bus."""
        self._notifier.notify("STOPPING=1")
        try:
            self._send_all(self.core.shutdown_frames(self._clock()))
        except Exception as e:  # there is one on its way already, perhaps: that one is to be seen
            log_line(f"the last frames were not sent: {e!r}")
        finally:
            self.link.close()

    def on_signal(self, number: int, _frame: FrameType | None = None) -> None:
        """Handle a signal: SIGUSR1 asks for a dump, others stop."""
        if number == signal.SIGUSR1:
            if self._recorder is not None:
                self._recorder.ask()
        else:
            self._stop = True
