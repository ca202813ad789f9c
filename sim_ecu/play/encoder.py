"""The rig's frames: cantools and the autosar-e2e package, independent of the daemon's own codec."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cantools
import e2e.p11
from cantools.database.can import Database, Message

from sim_ecu.resources import TRUTH_DBC
from wrcd import resources

SAMPLE_US = 5_000
# Between the frames of one sample: about the length of a frame at 500 kbit/s. The frames of more than four axles, truth
# included, would last longer than the sample: with those it is that at 1 Mbit/s.
SPACING_US, FAST_SPACING_US = 200, 100
MAX_SLOW_AXLES = 4


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame, and when after the scenario's start it is due."""

    due_us: int
    can_id: int
    data: bytes
    error: bool = False  # an error frame: can_id is its class


def data_id(message: Message) -> int:
    """The E2E data id that the DBC states."""
    assert message.dbc is not None  # it comes from a DBC file
    return int(message.dbc.attributes["E2EDataId"].value)


def protect(data: bytes | bytearray, identity: int) -> bytes:
    """The frame with the CRC that fits it and its counter."""
    out = bytearray(data)
    e2e.p11.e2e_p11_protect(out, identity, increment_counter=False)
    return bytes(out)


class Channel:
    """One cyclic message: encodes, counts its cycles (from a first counter on), protects."""

    def __init__(self, message: Message, counter: int = 0) -> None:
        self._message = message
        self._data_id = data_id(message)
        self._first_counter = counter
        self.every_us = int(message.cycle_time or 0) * 1000
        self.can_id = message.frame_id
        self._limits = {s.name: (float(s.minimum or 0.0), float(s.maximum or 0.0)) for s in message.signals}

    def encode(self, due_us: int, values: dict[str, float]) -> Sent:
        """The next frame. Values beyond the signal's range are sent as its end, as a converter would."""
        held = {k: min(max(v, self._limits[k][0]), self._limits[k][1]) for k, v in values.items()}
        counter = (self._first_counter + due_us // self.every_us - 1) % 15
        data = self._message.encode({"Crc": 0, "Counter": counter, "Status": 0, **held}, strict=False)
        return Sent(due_us, self.can_id, protect(data, self._data_id))


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
class Sample:
    """What all sensors say at the end of a sample, due_us after the scenario's start."""

    due_us: int
    speed_m_s: float
    readings: tuple[Reading, ...]

    def scaled(self, factor: float) -> "Sample":
        """The same with every measured value times a factor."""
        readings = (
            replace(r, yaw_rate=factor * r.yaw_rate, lat_accel=factor * r.lat_accel, torque=factor * r.torque)
            for r in self.readings
        )
        return Sample(self.due_us, factor * self.speed_m_s, tuple(readings))


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

    def frames(self, sample: Sample) -> Iterator[Sent]:
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
