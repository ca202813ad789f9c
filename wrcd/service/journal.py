"""Log lines of the running daemon: one per thing that happened, and of each kind at most one a second."""

import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from wrcd.bus.dbc import find_message
from wrcd.bus.frame import EXTENDED
from wrcd.bus.link import Link, LinkState
from wrcd.bus.positions import message_key
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change, Events
from wrcd.core.slides import slides_of

EVERY_US = 1_000_000
T = TypeVar("T")


def is_due(next_us: int, now_us: int) -> bool:
    """Whether a second has gone by; a clock that stepped back silences nobody."""
    return not 0 < next_us - now_us <= EVERY_US


class ChangeLines:
    """Gets every change once; what was left out is summed up a second after the line before it."""

    def __init__(self, events: Events, write: Callable[[str], None]) -> None:
        self._events, self._write = events, write
        self._told = 0  # changes so far
        self._next_us: dict[tuple[int, Cause], int] = {}  # by axle and cause, from when on there may be a line
        self._held: dict[tuple[int, Cause], tuple[Change, int]] = {}  # the newest that was left out, and how many were
        self._newest: dict[int, Change] = {}  # by axle

    def look(self, now_us: int) -> None:
        """Write what is new, and what may now be written of what was left out."""
        if self._events.total != self._told:
            new = self._events.since(self._told)
            self._told = self._events.total
            for change in new:
                self._add(change, now_us)
        if self._held:
            for key in [k for k in self._held if is_due(self._next_us[k], now_us)]:
                self._sum_up(key, now_us)

    def _add(self, change: Change, now_us: int) -> None:
        key = (change.axle, change.cause)
        self._newest[change.axle] = change
        left_out = self._held.pop(key, (change, 0))[1]
        if not is_due(self._next_us.get(key, 0), now_us):
            self._held[key] = change, left_out + 1
            return
        self._next_us[key] = now_us + EVERY_US
        self._write(f"axle {change.axle}: {change.text}{_more(left_out)}")

    def _sum_up(self, key: tuple[int, Cause], now_us: int) -> None:
        change, left_out = self._held.pop(key)
        self._next_us[key] = now_us + EVERY_US
        if change is self._newest[change.axle]:  # it still is so
            self._write(f"axle {change.axle}: {change.text}{_more(left_out - 1)}")
        else:
            self._write(f"axle {change.axle}: {left_out} more in the last second: {change.step}")


def _more(n: int) -> str:
    return f" ({n} more in the last second)" if n else ""


MAX_REASONS = 6  # in one line; likewise of what is clipped
MAX_IDS = 3
STATES: dict[LinkState, str] = {
    "Up": "the CAN link is up",
    "Down": "the CAN link is down: nothing comes, nothing goes",
    "Gone": "the CAN device is gone: it is opened again when it is back",
    "ErrorPassive": "the CAN controller is error-passive: look at wiring, termination and bit rate",
    "BusOff": "the CAN controller is bus-off: nothing comes, nothing goes",
}


def log_line(line: str) -> None:
    """A line to the log, which is stderr. That nobody reads it is no reason to stop."""
    try:
        print(f"wrcd: {line}", file=sys.stderr, flush=True)
    except OSError:
        pass


@dataclass(slots=True)
class _RateLimitedCounter:
    """A counter, the line about what it has gained, and how much of it has been reported."""

    total: Callable[[], int]
    line: str
    always: bool = True  # or only while the link is up: on a dead bus it goes without saying
    reported: int = 0
    next_us: int = 0


class CounterLog:
    """Looks at the counters of a core and its link between turns, and tells what they gained."""

    def __init__(self, core: Core, link: Link, write: Callable[[str], None] = log_line) -> None:
        self._core, self._link, self._write = core, link, write
        counts, health, bus = core.counts, core.health, link.health
        self._counters = (
            _RateLimitedCounter(lambda: bus.reopens, "the CAN device was opened again"),
            _RateLimitedCounter(
                lambda: bus.drops, "lost {n} received frames: the kernel's buffer was full, see 80-wrcd.conf"
            ),
            _RateLimitedCounter(lambda: bus.unsent, "could not send {n} frames", always=False),
            _RateLimitedCounter(lambda: health.overruns, "{n} frames not sent: computer too late"),
            _RateLimitedCounter(lambda: counts.time_steps, "the clock stepped: started anew"),
            _RateLimitedCounter(
                lambda: counts.waits, "an axle is reset again and again by absurd measurements: it waits longer"
            ),
        )
        self._state: LinkState = "Up"
        self._state_next_us = dict.fromkeys(STATES, 0)
        self._refused: Counter[tuple[str, Reason]] = Counter()
        self._clipped: Counter[tuple[int, str]] = Counter()
        self._rejected_next_us = 0
        self._changes = ChangeLines(core.events, write)
        self._foreign: Counter[int] = Counter()  # as reported
        self._foreign_next_us = 0
        self._unlike = dict[tuple[int, int], bool]()  # by the axles of a bogie
        self._biased = False  # as slides show

    def look(self, now_us: int) -> None:
        """Write what is new. The time only spaces the lines."""
        state = self._link.health.state
        if state != self._state and is_due(self._state_next_us[state], now_us):
            self._state, self._state_next_us[state] = state, now_us + EVERY_US
            self._write(STATES[state])
        for c in self._counters:
            gained = c.total() - c.reported
            if not c.always and not self._link.health.up:
                c.reported += gained
            elif gained and is_due(c.next_us, now_us):
                c.reported, c.next_us = c.reported + gained, now_us + EVERY_US
                if gained > 0:  # a counter set back to zero has nothing to tell
                    self._write(c.line.format(n=gained))
        if is_due(self._rejected_next_us, now_us):
            self._rejected_next_us = now_us + EVERY_US
            self._log_rejected()
            self._log_clipped()
            self._log_design_fit()
            self._log_slides()
        if self._link.health.foreign_frames != self._foreign.total() and is_due(self._foreign_next_us, now_us):
            self._foreign_next_us = now_us + EVERY_US
            self._log_foreign()
        self._changes.look(now_us)

    def _log_foreign(self) -> None:
        """What somebody else sent under this daemon's ids."""
        by_key = self._link.health.foreign_by_key
        new, self._foreign = by_key - self._foreign, by_key.copy()
        names = sent_messages(self._core.config)
        shown = [f"{names.get(key, 'an id')} (0x{key & ~EXTENDED:03X})" for key, _ in new.most_common(MAX_IDS)]
        rest = f" and {len(new) - MAX_IDS} more" if len(new) > MAX_IDS else ""
        self._write(
            f"somebody else sends {', '.join(shown)}{rest}: {new.total()} frames in the last second; is another "
            "wrcd on this bus?"
        )

    def _log_rejected(self) -> None:
        rejected_by_message = self._core.counts.rejected_by_message
        if new := rejected_by_message - self._refused:
            self._refused = rejected_by_message.copy()
            why = _most(new, lambda of: f"{of[1]} {of[0]}")
            self._write(f"rejected {new.total()} frames in the last second: {why}")

    def _log_design_fit(self) -> None:
        """Once, that a bogie is another one than the design's; and once, that it no longer seems so."""
        for fit in self._core.design_fits:
            is_unlike = fit.word == "Unlike"
            if is_unlike != self._unlike.get(fit.axles, False):
                self._unlike[fit.axles] = is_unlike
                over = f"axles {fit.axles[0]} and {fit.axles[1]}: the design no longer seems another bogie's"
                self._write(fit.sentence if is_unlike else over)

    def _log_slides(self) -> None:
        """Once, that slides contradict the estimates before them; and once, that they no longer do."""
        slides = slides_of(self._core.estimator)
        if (slides.bias != 0.0) != self._biased:
            self._biased = not self._biased
            self._write(slides.sentence or "slides no longer show that estimates are too high or low")

    def _log_clipped(self) -> None:
        clipped = self._core.counts.clipped
        if new := clipped - self._clipped:
            self._clipped = clipped.copy()
            which = _most(new, lambda of: f"axle {of[0]} {of[1]}")
            self._write(f"left out {new.total()} clipped samples of the last second: {which}")


def _most(new: Counter[T], named: Callable[[T], str]) -> str:
    """What is most of some counts, each named, and the sum of the others."""
    most = new.most_common(MAX_REASONS)
    rest = new.total() - sum(n for _, n in most)
    return ", ".join(f"{named(of)} {n}" for of, n in most) + f", others {rest}" * (rest > 0)


def sent_messages(config: Config) -> dict[int, str]:
    """The names of the messages that a daemon sends, by Frame.key."""
    of_axles = [o for a in config.axles for o in a.sent]
    named = [o.message for o in (*of_axles, config.status, config.rejects, config.link) if o is not None]
    return {message_key(find_message(config.database, name)): name for name in named}
