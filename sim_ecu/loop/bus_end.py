"""The end of a bus that the rig or a controller has in real time: its link, its time, what is reported of both."""

import gc
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any

from sim_ecu.loop.rig_messages import times
from sim_ecu.play.pace import Clock
from wrcd.bus.frame import Frame
from wrcd.bus.link import Link, LinkState
from wrcd.bus.opening_hints import bring_up, is_down
from wrcd.bus.pythoncan import PythonCanLink
from wrcd.bus.socketcan import SocketCanLink
from wrcd.colour import moves
from wrcd.errors import BusError

STATES: dict[LinkState, str] = {
    "Down": "bus down: nothing comes, nothing goes",
    "Gone": "bus gone: it is opened again when it is back",
    "BusOff": "bus-off: nothing comes, nothing goes",
    "ErrorPassive": "the CAN controller is error-passive: look at wiring, termination and bit rate",
}

UP = ("Up", "ErrorPassive")
BEFORE_US = 1_000_000  # how old a frame can be that waits for the run to begin


def open_end(interface: str, channel: str, keys: tuple[int, ...], *, confirm: bool = True) -> Link:
    """Open a bus for frames of some ids. confirm: frames wait until earlier ones have left, if the kernel reports it.

    Raises InputError for an unknown interface, BusError for a bus that cannot be opened or that is down.
    """
    if interface != "socketcan":
        return PythonCanLink(interface, channel, keys, user_settings=True)
    if is_down(channel):
        raise BusError(f"CAN interface {channel!r} is down", key="channel", hint=bring_up(channel))
    return SocketCanLink(channel, keys, confirm=confirm)


class StatusLines:
    """What is reported on the way, on standard error: events, and on a terminal one line that is written anew."""

    def __init__(self) -> None:
        self.moves = moves(sys.stderr)

    def event(self, at_us: int, text: str) -> None:
        """A line of its own, with the seconds of the run before it."""
        self._write(f"{at_us * 1e-6:8.2f} s  {text}\n")

    def status(self, text: str) -> None:
        """The line that stays the last, on a terminal."""
        if self.moves:
            self._write(text)

    def end(self) -> None:
        """Leave the line."""
        if self.moves:
            self._write("")

    def _write(self, text: str) -> None:
        # that nobody reads it is no reason to stop
        try:
            print(("\r\033[K" if self.moves else "") + text, end="", file=sys.stderr, flush=True)
        except OSError:
            pass


class End:
    """A link with the time of a run: microseconds since it began, on the clock that nobody steps."""

    def __init__(self, link: Link, lines: StatusLines, clock: Clock = time) -> None:
        self.link, self.lines = link, lines
        self._clock = clock
        self._start_ns = clock.monotonic_ns()
        self._looked_us = 0
        self._state: LinkState = "Up"
        self._left_us = 0  # when it was up last
        self.downs, self.down_us = 0, 0
        self._foreign = self._drops = 0

    def begin(self) -> None:
        """The run begins now. Frames that came before have times below zero, and may have been lost."""
        self._start_ns = self._clock.monotonic_ns()
        self._looked_us = -BEFORE_US
        self._drops = self.link.health.drops

    def wait(self, us: int) -> None:
        """Let the run's time stand still for so long; below zero: let it go on by so much."""
        self._start_ns += us * 1000
        self._looked_us = min(self._looked_us, self.now_us)

    @property
    def now_us(self) -> int:
        """Since the run began."""
        return (self._clock.monotonic_ns() - self._start_ns) // 1000

    def wall_us(self) -> int:
        """Since 1970."""
        return self._clock.time_ns() // 1000

    def receive(self) -> list[tuple[int, Frame]]:
        """The data frames since the last look, with the time of the run when each came.

        The kernel stamps with a clock that may be stepped: a frame is no older than the last look.
        """
        wall_us, now_us = self.wall_us(), self.now_us
        since_us, self._looked_us = self._looked_us, now_us
        out = [
            (max(now_us - max(wall_us - f.stamp_us, 0), since_us), f)
            for f in self.link.receive(wall_us)
            if f.plain and not f.extended
        ]
        self._watch(now_us)
        return out

    def send(self, can_id: int, data: bytes, stamp_us: int) -> bool:
        """Send at once, or not at all. stamp_us: since 1970, the same for what is sent together."""
        return self.link.send(Frame(stamp_us, can_id, data))

    def counts(self) -> dict[str, float]:
        """What has become of the bus so far."""
        health = self.link.health
        down_us = self.down_us + (0 if self._state in UP else self.now_us - self._left_us)
        return {
            "downs": self.downs, "down_s": round(down_us * 1e-6, 3), "reopens": health.reopens,
            "drops": health.drops - self._drops, "foreign_frames": health.foreign_frames,
        }  # fmt: skip

    def _watch(self, now_us: int) -> None:
        """Report what has become of the bus."""
        state = self.link.health.state
        was_up = self._state in UP
        if not self.link.health.up:
            if was_up:
                self.downs += 1
                self._left_us = now_us
        elif not was_up:
            self.down_us += now_us - self._left_us
            self.lines.event(now_us, f"bus again after {(now_us - self._left_us) * 1e-6:.1f} s")
        if state != self._state and state in STATES:
            self.lines.event(now_us, STATES[state])
        self._state = state
        foreign = self.link.health.foreign_by_key
        if foreign and not self._foreign:
            ids = ", ".join(f"0x{key:03X}" for key in sorted(foreign)[:4])
            self.lines.event(now_us, f"somebody else sends what is sent here ({ids}): is there another on this bus?")
        self._foreign = len(foreign)


def lost(bus: Mapping[str, Any]) -> str:
    """Return what has become of a bus, from the counts of its end; nothing if nothing has."""
    text = f"; bus down {times(bus['downs'])}, {bus['down_s']:.1f} s" if bus["downs"] else ""
    text += f"; {bus['drops']} frames lost in the kernel's buffer" if bus["drops"] else ""
    return text + (f"; {bus['foreign_frames']} frames under its ids by somebody else" if bus["foreign_frames"] else "")


@contextmanager
def on_bus(
    interface: str, channel: str, keys: tuple[int, ...], *, confirm: bool = True
) -> Iterator[tuple[End, Callable[[], bool]]]:
    """An end of a bus for a run in real time, as open_end makes it; and whether SIGTERM or Ctrl-C has come: the block
    decides what to do about it."""
    came = False

    def on_signal(_number: int, _frame: FrameType | None) -> None:
        nonlocal came
        came = True

    link = open_end(interface, channel, keys, confirm=confirm)
    before = {s: signal.signal(s, on_signal) for s in (signal.SIGTERM, signal.SIGINT)}
    gc.collect()
    gc.freeze()  # what the start has left is not looked through again and again for garbage
    try:
        yield End(link, StatusLines()), lambda: came
    finally:
        gc.unfreeze()
        for s, handler in before.items():
            signal.signal(s, handler)
        link.close()
