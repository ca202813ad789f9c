"""The rig's frames: cantools and the autosar-e2e package, independent of the daemon's own codec."""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import cantools
import e2e.p11
from cantools.database.can import Database, Message

from sim_ecu.resources import TRUTH_DBC
from wrcd import resources

SPACING_US = 200  # between the frames of one sample: about the length of a frame at 500 kbit/s


@dataclass(frozen=True, slots=True)
class Sent:
    """A frame, and when after the scenario's start it is due."""

    due_us: int
    can_id: int
    data: bytes


class Channel:
    """One cyclic message: encodes, counts, protects."""

    def __init__(self, message: Message) -> None:
        self._message = message
        assert message.dbc is not None  # it comes from a DBC file
        self._data_id = int(message.dbc.attributes["E2EDataId"].value)
        self._counter = 0
        self.every_us = int(message.cycle_time or 0) * 1000
        self.can_id = message.frame_id
        self._limits = {s.name: (float(s.minimum or 0.0), float(s.maximum or 0.0)) for s in message.signals}

    def encode(self, due_us: int, values: dict[str, float]) -> Sent:
        """The next frame. Values beyond the signal's range are sent as its end, as a converter would."""
        held = {k: min(max(v, self._limits[k][0]), self._limits[k][1]) for k, v in values.items()}
        data = bytearray(self._message.encode({"Crc": 0, "Counter": self._counter, "Status": 0, **held}, strict=False))
        e2e.p11.e2e_p11_protect(data, self._data_id, increment_counter=False)
        self._counter = (self._counter + 1) % 15
        return Sent(due_us, self.can_id, bytes(data))


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


class Encoder:
    """All frames of a train of axles, sample by sample."""

    def __init__(self, numbers: list[int], truth: bool = True) -> None:
        production, rig = databases()
        get = production.get_message_by_name
        self._yaw = {n: Channel(get(f"YawRate_A{n}")) for n in numbers}
        self._lat = {n: Channel(get(f"LatAccel_A{n}")) for n in numbers}
        self._torque = {n: Channel(get(f"Torque_A{n}")) for n in numbers}
        self._truth = {n: Channel(rig.get_message_by_name(f"SimTruth_A{n}")) for n in numbers} if truth else {}
        self._speed = Channel(get("VehicleSpeed"))

    def frames(self, due_us: int, speed_m_s: float, readings: list[Reading]) -> Iterator[Sent]:
        """The frames of the sample that ends at due_us, each message at its own cycle."""
        at = due_us
        for r in readings:
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
                    at += SPACING_US
        if due_us % self._speed.every_us == 0:
            yield self._speed.encode(at, {"Speed": speed_m_s})
