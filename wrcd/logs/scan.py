"""A log by message: every frame of an id as columns, gathered in one pass."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.e2e import crc_of_data_id, crcs
from wrcd.bus.frame import Frame
from wrcd.logs.columns import Item, Stretch
from wrcd.logs.reader import LogReader
from wrcd.logs.story_records import NO_GAPS, ClockStep, Gaps, Record

PLAIN_BYTES = 8
MAX_SINGLE = 4096  # frames that are held as objects, by message


@dataclass(frozen=True, slots=True)
class Frames(Record):
    """The n data frames of one id."""

    lengths: NDArray[np.uint8]
    data: NDArray[np.uint8]  # (n, 8), of CAN FD as wide as the longest; zeros behind the data


NO_FRAMES = Frames(np.zeros(0, np.int64), np.zeros(0, np.uint8), np.zeros((0, PLAIN_BYTES), np.uint8))


@dataclass(slots=True)
class Scan:
    """What a log holds. errors_us: the stamps of error frames."""

    log: Path
    channel: str = ""
    begin_us: int = 0
    end_us: int = 0
    frames: dict[int, Frames] = field(default_factory=dict)  # by Frame.key
    errors_us: list[int] = field(default_factory=list)
    remote: int = 0
    warnings: tuple[str, ...] = ()
    whole: bool = True  # whether all of the log could be read
    clock_steps: tuple[ClockStep, ...] = ()
    gaps: Gaps = NO_GAPS

    def rename(self, named: Callable[[NDArray[np.int64]], NDArray[np.int64]]) -> None:
        """Take the frames of a group under its message's id."""
        ids, parts = np.array(list(self.frames), np.int64), dict[int, list[Frames]]()
        for key, frames in zip(named(ids).tolist(), self.frames.values(), strict=True):
            parts.setdefault(key, []).append(frames)
        self.frames = {key: of[0] if len(of) == 1 else _joined(of) for key, of in sorted(parts.items())}

    def of(self, key: int) -> Frames:
        """The frames of an id, perhaps none."""
        return self.frames.get(key, NO_FRAMES)


def scan(log: Path, channel: str | None, reached: Callable[[int], None] = lambda stamp_us: None) -> Scan:
    """Read all of a log, in the order and of the channel that a replay takes. reached gets the times on the way.
    Times are the log's stamps; where its clock is set back, they go on.

    Raises InputError as a replay does: no such log, not one frame, several channels and none named.
    """
    gathering = Gathering()
    with LogReader(log, channel) as reader:
        clock = reader.clock
        for item in reader.monotonic():
            reached(gathering.put(item))
    out = gathering.done(log)
    out.warnings, out.whole = tuple(reader.warnings), reader.whole
    out.clock_steps, out.gaps = tuple(clock.steps), clock.gaps
    if clock.steps:
        ahead_s = clock.correction_us * 1e-6
        out.warnings += (
            f"{log}: times go on over a step of its clock: at the end they are {ahead_s:.3g} s ahead of its stamps",
        )
    return out


class Gathering:
    """Sorts frames by their message as they come."""

    def __init__(self) -> None:
        self._parts: dict[int, list[Frames]] = {}
        self._single: dict[int, list[Frame]] = {}  # since the newest part
        self._out = Scan(Path())
        self._begun = False

    def put(self, item: Item) -> int:
        """Take a frame, or a stretch of them. Returns its newest stamp."""
        if isinstance(item, Stretch):
            self._put_stretch(item)
            first_us, last_us, channel = int(item.stamps_us.min()), int(item.stamps_us.max()), item.channel
        else:
            frame, channel = item
            self.put_frame(frame)
            first_us = last_us = frame.stamp_us
        out = self._out
        out.begin_us = min(out.begin_us, first_us) if self._begun else first_us
        out.end_us = max(out.end_us, last_us) if self._begun else last_us
        out.channel, self._begun = channel, True
        return last_us

    def put_frame(self, frame: Frame) -> None:
        """One frame alone. Error and remote frames carry no data of a message."""
        if frame.error:
            self._out.errors_us.append(frame.stamp_us)
        elif frame.remote:
            self._out.remote += 1
        else:
            held = self._single.setdefault(frame.key, [])
            held.append(frame)
            if len(held) >= MAX_SINGLE:
                self._flush(frame.key)

    def _put_stretch(self, s: Stretch) -> None:
        whole = Frames(s.stamps_us, s.lengths.astype(np.uint8), s.data)
        for key, rows in rows_by_key(s.keys):
            self._flush(key)
            self._parts.setdefault(key, []).append(whole.part(rows))

    def _flush(self, key: int) -> None:
        singles = self._single.pop(key, None)
        if singles:
            self._parts.setdefault(key, []).append(_columns(singles))

    def done(self, log: Path) -> Scan:
        """All of it, by time."""
        for key in list(self._single):
            self._flush(key)
        self._out.log = log
        for key in sorted(self._parts):
            self._out.frames[key] = _joined(self._parts.pop(key))
        return self._out


def rows_by_key(keys: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """Yield each key with its rows, in their order."""
    rows = np.argsort(keys, kind="stable")
    for part in np.split(rows, np.flatnonzero(np.diff(keys[rows])) + 1):
        if len(part):
            yield int(keys[part[0]]), part


def _columns(frames: Sequence[Frame]) -> Frames:
    width = max(PLAIN_BYTES, *(len(f.data) for f in frames))
    data = np.frombuffer(b"".join([f.data.ljust(width, b"\0") for f in frames]), dtype=np.uint8)
    return Frames(
        np.array([f.stamp_us for f in frames], dtype=np.int64),
        np.array([len(f.data) for f in frames], dtype=np.uint8),
        data.reshape(-1, width),
    )


def _joined(parts: list[Frames]) -> Frames:
    width = max(p.data.shape[1] for p in parts)
    wide = [np.pad(p.data, ((0, 0), (0, width - p.data.shape[1]))) for p in parts]
    time_us = np.concatenate([p.time_us for p in parts])
    lengths, data = np.concatenate([p.lengths for p in parts]), np.concatenate(wide)
    if (np.diff(time_us) < 0).any():  # jitter between queues
        order = np.argsort(time_us, kind="stable")
        time_us, lengths, data = time_us[order], lengths[order], data[order]
    return Frames(time_us, lengths, data)


def are_good(frames: Frames, length: int, data_id: int | None) -> NDArray[np.bool_]:
    """Which frames have a message's length, and the CRC that fits where it is under E2E Profile 11, (n,)."""
    good: NDArray[np.bool_] = frames.lengths == length
    if data_id is not None and frames.data.shape[1] >= length:
        good &= crcs(frames.data, crc_of_data_id(data_id), length) == frames.data[:, 0]
    return good


def good_frames(frames: Frames, length: int, data_id: int | None) -> Frames:
    """Those frames alone."""
    good = are_good(frames, length, data_id)
    return frames if good.all() else frames.part(good)
