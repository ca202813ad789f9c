"""Frames of one axle's sensors for a core on a virtual clock."""

import struct
from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any

from tests.support.can_ids import LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED, YAW_RATE_A1
from tests.support.signals import measured
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.reports import Outgoing

START_US = 1_700_000_000_000_000
MS = 1000  # in µs


class SensorSimulator:
    """Feed a core with frames of axle 1 in steady motion, 1 ms after each tick begins, and collect what it sends."""

    def __init__(self, config: Config) -> None:
        self.core = Core(config)
        self.config = config
        self.t = START_US
        self.counter = 0
        self.silent: set[int] = set()  # ids that are not sent
        self.speed = 25.0
        self.torque = 10_000.0
        self.yaw_status = 0
        self.frozen = False  # the yaw rate does not change
        self.spike = 0  # on top of the yaw rate, in 1e-6 rad/s
        self.out: list[Outgoing] = []

    def frame(self, can_id: int, payload: bytes, status: int = 0) -> Frame:
        """Return a protected frame with the present counter."""
        data = protect(bytes([0, status << 4]) + payload, can_id, self.counter % 15)
        return Frame(self.t + 1000, can_id, data)

    def run(self, ms: int, spoil: Callable[[list[Frame]], Iterable[Frame]] = list) -> list[dict[str, Any]]:
        """Simulate so many milliseconds. Return the decoded Adhesion_A1 frames of that time. spoil makes of each tick's
        frames those that come."""
        first = len(self.out)
        for _ in range(ms // 5):
            for frame in spoil(self.frames()):
                self.out += self.core.feed(frame)
            self.out += self.core.advance(self.t)
        return self.adhesion(self.out[first:])

    def during(self, ms: int, spoil: Callable[[list[Frame]], Iterable[Frame]] = list, **changed: Any) -> list[Any]:
        """Simulate so long with some attributes changed, which are then as before. Return as run does."""
        before = {name: getattr(self, name) for name in changed}
        for name, value in changed.items():
            setattr(self, name, value)
        frames = self.run(ms, spoil)
        for name, value in before.items():
            setattr(self, name, value)
        return frames

    def frames(self) -> list[Frame]:
        """Return one tick's frames except the silent ones, and move time on by the tick."""
        z = measured()
        yaw_rate, lat_accel = z[self.counter % len(z)]
        yaw = 600 if self.frozen else round(yaw_rate * 1e6) + self.spike
        every = [
            self.frame(YAW_RATE_A1, struct.pack("<i", yaw)[:3], self.yaw_status),
            self.frame(LAT_ACCEL_A1, struct.pack("<i", round(lat_accel * 1e5))[:3]),
            self.frame(TORQUE_A1, struct.pack("<i", round(self.torque * 100))[:3]),
            self.frame(VEHICLE_SPEED, struct.pack("<H", round(self.speed / 0.0025))),
        ]
        self.counter += 1
        self.t += 5000
        return [f for f in every if f.can_id not in self.silent]

    def adhesion(self, out: Iterable[Outgoing], axle: int = 1) -> list[dict[str, Any]]:
        """Decode an axle's Adhesion frames among these."""
        return self._decode(out, f"Adhesion_A{axle}")

    def decoded(self, name: str) -> list[dict[str, Any]]:
        """Decode all frames of a message that were sent so far."""
        return self._decode(self.out, name)

    def causes(self) -> list[str]:
        """Runs of equal causes in AdhesionDetail_A1."""
        return [cause for cause, _ in groupby(str(row["Cause"]) for row in self.decoded("AdhesionDetail_A1"))]

    def _decode(self, out: Iterable[Outgoing], name: str) -> list[dict[str, Any]]:
        """Values by signal; a value with a label is its label, as a string."""
        message = find_message(self.config.database, name)
        rows: list[Any] = [message.decode(o.frame.data) for o in out if o.frame.can_id == message.frame_id]
        return [{k: str(v) if hasattr(v, "name") else v for k, v in row.items()} for row in rows]


def beside(frames: list[Frame], behind: int, can_id: int, raw: int) -> list[Frame]:
    """A tick's frames, and behind that of one id a protected one of another with a raw value of 24 bits."""
    out = []
    for f in frames:
        out.append(f)
        if f.can_id == behind:
            data = protect(b"\0\0" + struct.pack("<i", raw)[:3], can_id, f.data[1] & 0x0F)
            out.append(Frame(f.stamp_us, can_id, data))
    return out


def validities(frames: list[dict[str, Any]]) -> list[str]:
    """Return the Validity of each run of frames with the same one."""
    return [validity for validity, _ in groupby(f["Validity"] for f in frames)]


def until_ms(frames: list[dict[str, Any]], validity: str) -> int:
    """Return how long it takes to the first Adhesion frame of a Validity, that one's cycle included."""
    return 20 * next(k for k, f in enumerate(frames, 1) if f["Validity"] == validity)
