"""Frames of one axle's sensors for a core on a virtual clock."""

import struct
from collections.abc import Iterable
from typing import Any

from tests.support.can_ids import LAT_ACCEL_A1, TORQUE_A1, VEHICLE_SPEED, YAW_RATE_A1
from tests.support.signals import measured
from wrcd.bus.dbc import find_message
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing

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

    def run(self, ms: int) -> list[dict[str, Any]]:
        """Simulate so many milliseconds. Return the decoded Adhesion_A1 frames of that time."""
        first = len(self.out)
        for _ in range(ms // 5):
            for frame in self.frames():
                self.out += self.core.feed(frame)
            self.out += self.core.advance(self.t)
        return self.adhesion(self.out[first:])

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

    def _decode(self, out: Iterable[Outgoing], name: str) -> list[dict[str, Any]]:
        """Values by signal; a value with a label is its label, as a string."""
        message = find_message(self.config.database, name)
        rows: list[Any] = [message.decode(o.frame.data) for o in out if o.frame.can_id == message.frame_id]
        return [{k: str(v) if hasattr(v, "name") else v for k, v in row.items()} for row in rows]


def validities(frames: list[dict[str, Any]]) -> list[str]:
    """Return the Validity of each run of frames with the same one."""
    out: list[str] = []
    for f in frames:
        if not out or out[-1] != f["Validity"]:
            out.append(f["Validity"])
    return out
