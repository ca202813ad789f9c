"""The rig's frames: signals as cantools reads them from the DBC, CRCs by the autosar-e2e package, independent of the
daemon's own codec.

A test compares them with cantools' own encoding.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import e2e.p11
import numpy as np
from numpy.typing import NDArray

from sim_ecu.resources import TRUTH_DBC
from wrcd import resources

if TYPE_CHECKING:
    from cantools.database.can import Database, Message

SAMPLE_US = 5_000
COUNTERS = 15  # of E2E Profile 11: 0 to 14
# Between the frames of one sample: about the length of a frame at 500 kbit/s. The frames of more than four axles, truth
# included, would last longer than the sample: with those it is that at 1 Mbit/s.
SPACING_US, FAST_SPACING_US = 200, 100
MAX_SLOW_AXLES = 4
EXTENDED = 1 << 31  # in a key: the id has 29 bits
# Classical frames one behind the other, as a batch of the daemon has them; the flags stay 0.
FRAMES = np.dtype([("due_us", "<i8"), ("can_id", "<u4"), ("length", "u1"), ("flags", "u1"), ("reserved", "<u2"),
                   ("data", "u1", (8,))])  # fmt: skip
MAX_CLASSICAL, FD_LENGTHS = 8, (*range(9), 12, 16, 20, 24, 32, 48, 64)


class Sent(NamedTuple):
    """A frame, and when after the scenario's start it is due."""

    due_us: int
    can_id: int
    data: bytes
    error: bool = False  # an error frame: can_id is its class
    extended: bool = False
    fd: bool = False

    @property
    def key(self) -> int:
        """Identity of its message, as message_key()."""
        return self.can_id | EXTENDED if self.extended else self.can_id


def message_key(message: "Message") -> int:
    """Identity of a message: its id, and whether that has 29 bits. Two messages may share a number."""
    return int(message.frame_id) | (EXTENDED if message.is_extended_frame else 0)


def is_fd(message: "Message") -> bool:
    """Return whether its frames are CAN FD: by the DBC, or because a classical one has no room for it."""
    return bool(message.is_fd) or message.length > MAX_CLASSICAL


def frame_length(message: "Message") -> int:
    """Bytes of its frames. CAN FD fills up to the next length that there is."""
    return next(n for n in FD_LENGTHS if n >= message.length) if is_fd(message) else message.length


def data_id(message: "Message") -> int:
    """The E2E data id that the DBC states."""
    assert message.dbc is not None  # it comes from a DBC file
    return int(message.dbc.attributes["E2EDataId"].value)


def protect(data: bytes | bytearray, identity: int) -> bytes:
    """The frame with the CRC that fits it and its counter."""
    out = bytearray(data)
    e2e.p11.e2e_p11_protect(out, identity, increment_counter=False)
    return bytes(out)


_PROTECTION, _MEASURED = ("Crc", "Counter", "Status"), ("YawRate", "LatAccel", "Torque")


class Channel:
    """One cyclic message: encodes, counts its cycles (from a first counter on), protects. Values beyond the signal's
    range are sent as its end, as a converter would."""

    def __init__(self, message: "Message", counter: int = 0) -> None:
        assert all(s.byte_order == "little_endian" and not s.conversion.is_float for s in message.signals)
        self._data_id, self._length, self._first_counter = data_id(message), message.length, counter
        self.every_us = int(message.cycle_time or 0) * 1000
        self.can_id = message.frame_id
        self._counter_bit = message.get_signal_by_name("Counter").start
        # by signal: lowest and highest value, offset, scale, mask, first bit
        self._signals = {
            s.name: (
                float(s.minimum or 0.0), float(s.maximum or 0.0), float(s.offset), float(s.scale),
                (1 << s.length) - 1, s.start,
            )
            for s in message.signals
        }  # fmt: skip

    def encode(self, due_us: int, values: dict[str, float]) -> Sent:
        """Return the next frame, the bytes that cantools and the autosar-e2e package make."""
        bits = ((self._first_counter + due_us // self.every_us - 1) % COUNTERS) << self._counter_bit
        for name, value in values.items():
            low, high, offset, scale, mask, start = self._signals[name]
            bits |= (round((min(max(value, low), high) - offset) / scale) & mask) << start
        return Sent(due_us, self.can_id, protect(bits.to_bytes(self._length, "little"), self._data_id))

    def encode_all(self, due_us: NDArray[np.int64], values: NDArray[np.float64]) -> NDArray[Any]:
        """Return the frames (n,) of a message of one signal, FRAMES, byte for byte those of encode."""
        low, high, offset, scale, mask, start = next(
            of for name, of in self._signals.items() if name not in _PROTECTION
        )
        raw = np.rint((np.clip(values, low, high) - offset) / scale).astype(np.int64) & mask
        bits = ((self._first_counter + due_us // self.every_us - 1) % COUNTERS) << self._counter_bit | raw << start
        out = np.zeros(len(due_us), FRAMES)
        out["can_id"], out["length"] = self.can_id, self._length
        bare = bits.astype("<i8").view(np.uint8).reshape(-1, 8)[:, : self._length]
        both = b"".join(protect(row, self._data_id) for row in map(bytes, bare))
        out["data"][:, : self._length] = np.frombuffer(both, np.uint8).reshape(-1, self._length)
        return out


@functools.cache
def databases() -> "tuple[Database, Database]":
    """The production DBC and the rig's own."""
    import cantools  # and with it python-can and what reads its logs: a second, and not every command needs it

    both = [cantools.database.load_file(p, strict=True) for p in (resources.DBC, TRUTH_DBC)]
    assert isinstance(both[0], cantools.database.Database)
    assert isinstance(both[1], cantools.database.Database)
    return both[0], both[1]


@dataclass(frozen=True, slots=True)
class Reading:
    """What one axle's sensors measure at the end of a sample, and what is true."""

    number: int
    yaw_rate: float
    lat_accel: float
    torque: float
    mu_available_pct: float
    mu_used_pct: float
    slip: float

    @property
    def truth(self) -> dict[str, float]:
        """Signals of SimTruth."""
        return {"MuAvailable": self.mu_available_pct, "MuUsed": self.mu_used_pct, "Slip": self.slip}


@dataclass(frozen=True, slots=True)
class SensorSample:
    """What all sensors measure at the end of a sample, due_us after the scenario's start."""

    due_us: int
    speed_m_s: float
    readings: tuple[Reading, ...]

    def scaled(self, factor: float) -> "SensorSample":
        """Return the sample with every measured value times a factor."""
        readings = (
            replace(r, yaw_rate=factor * r.yaw_rate, lat_accel=factor * r.lat_accel, torque=factor * r.torque)
            for r in self.readings
        )
        return SensorSample(self.due_us, factor * self.speed_m_s, tuple(readings))


class Encoder:
    """All frames of a train of axles, sample by sample. Their counters begin at `counter`."""

    def __init__(self, numbers: list[int], truth: bool = True, counter: int = 0) -> None:
        production, rig = databases()
        get = production.get_message_by_name
        self._own = {n: [Channel(get(f"{name}_A{n}"), counter) for name in _MEASURED] for n in numbers}
        for n in numbers if truth else ():
            self._own[n].append(Channel(rig.get_message_by_name(f"SimTruth_A{n}")))
        self._speed = Channel(get("VehicleSpeed"), counter)
        self._spacing_us = SPACING_US if len(numbers) <= MAX_SLOW_AXLES else FAST_SPACING_US

    def frames(self, sample: SensorSample) -> Iterator[Sent]:
        """The frames of a sample, each message at its own cycle."""
        at = due_us = sample.due_us
        for r in sample.readings:
            every = ({"YawRate": r.yaw_rate}, {"LatAccel": r.lat_accel}, {"Torque": r.torque}, r.truth)
            for channel, values in zip(self._own[r.number], every, strict=False):  # the truth may be left out
                if due_us % channel.every_us == 0:
                    yield channel.encode(at, values)
                    at += self._spacing_us
        if due_us % self._speed.every_us == 0:
            yield self._speed.encode(at, {"Speed": sample.speed_m_s})

    def frames_of(
        self, due_us: NDArray[np.int64], speed_m_s: NDArray[np.float64], readings: NDArray[np.float64]
    ) -> NDArray[Any]:
        """Return all frames of samples (n,) at once, FRAMES, in their order, in less time. readings (n, axles, 6) has
        the columns of a Reading. Raises ValueError for an encoder of the truth."""
        parts, after_us = [], np.zeros_like(due_us)
        columns = [(c, readings[:, k, j]) for k, own in enumerate(self._own.values()) for j, c in enumerate(own)]
        if any(len(own) > len(_MEASURED) for own in self._own.values()):
            raise ValueError("the truth has several signals in a message")
        for channel, values in (*columns, (self._speed, speed_m_s)):
            use = due_us % channel.every_us == 0
            part = channel.encode_all(due_us[use], values[use])
            part["due_us"] = (due_us + after_us)[use]
            after_us += self._spacing_us * use
            parts.append(part)
        every = np.concatenate(parts)
        return every[np.argsort(every["due_us"], kind="stable")]
