"""AUTOSAR E2E Profile 11, data id mode "both": CRC in byte 0, counter 0 … 14 in the low nibble of byte 1."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.reasons import Reason

COUNTER_MODULO = 15
# How many counts may be missing between two frames that are used one after the other (two lost frames).
MAX_LOST = 2
# A second sender differs from stray frames by so many of its own that continue each other beside the chain; after so
# many frames of the chain alone a stray one is forgotten.
CANDIDATE_FRAMES = 3
CANDIDATE_FORGOTTEN = 4
# Moving to another chain once or twice is a sender that starts anew; more within a few frames is two senders.
MOVE, MAX_MOVES = 4, 2


def _table() -> bytes:
    # SAE J1850: x^8 + x^4 + x^3 + x^2 + 1
    out = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc << 1) ^ 0x1D if crc & 0x80 else crc << 1
        out.append(crc & 0xFF)
    return bytes(out)


CRC_TABLE = _table()
_TABLE = np.frombuffer(CRC_TABLE, dtype=np.uint8)


def crc(data: bytes | bytearray, data_id: int) -> int:
    """CRC over the data id (low byte first) and the frame without its first byte. Initial and final value 0."""
    return _crc_after(_of_data_id(data_id), data)


def _of_data_id(data_id: int) -> int:
    """The CRC of the data id alone: the part of it that is the same for all frames of a message."""
    return CRC_TABLE[CRC_TABLE[data_id & 0xFF] ^ (data_id >> 8)]


def _crc_after(start: int, data: bytes | bytearray) -> int:
    table, c = CRC_TABLE, start
    for byte in data[1:]:
        c = table[c ^ byte]
    return c


def crcs(data: NDArray[np.uint8], start: NDArray[np.uint8] | int, length: NDArray[np.int64] | int) -> NDArray[np.uint8]:
    """CRCs of many frames, (n,), with data (n, m). start: the CRC of their data ids (Checker.start)."""
    out = np.broadcast_to(np.asarray(start, dtype=np.uint8), len(data))
    for k in range(1, min(int(np.max(length, initial=0)), data.shape[1])):
        out = np.where(length > k, _TABLE[out ^ data[:, k]], out)
    return out


def protect(data: bytes | bytearray, data_id: int, counter: int) -> bytes:
    """The frame with counter and CRC written into it."""
    out = bytearray(data)
    out[1] = (out[1] & 0xF0) | counter
    out[0] = crc(out, data_id)
    return bytes(out)


class Checker:
    """Watches one protected message and follows its sender's chain of counters.

    A good CRC with a counter that does not continue the chain is refused, and remembered as a rival's. If the rival
    goes on and the chain does not, the sender has started anew: the chain is the rival's from its second frame on. If
    both go on beside each other, there are two senders, and neither is believed until one has been silent for a whole
    turn of the counter. So a stray frame costs at most one good one; a second sender is suspected at its second frame
    and found at its third.

    Two senders leave no silence: a rival that comes after one of more than 1 + MAX_LOST of its own cycles is the
    chain's sender, of which many frames were lost.
    """

    _last: int | None  # counter of the newest frame of the chain
    _payload: bytes  # that frame
    _candidate: int | None  # counter of the newest frame beside the chain
    _candidate_frames: int  # how many of them continue each other
    _frames_since_candidate: int  # frames of the chain since then
    _moves: int  # grows as the chain moves to the rival, falls as it goes on
    _quarantine_frames: int  # frames for which nobody is believed
    _last_us: int  # when that came
    _candidate_us: int  # when that came

    def __init__(self, data_id: int, others: tuple[int, ...] = ()) -> None:
        self.start, self._others = _of_data_id(data_id), others
        self.reset()

    def reset(self) -> None:
        """Start anew: the next frame's counter is taken as it comes."""
        self._last = None
        self._last_us = 0
        self._payload = b""
        self._candidate = None
        self._candidate_us = 0
        self._candidate_frames = 0
        self._frames_since_candidate = 0
        self._moves = 0
        self._quarantine_frames = 0

    @property
    def suspect(self) -> bool:
        """Whether a rival has gone on beside the chain: perhaps a second sender, perhaps two stray frames."""
        return self._candidate is not None and self._candidate_frames >= CANDIDATE_FRAMES - 1

    @property
    def is_suspicious(self) -> bool:
        """Whether another chain has been seen, or nobody is believed."""
        return self._candidate is not None or self._moves > 0 or self._quarantine_frames > 0

    def goes_on(self, counters: Sequence[int]) -> bool:
        """Whether nothing is suspected and each counter of frames on end continues the chain."""
        if self.is_suspicious or max(counters) >= COUNTER_MODULO:
            return False
        before = counters if self._last is None else [self._last, *counters]
        return all(_continues(a, b) for a, b in itertools.pairwise(before))

    def follow(self, counter: int, data: bytes, stamp_us: int, frames: int) -> None:
        """Take frames on end that go on, the last of them with this counter, data and stamp."""
        self._last, self._payload, self._last_us = counter, data, stamp_us
        self._frames_since_candidate += frames

    def check(self, data: bytes, stamp_us: int = 0) -> Reason | None:
        """None if the frame may be used, else why not. The length has been checked. Without stamps no silence is
        seen."""
        if len(data) < 2 or data[0] != _crc_after(self.start, data):
            return Reason.DATA_ID if any(data[:1] == bytes((crc(data, i),)) for i in self._others) else Reason.CRC
        counter = data[1] & 0x0F
        if counter >= COUNTER_MODULO:
            return Reason.COUNTER
        last = self._last
        if last is None or _continues(last, counter):
            if self.is_suspicious:
                return self._go_on(counter, data, stamp_us)
            self.follow(counter, data, stamp_us, 1)
            return None
        repeated = counter == self._last
        goes_on = self._candidate is not None and _continues(self._candidate, counter)
        if goes_on and self._frames_since_candidate == 0:
            return self._move(counter, data, stamp_us)
        if repeated and data == self._payload:
            return Reason.REPEAT  # a copy says nothing of a second sender
        if not goes_on:
            self._candidate, self._candidate_frames, self._frames_since_candidate = counter, 1, 0
        else:
            self._candidate, self._frames_since_candidate = counter, 0
            self._candidate_frames += 1
            if self._candidate_frames >= CANDIDATE_FRAMES:
                self._quarantine_frames = COUNTER_MODULO
        self._candidate_us = stamp_us
        return Reason.TWO_SENDERS if self._quarantine_frames else Reason.REPEAT if repeated else Reason.COUNTER

    def _go_on(self, counter: int, data: bytes, stamp_us: int) -> Reason | None:
        self.follow(counter, data, stamp_us, 1)
        self._moves = max(self._moves - 1, 0)
        if self._frames_since_candidate > CANDIDATE_FORGOTTEN:
            self._candidate = None
        return self._believed()

    def _move(self, counter: int, data: bytes, stamp_us: int) -> Reason | None:
        """The rival goes on and the chain does not: they change places."""
        assert self._candidate is not None
        silence_us, since_us = self._candidate_us - self._last_us, stamp_us - self._candidate_us
        if silence_us * ((counter - self._candidate) % COUNTER_MODULO) > (1 + MAX_LOST) * since_us:
            self._candidate = None
        else:
            self._candidate, self._candidate_us = self._last, self._last_us
            self._moves += MOVE
            if self._moves > MAX_MOVES * MOVE:
                self._quarantine_frames = COUNTER_MODULO
        self._candidate_frames, self._frames_since_candidate = 1, 0
        self._last, self._payload, self._last_us = counter, data, stamp_us
        return self._believed()

    def _believed(self) -> Reason | None:
        if not self._quarantine_frames:
            return None
        self._quarantine_frames -= 1
        return Reason.TWO_SENDERS


def _continues(last: int, counter: int) -> bool:
    return 1 <= (counter - last) % COUNTER_MODULO <= 1 + MAX_LOST
