"""What a controller is to whoever runs it: it hears frames, and every 10 ms it says what each axle may have."""

from collections.abc import Sequence
from typing import Protocol

from sim_ecu.loop.messages import Heard, rig_message
from sim_ecu.physics.actuators import Actuators, Valve
from sim_ecu.play.encoder import Channel, Sent

CYCLE_US = 10_000


class Controller(Protocol):
    """Pure: no clock, no bus."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def tick(self, now_us: int) -> list[Sent]:
        """The Demand frames of a cycle; now_us is a multiple of CYCLE_US."""


class Unprotected:
    """Gives the driver what the driver asks: no wheel-slide protection at all."""

    def __init__(self, axles: Sequence[int], actuators: Actuators) -> None:
        self._a = actuators
        self._driver = Heard(rig_message("DriverDemand"))
        self._channels = [Channel(rig_message(f"Demand_A{n}")) for n in axles]

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take the driver's demand."""
        if can_id == self._driver.message.frame_id:
            self._driver.take(data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """The same for every axle."""
        share, mode = self._driver.values.get("Share", 0.0), self._driver.values.get("Mode", 0)
        torque = {0: 0.0, 1: share * self._a.drive.max_traction_N_m}.get(mode, -share * self._a.full_brake_N_m)
        return [c.encode_quick(now_us, {"Torque": torque, "Valve": Valve.FILL}) for c in self._channels]
