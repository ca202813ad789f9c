"""Messages that the monitor knows: which of their frames came, and which of them can be believed."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Message, cycle_ms
from wrcd.bus.e2e import CRC_TABLE, Checker
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.positions import frame_length, is_fd
from wrcd.bus.reasons import Reason
from wrcd.tools.monitor.batch import ERROR, FD, REMOTE, Batch
from wrcd.tools.monitor.table import Table
from wrcd.tools.story.scan import PLAIN_BYTES, Frames

REASONS = ("", *(r.value for r in Reason))  # a place in them is what InputHealth's Refused says, too
KIND, LENGTH, CRC = (REASONS.index(r.value) for r in (Reason.KIND, Reason.LENGTH, Reason.CRC))
DEFAULT_CYCLE_US = 5_000  # of a message for which nobody states one
MAX_REFUSED = 20_000  # of a message, whose times are kept
_CRC = np.frombuffer(CRC_TABLE, dtype=np.uint8)


class Watched:
    """One message: when its good frames came, and when and why others were refused here."""

    def __init__(
        self, message: Message, data_id: int | None, hold_us: int, cycle_us: int = 0, *, keeps_data: bool = False
    ) -> None:
        self.name, self.key, self.message = message.name, message_key(message), message
        self.length, self.fd = frame_length(message), is_fd(message)
        self.start = None if data_id is None else Checker(data_id).start  # of the CRC; None: not protected
        self.cycle_us = cycle_us or round(1000 * (cycle_ms(message) or 0))
        rows = hold_us // (self.cycle_us or DEFAULT_CYCLE_US) * 5 // 4 + 100
        self._keeps_data = keeps_data
        data = {"data": (np.uint8, max(self.length, PLAIN_BYTES))} if keeps_data else {}
        self.arrived = Table({"time_us": (np.int64, 0), **data}, rows)
        self.refused = Table({"time_us": (np.int64, 0), "reason": (np.int8, 0)}, MAX_REFUSED)
        self.refusals = 0  # all of them

    def take(self, times: NDArray[np.int64], reasons: NDArray[np.int8], data: NDArray[np.uint8]) -> None:
        """Note frames: REASONS' place of why each is refused, 0 for a good one; and their data."""
        bad = reasons > 0
        if bad.any():
            self.refusals += int(bad.sum())
            self.refused.append(time_us=times[bad], reason=reasons[bad])
            times, data = times[~bad], data[~bad]
        if self._keeps_data:
            width = max(self.length, PLAIN_BYTES)
            if data.shape[1] < width:
                data = np.pad(data, ((0, 0), (0, width - data.shape[1])))
            self.arrived.append(time_us=times, data=data[:, :width])
        else:
            self.arrived.append(time_us=times)

    def frames(self, begin_us: int, end_us: int) -> Frames:
        """Good frames from a time to another, of a message whose data is kept."""
        rows = slice(*np.searchsorted(self.arrived["time_us"], (begin_us, end_us + 1)))
        times = self.arrived["time_us"][rows]
        return Frames(times, np.full(len(times), self.length, dtype=np.uint8), self.arrived["data"][rows])

    def frame(self, k: int) -> Frame:
        """A row of those."""
        key, data = self.key, self.arrived["data"][k, : self.length].tobytes()
        return Frame(int(self.arrived["time_us"][k]), key & ~EXTENDED, data, bool(key & EXTENDED), fd=self.fd)

    def rate_hz(self, at_us: int, over_us: int = 1_000_000) -> float:
        """Good frames a second, of the second before a time."""
        times = self.arrived["time_us"]
        first, end = np.searchsorted(times, (at_us - over_us, at_us), side="right")
        return float(end - first) * 1e6 / over_us

    def age_us(self, at_us: int) -> int | None:
        """How long before a time its newest good frame came; None where there is none."""
        times = self.arrived["time_us"]
        end = int(np.searchsorted(times, at_us, side="right"))
        return at_us - int(times[end - 1]) if end else None

    def refused_within(self, at_us: int, over_us: int) -> Mapping[int, int]:
        """How many frames were refused before a time, by reason's place."""
        times = self.refused["time_us"]
        first, end = np.searchsorted(times, (at_us - over_us, at_us), side="right")
        places, counts = np.unique(self.refused["reason"][first:end], return_counts=True)
        return dict(zip(places.tolist(), counts.tolist(), strict=True))


class Judge:
    """Tells for all frames of a batch at once whether kind, length and CRC are those of their messages."""

    def __init__(self, watched: Mapping[int, Watched]) -> None:
        keys = sorted(watched)
        self.keys = np.array(keys, dtype=np.int64)
        of = [watched[k] for k in keys]
        self._length = np.array([w.length for w in of], dtype=np.int64)
        self._fd = np.array([FD if w.fd else 0 for w in of], dtype=np.uint8)
        self._start = np.array([w.start or 0 for w in of], dtype=np.uint8)
        self._protected = np.array([w.start is not None for w in of], dtype=bool)

    def judge(self, batch: Batch) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
        """Of each frame the place of its message in keys, -1 for none; and that of a reason in REASONS, 0: good."""
        if not len(self.keys):
            return np.full(len(batch), -1), np.zeros(len(batch), dtype=np.int8)
        places = np.searchsorted(self.keys, batch.key)
        places[places == len(self.keys)] = 0
        known = (self.keys[places] == batch.key) & (batch.flags & ERROR == 0)
        reasons = np.zeros(len(batch), dtype=np.int8)
        wrong = self._protected[places] & (self._crc(batch, places) != batch.data[:, 0])
        reasons[wrong] = CRC
        reasons[batch.length != self._length[places]] = LENGTH
        reasons[(batch.flags & (REMOTE | FD)) != self._fd[places]] = KIND
        places[~known] = -1
        return places, reasons

    def _crc(self, batch: Batch, places: NDArray[np.int64]) -> NDArray[np.uint8]:
        c = self._start[places]
        for k in range(1, int(batch.length.max(initial=0))):
            c = np.where(batch.length > k, _CRC[c ^ batch.data[:, k]], c)
        return c
