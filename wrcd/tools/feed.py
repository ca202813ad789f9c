"""A log's frames through a core: what lies between them, and what comes of them."""

from collections import deque
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np

from wrcd.bus.columns import MIN_ROWS, Columns, Stretch
from wrcd.bus.frame import Frame
from wrcd.core.core import FORWARD_STEP_US, Core
from wrcd.core.messages import Outgoing
from wrcd.recorder.resume import Saved, replay_events
from wrcd.tools.progress import Progress

# A log has no clock to tell a silence from a step of time by. A gap of up to so long between its lines, whoever's they
# are, is a silence, and its slots are made; a longer one is a step. What comes after it is the same either way.
MAX_SILENCE_US = 60_000_000
MAX_GAP_US = 500_000  # between frames of a stretch that is read by columns: far from any silence

Item = TypeVar("Item", Stretch | tuple[Frame, str], tuple[Frame, str])


def outgoing(core: Core, frames: Iterable[tuple[Frame, str]], saved: Saved | None) -> Iterator[tuple[Outgoing, str]]:
    """What the core makes of a log's frames, and the channel. What the loop did between them is done again; where the
    log does not come from a recorder and nothing tells of it, its lines are the clock."""
    events = deque(saved.events if saved is not None else ())
    lines, channel = 0, ""
    for lines, (frame, channel) in enumerate(frames):
        before = replay_events(core, events, lines) if saved is not None else silence(core, frame.stamp_us)
        for o in (*before, *core.feed(frame)):
            yield o, channel
    for o in replay_events(core, events, lines + 1):
        yield o, channel


def outgoing_of_stretches(core: Core, items: Iterable[Stretch | tuple[Frame, str]]) -> Iterator[tuple[Outgoing, str]]:
    """The same of a log that does not come from a recorder, by columns where it is regular."""
    columns = Columns(core.receiver, core.check_all)
    for item in items:
        if isinstance(item, tuple):
            yield from outgoing(core, (item,), None)
        elif not _goes_on(core, item):
            yield from outgoing(core, ((frame, item.channel) for frame in item.frames()), None)
        else:
            core.hold()
            for place, stamp_us, reader, samples, checked in columns.read(item):
                if checked and samples is not None:
                    made = core.feed_checked(samples, stamp_us)
                else:
                    made = core.feed_read(reader, samples or item.frame(place), stamp_us)
                for o in made:
                    yield o, item.channel
            for o in core.release():
                yield o, item.channel


def _goes_on(core: Core, s: Stretch) -> bool:
    """Whether a stretch is worth it, and no frame of it is a step of time or the end of a silence, for mapped frames
    and others alike."""
    if len(s) < MIN_ROWS:  # as between frames that are not plain
        return False
    mapped = np.flatnonzero(np.isin(s.keys, core.receiver.keys))
    if not len(mapped) or not core.goes_on_from(int(s.stamps_us[mapped[0]])):
        return False
    gaps = np.diff(s.stamps_us[mapped], append=s.stamps_us[-1])
    return bool((gaps >= 0).all() and (gaps < MAX_GAP_US).all() and (np.diff(s.stamps_us) >= 0).all())


def silence(core: Core, stamp_us: int) -> list[Outgoing]:
    """Take a core through the silence before a stamp, if it is one, as a clock does: by a second at once at most."""
    out: list[Outgoing] = []
    if core.time_us is not None and stamp_us - core.time_us <= MAX_SILENCE_US:
        while stamp_us - core.time_us > FORWARD_STEP_US:
            out += core.advance(core.time_us + FORWARD_STEP_US)
    return out


def progress(items: Iterator[Item], log: Path) -> Iterator[Item]:
    """The same frames, or stretches of them; on a terminal a line tells how far the log has come."""
    shown = Progress()
    first = None
    for number, item in enumerate(items):
        many = isinstance(item, Stretch)
        if many or number % 1000 == 0:
            stamp_us = int(item.stamps_us[-1]) if isinstance(item, Stretch) else item[0].stamp_us
            first = stamp_us if first is None else first
            shown.at(f"{log.name}: {(stamp_us - first) * 1e-6:.0f} s of log")
        yield item
    shown.end()
