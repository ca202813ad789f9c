"""The loop's frames: laid out as cantools reads the DBC, checked as a careful receiver does."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import e2e.p11
from cantools.database.can import Message

from sim_ecu.play.encoder import COUNTERS, data_id, databases

COAST, TRACTION, BRAKE = MODES = range(3)  # DriverDemand's Mode; another one is none


def driver_demand() -> "Heard":
    """DriverDemand; a frame of an unknown Mode is not taken."""
    return Heard(rig_message("DriverDemand"), known={"Mode": MODES})


def rig_message(name: str) -> Message:
    """A message of the rig's own DBC."""
    return databases()[1].get_message_by_name(name)


@dataclass(slots=True)
class Rejected:
    """Frames that were not taken, by reason."""

    length: int = 0
    crc: int = 0
    repeated: int = 0
    counter: int = 0
    value: int = 0

    def counts(self) -> dict[str, int]:
        """By reason; values only where there were some: few messages have any that are not known."""
        counts = {"length": self.length, "CRC": self.crc, "repeated": self.repeated, "counter": self.counter}
        return counts | ({"unknown value": self.value} if self.value else {})


@dataclass(slots=True)
class Heard:
    """The newest good frame of a message. Raw values are physical; enumerations stay numbers.

    known: the values that signals may have; a frame with another one is not taken.
    """

    message: Message
    values: dict[str, Any] = field(default_factory=dict)
    stamp_us: int | None = None
    rejected: Rejected = field(default_factory=Rejected)
    known: Mapping[str, Collection[float]] = field(default_factory=dict)
    _counter: int = -1
    _id: int = 0
    timeout_us: int = 0  # as the DBC says

    _fields: list[tuple[str, int, int, int, float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._id = data_id(self.message)
        signal = self.message.signals[0]
        assert signal.dbc is not None
        self.timeout_us = int(signal.dbc.attributes["GenSigTimeoutTime"].value) * 1000
        for s in self.message.signals:
            assert s.byte_order == "little_endian"
            assert not s.conversion.is_float
            sign = 1 << s.length - 1 if s.is_signed else 0
            self._fields.append((s.name, s.start, (1 << s.length) - 1, sign, s.scale, s.offset))

    def take(self, data: bytes, stamp_us: int) -> bool:
        """Whether a frame is good. One that is not changes counts and, if its E2E passes, the counter expected next."""
        if len(data) != self.message.length:
            self.rejected.length += 1
            return False
        if not e2e.p11.e2e_p11_check(bytearray(data), self._id):
            self.rejected.crc += 1
            return False
        counter = data[1] & 0x0F
        fresh = self.fresh(stamp_us)
        if fresh and counter == self._counter:
            self.rejected.repeated += 1
            return False
        # up to two frames may be lost within the time-out
        if fresh and (counter - self._counter) % COUNTERS > 3:
            self.rejected.counter += 1
            self._counter = counter  # the sequence is taken again from the next that follows
            return False
        self._counter = counter
        bits = int.from_bytes(data, "little")
        values = {
            name: (((bits >> start & mask) ^ sign) - sign) * scale + offset
            for name, start, mask, sign, scale, offset in self._fields
        }
        if any(values[name] not in known for name, known in self.known.items()):
            self.rejected.value += 1
            return False
        self.values, self.stamp_us = values, stamp_us
        return True

    def fresh(self, now_us: int) -> bool:
        """Whether the newest good frame is within its time-out."""
        return self.stamp_us is not None and now_us - self.stamp_us <= self.timeout_us
