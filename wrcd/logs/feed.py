"""What of a log goes through a core, what comes of it, and which part of that is written."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped
from wrcd.bus.positions import message_key
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.core.core import FORWARD_STEP_US, Core
from wrcd.core.details import NEVER
from wrcd.core.reports import Made, Outgoing
from wrcd.errors import InputError
from wrcd.logs.columns import MIN_ROWS, Item, Stretch
from wrcd.logs.decoder import sent_messages
from wrcd.logs.reader import LogReader
from wrcd.logs.time_order import MAX_SILENCE_US, frames_of

MAX_GAP_US = 500_000  # between frames of a stretch that is read by columns: far from any silence


def made_of_log(
    core: Core, log: LogReader, part: Callable[[Iterator[Item]], Iterator[Item]] = iter
) -> Iterator[tuple[Made, str]]:
    """What the core makes of a part of a log, and the channel."""
    with log:
        yield from made_of_stretches(core, log.clock.items(part(log.in_order())))


def made(core: Core, frames: Iterable[tuple[Frame, str]]) -> Iterator[tuple[Made, str]]:
    """What the core makes of a log's frames, and the channel. The log's lines are the clock."""
    for frame, channel in frames:
        for of_silence in silence(core, frame.stamp_us):
            yield of_silence, channel
        yield core.feed(frame), channel


def made_of_stretches(core: Core, items: Iterable[Item]) -> Iterator[tuple[Made, str]]:
    """The same, many frames at once where the log is regular."""
    for item in items:
        if isinstance(item, tuple):
            yield from made(core, (item,))
        elif not _goes_on(core, item):
            yield from made(core, ((frame, item.channel) for frame in item.frames()))
        else:
            yield core.feed(item.batch), item.channel


def outgoing(parts: Iterable[tuple[Made, str]]) -> Iterator[tuple[Outgoing, str]]:
    """The same, frame by frame."""
    return ((o, channel) for part, channel in parts for o in part)


def _goes_on(core: Core, s: Stretch) -> bool:
    """Whether a stretch is worth it, and no mapped frame of it comes after a silence."""
    mapped = s.stamps_us[np.isin(core.mapped.named(s.keys), [m.key for m in core.mapped.messages])]
    if len(s) < MIN_ROWS or not len(mapped):  # as between frames that are not plain
        return False
    before_us = mapped[0] if core.time_us is None else core.time_us
    return bool((np.diff(mapped, prepend=before_us, append=s.stamps_us[-1]) < MAX_GAP_US).all())


def silence(core: Core, stamp_us: int) -> Iterator[Made]:
    """Take a core through the silence before a stamp, if it is one, as a clock does: by a second at once at most."""
    if core.time_us is not None and stamp_us - core.time_us <= MAX_SILENCE_US:
        while stamp_us - core.time_us > FORWARD_STEP_US:
            yield core.advance(core.time_us + FORWARD_STEP_US)


VEHICLE = (Quantity.SPEED, Quantity.DIRECTION)
FAR_US = 365 * 86_400_000_000  # so long before a log, a time that is asked for is not since 1970
AFTER_US = 1_000_000  # of a log, read behind --to: until then what belongs before it has been made


@dataclass(frozen=True, slots=True)
class Selection:
    """begin_s and end_s are seconds since 1970, or of the log if relative; axles are numbers, none: all."""

    begin_s: float | None = None
    end_s: float | None = None
    relative: bool = False
    axles: tuple[int, ...] = ()
    channel: str | None = None

    def check(self, config: Config) -> None:
        """Raises InputError for what cannot be selected."""
        if self.begin_s is not None and self.end_s is not None and self.begin_s >= self.end_s:
            raise InputError(f"{self.end_s:.6f} is not behind --from {self.begin_s:.6f}", key="--to")
        known = [a.number for a in config.axles]
        for number in self.axles:
            if number not in known:
                raise InputError(
                    f"the configuration has no axle {number}", key="--axle", hint=f"it has {', '.join(map(str, known))}"
                )


WHOLE = Selection()


@dataclass(frozen=True, slots=True)
class Survey:
    """What a look into a log tells before it is replayed: its first stamp, and the axles without a frame in it."""

    first_us: int = 0
    without_frame: frozenset[int] = frozenset()


def survey(log: Path, config: Config, channel: str | None) -> Survey:
    """Look into a log as far as needed: until every axle had a frame. Raises InputError as its replay would."""
    keys: dict[int, set[int]] = {}  # axles by mapped message
    mapped = Mapped(config.database, [i.source for i in config.inputs], config.data_ids)
    for i in config.inputs:
        if i.source.quantity not in VEHICLE:
            key = message_key(find_message(config.database, i.source.message))
            keys.setdefault(key, set()).update(config.axles[place].number for place in i.source.axles)
    unseen = {a.number for a in config.axles}
    first_us = None
    for item in LogReader(log, channel).written():
        if isinstance(item, Stretch):
            stamp_us, found = int(item.stamps_us[0]), np.unique(item.keys)
        else:
            stamp_us, found = item[0].stamp_us, np.array([] if item[0].error else [item[0].key], np.int64)
        first_us = stamp_us if first_us is None else first_us
        for key in keys.keys() & mapped.named(found).tolist():
            unseen -= keys[key]
        if not unseen:
            break
    return Survey(first_us or 0, frozenset(unseen))


def _span_us(log: Path, channel: str | None) -> tuple[int, int]:
    """The first and the last time of a log."""
    begin_us = end_us = None
    for item in LogReader(log, channel).written():
        stamps = item.stamps_us if isinstance(item, Stretch) else np.array([item[0].stamp_us])
        first_us, last_us = int(stamps.min()), int(stamps.max())
        begin_us = first_us if begin_us is None else min(begin_us, first_us)
        end_us = last_us if end_us is None else max(end_us, last_us)
    return begin_us or 0, end_us or 0


def check_time(log: Path, selection: Selection, part: "Part") -> None:
    """Raises InputError, with the log's own begin and end, if all of it lies outside of the time asked for. A pipe
    cannot be read again, and is not checked."""
    if (part.begin_us is None and part.end_us is None) or not log.is_file():
        return
    begin_us, end_us = _span_us(log, selection.channel)
    behind = part.begin_us is not None and part.begin_us > end_us
    if not behind and (part.end_us is None or part.end_us > begin_us):
        return
    key, asked_s = ("--from", selection.begin_s) if behind else ("--to", selection.end_s)
    own = " to ".join(f"{(us - part.origin_us) * 1e-6:.6f}" for us in (begin_us, end_us))
    hint = ""
    if not selection.relative:
        hint = "seconds since 1970; with --relative they count from its first frame"
    raise InputError(
        f"{asked_s:.6f} s lies {'behind' if behind else 'before'} the whole log, which goes from {own} s",
        file=log, key=key, hint=hint,
    )  # fmt: skip


def check_since(log: Path, selection: Selection, first_us: int) -> None:
    """Raises InputError for a --from that is surely meant from the log's first frame on, and not since 1970."""
    asked_s = selection.begin_s
    if selection.relative or not asked_s or first_us - asked_s * 1e6 < FAR_US:
        return
    raise InputError(
        f"{asked_s:.6f} is seconds since 1970, and lies far before the log, which begins at {first_us * 1e-6:.6f}",
        file=log, key="--from", hint="with --relative it counts from the log's first frame",
    )  # fmt: skip


class Part:
    """Which outgoing frames and rows are written."""

    def __init__(self, selection: Selection, found: Survey, config: Config) -> None:
        self.origin_us = found.first_us if selection.relative else 0
        self.begin_us = _us(selection.begin_s, self.origin_us)
        self.end_us = _us(selection.end_s, self.origin_us)
        self.axles = frozenset(selection.axles) or frozenset(a.number for a in config.axles) - found.without_frame
        self._left_out = {
            message_key(find_message(config.database, output.message))
            for _, number, output in sent_messages(config)
            if selection.axles and number not in (0, *selection.axles)
        }

    def wanted(self, made: Made) -> Made:
        """The frames that lie within the time, and are not another axle's."""
        if not self._left_out and self.begin_us is None and self.end_us is None:
            return made
        frames = made.frames
        within = ~np.isin(frames["word"], list(self._left_out))
        within &= frames["stamp_us"] >= (NEVER if self.begin_us is None else self.begin_us)
        within &= frames["stamp_us"] < (-NEVER if self.end_us is None else self.end_us)
        return Made(frames[within], made.reports)

    def wants_at(self, stamp_us: int) -> bool:
        """Whether a stamp lies within the time."""
        return (self.begin_us is None or stamp_us >= self.begin_us) and (self.end_us is None or stamp_us < self.end_us)

    def read(self, items: Iterable[Item]) -> Iterator[Item]:
        """A log's frames, as far as they are needed."""
        end_us = None if self.end_us is None else self.end_us + AFTER_US
        for item in items:
            if end_us is None:
                yield item
                continue
            for one in frames_of(item) if isinstance(item, Stretch) and item.stamps_us.max() >= end_us else (item,):
                if not isinstance(one, Stretch) and one[0].stamp_us >= end_us:
                    return
                yield one


def _us(seconds: float | None, origin_us: int) -> int | None:
    return None if seconds is None else round(seconds * 1e6) + origin_us
