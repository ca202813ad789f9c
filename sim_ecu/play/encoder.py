"""The rig's frames: signals as cantools reads them from the DBC, CRCs by the autosar-e2e package, independent of the
daemon's own codec.

`Encoder.frames` makes those of one sample; `Encoder.stretch` the same bytes of many samples at once, column by column.
A test compares both with cantools' own encoding.
"""

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cantools
import e2e.p11
import numpy as np
from cantools.database.can import Database, Message
from numpy.typing import NDArray

from sim_ecu.resources import TRUTH_DBC
from wrcd import resources

SAMPLE_US = 5_000
COUNTERS = 15  # of E2E Profile 11: 0 to 14
# Between the frames of one sample: about the length of a frame at 500 kbit/s. The frames of more than four axles, truth
# included, would last longer than the sample: with those it is that at 1 Mbit/s.
SPACING_US, FAST_SPACING_US = 200, 100
MAX_SLOW_AXLES = 4
EXTENDED = 1 << 31  # in a key: the id has 29 bits
MAX_CLASSICAL, FD_LENGTHS = 8, (*range(9), 12, 16, 20, 24, 32, 48, 64)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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


def message_key(message: Message) -> int:
    """Identity of a message: its id, and whether that has 29 bits. Two messages may share a number."""
    return int(message.frame_id) | (EXTENDED if message.is_extended_frame else 0)


def is_fd(message: Message) -> bool:
    """Whether its frames are CAN FD: the DBC says so, or a classical one has no room for it."""
    return bool(message.is_fd) or message.length > MAX_CLASSICAL


def frame_length(message: Message) -> int:
    """Bytes of its frames. CAN FD fills up to the next length that there is."""
    return next(n for n in FD_LENGTHS if n >= message.length) if is_fd(message) else message.length


def data_id(message: Message) -> int:
    """The E2E data id that the DBC states."""
    assert message.dbc is not None  # it comes from a DBC file
    return int(message.dbc.attributes["E2EDataId"].value)


def protect(data: bytes | bytearray, identity: int) -> bytes:
    """The frame with the CRC that fits it and its counter."""
    out = bytearray(data)
    e2e.p11.e2e_p11_protect(out, identity, increment_counter=False)
    return bytes(out)


@functools.cache
def crc_tables(length: int, identity: int) -> tuple[int, NDArray[np.uint8]]:
    """CRC of a frame of zeros, and what each value of each byte changes in it, (length, 256).

    A CRC is affine in the bits of the frame: the changes of single bytes, asked of the autosar-e2e package, add up
    (exclusive or) to that of any frame.
    """
    none = protect(bytes(length), identity)[0]
    changes = np.zeros((length, 256), np.uint8)
    for place, value in itertools.product(range(1, length), range(256)):
        frame = bytearray(length)
        frame[place] = value
        changes[place, value] = protect(frame, identity)[0] ^ none
    return none, changes


class Channel:
    """One cyclic message: encodes, counts its cycles (from a first counter on), protects. Values beyond the signal's
    range are sent as its end, as a converter would."""

    def __init__(self, message: Message, counter: int = 0) -> None:
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

    @functools.cached_property
    def _crc(self) -> tuple[int, list[list[int]]]:
        none, changes = crc_tables(self._length, self._data_id)
        return none, changes.tolist()

    def encode(self, due_us: int, values: dict[str, float]) -> Sent:
        """Return the next frame, the bytes that cantools and the autosar-e2e package make, in a fifth of their time."""
        bits = ((self._first_counter + due_us // self.every_us - 1) % COUNTERS) << self._counter_bit
        for name, value in values.items():
            low, high, offset, scale, mask, start = self._signals[name]
            bits |= (round((min(max(value, low), high) - offset) / scale) & mask) << start
        data = bits.to_bytes(self._length, "little")
        crc, table = self._crc  # of the CRC's own byte nothing changes
        for changes, byte in zip(table, data, strict=True):
            crc ^= changes[byte]
        return Sent(due_us, self.can_id, bytes((crc,)) + data[1:])

    def encode_all(self, due_us: IntArray, values: dict[str, FloatArray]) -> list[Sent]:
        """The same of frames due at increasing times (n,), from values (n,) of each signal."""
        length = self._length
        counters = (self._first_counter + due_us // self.every_us - 1) % COUNTERS
        bits = counters.astype(np.uint64) << np.uint64(self._counter_bit)
        for name, of in values.items():
            low, high, offset, scale, mask, start = self._signals[name]
            raw = np.rint((np.minimum(np.maximum(of, low), high) - offset) / scale).astype(np.int64)
            bits |= (raw.astype(np.uint64) & np.uint64(mask)) << np.uint64(start)
        data = bits.astype("<u8").view(np.uint8).reshape(-1, 8)[:, :length].copy()
        crc, changes = crc_tables(length, self._data_id)
        for place in range(1, length):
            data[:, 0] ^= changes[place, data[:, place]]
        data[:, 0] ^= crc
        packed, ends = data.tobytes(), range(length, length * len(data) + 1, length)
        return [Sent(t, self.can_id, packed[end - length : end]) for t, end in zip(due_us.tolist(), ends, strict=True)]


@functools.cache
def databases() -> tuple[Database, Database]:
    """The production DBC and the rig's own."""
    both = [cantools.database.load_file(p, strict=True) for p in (resources.DBC, TRUTH_DBC)]
    assert isinstance(both[0], Database)
    assert isinstance(both[1], Database)
    return both[0], both[1]


@dataclass(frozen=True, slots=True)
class Reading:
    """What one axle's sensors say at the end of a sample, and what is true."""

    number: int
    yaw_rate: float
    lat_accel: float
    torque: float
    mu_available_pct: float
    mu_used_pct: float
    slip: float


@dataclass(frozen=True, slots=True)
class SensorSample:
    """What all sensors say at the end of a sample, due_us after the scenario's start."""

    due_us: int
    speed_m_s: float
    readings: tuple[Reading, ...]

    def scaled(self, factor: float) -> "SensorSample":
        """The same with every measured value times a factor."""
        readings = (
            replace(r, yaw_rate=factor * r.yaw_rate, lat_accel=factor * r.lat_accel, torque=factor * r.torque)
            for r in self.readings
        )
        return SensorSample(self.due_us, factor * self.speed_m_s, tuple(readings))


class EncodedStretch(NamedTuple):
    """Successive samples as columns."""

    numbers: tuple[int, ...]  # of the axles
    due_us: IntArray  # (n,)
    speed_m_s: FloatArray  # (n,)
    readings: FloatArray  # (n, axles, 6), in the order of a Reading's fields

    def samples(self) -> Iterator[SensorSample]:
        """One by one."""
        for due_us, speed, rows in zip(
            self.due_us.tolist(), self.speed_m_s.tolist(), self.readings.tolist(), strict=True
        ):
            yield SensorSample(due_us, speed, tuple(Reading(n, *r) for n, r in zip(self.numbers, rows, strict=True)))


def stretch_of(samples: Sequence[SensorSample]) -> EncodedStretch:
    """Samples of the same axles, one at least, as columns."""
    rows = [
        [(r.yaw_rate, r.lat_accel, r.torque, r.mu_available_pct, r.mu_used_pct, r.slip) for r in s.readings]
        for s in samples
    ]
    due_us, speed = np.array([s.due_us for s in samples]), np.array([s.speed_m_s for s in samples])
    return EncodedStretch(tuple(r.number for r in samples[0].readings), due_us, speed, np.array(rows))


class Encoder:
    """All frames of a train of axles, sample by sample. Their counters begin at `counter`."""

    def __init__(self, numbers: list[int], truth: bool = True, counter: int = 0) -> None:
        production, rig = databases()
        get = production.get_message_by_name
        self._yaw = {n: Channel(get(f"YawRate_A{n}"), counter) for n in numbers}
        self._lat = {n: Channel(get(f"LatAccel_A{n}"), counter) for n in numbers}
        self._torque = {n: Channel(get(f"Torque_A{n}"), counter) for n in numbers}
        self._truth = {n: Channel(rig.get_message_by_name(f"SimTruth_A{n}")) for n in numbers} if truth else {}
        self._speed = Channel(get("VehicleSpeed"), counter)
        self._spacing_us = SPACING_US if len(numbers) <= MAX_SLOW_AXLES else FAST_SPACING_US

    def frames(self, sample: SensorSample) -> Iterator[Sent]:
        """The frames of a sample, each message at its own cycle."""
        at = due_us = sample.due_us
        for r in sample.readings:
            parts = [
                (self._yaw[r.number], {"YawRate": r.yaw_rate}),
                (self._lat[r.number], {"LatAccel": r.lat_accel}),
                (self._torque[r.number], {"Torque": r.torque}),
            ]
            if self._truth:
                true = {"MuAvailable": r.mu_available_pct, "MuUsed": r.mu_used_pct, "Slip": r.slip}
                parts.append((self._truth[r.number], true))
            for channel, values in parts:
                if due_us % channel.every_us == 0:
                    yield channel.encode(at, values)
                    at += self._spacing_us
        if due_us % self._speed.every_us == 0:
            yield self._speed.encode(at, {"Speed": sample.speed_m_s})

    def stretch(self, s: EncodedStretch) -> list[list[Sent]]:
        """The frames of each sample, as `frames` makes them."""
        parts: list[tuple[Channel, dict[str, FloatArray]]] = []
        for n, (yaw, lat, torque, available, used, slip) in zip(s.numbers, s.readings.transpose(1, 2, 0), strict=True):
            parts += [(self._yaw[n], {"YawRate": yaw}), (self._lat[n], {"LatAccel": lat})]
            parts.append((self._torque[n], {"Torque": torque}))
            if self._truth:
                parts.append((self._truth[n], {"MuAvailable": available, "MuUsed": used, "Slip": slip}))
        parts.append((self._speed, {"Speed": s.speed_m_s}))
        out: list[list[Sent]] = [[] for _ in s.due_us]
        at = s.due_us.copy()
        for channel, values in parts:
            places = np.flatnonzero(s.due_us % channel.every_us == 0)
            found = channel.encode_all(at[places], {name: v[places] for name, v in values.items()})
            for place, frame in zip(places.tolist(), found, strict=True):
                out[place].append(frame)
            at[places] += self._spacing_us
        return out
