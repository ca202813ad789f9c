"""What a controller is to whoever runs it: it hears frames, and every 10 ms it says what each axle may have."""

from collections.abc import Sequence
from typing import Protocol

from sim_ecu.loop.messages import BRAKE, TRACTION, driver_demand, rig_message
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
    """Gives the driver what the driver asks: no wheel-slide protection at all.

    Says nothing before it has heard the driver, so that the rig brakes by itself. When the driver falls silent,
    traction ends and a brake stays.
    """

    def __init__(self, axles: Sequence[int], actuators: Actuators) -> None:
        self._a = actuators
        self._driver = driver_demand()
        self._channels = [Channel(rig_message(f"Demand_A{n}")) for n in axles]

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take the driver's demand."""
        if can_id == self._driver.message.frame_id:
            self._driver.take(data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """The same for every axle."""
        if self._driver.stamp_us is None:
            return []
        share, mode, torque = self._driver.values["Share"], self._driver.values["Mode"], 0.0
        if mode == BRAKE:
            torque = -share * self._a.full_brake_N_m
        elif mode == TRACTION and self._driver.fresh(now_us):
            torque = share * self._a.drive.max_traction_N_m
        return [c.encode_quick(now_us, {"Torque": torque, "Valve": Valve.FILL}) for c in self._channels]
