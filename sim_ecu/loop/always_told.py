"""A controller's bus without a daemon, on which somebody says the same adhesion all along: what a lie would cost."""

from collections.abc import Sequence

from sim_ecu.loop.control.controller import Controller
from sim_ecu.play.encoder import COUNTERS, Sent, data_id, databases, protect
from wrcd.core.messages import surface


class AlwaysTold:
    """Hears for a controller what is on the bus, and the lie: Valid, and sure of it to a point."""

    def __init__(self, controller: Controller, axles: Sequence[int], mu_pct: float) -> None:
        self._controller = controller
        self._messages = [databases()[0].get_message_by_name(f"Adhesion_A{n}") for n in axles]
        self._values: dict[str, int | float | str] = {
            "Crc": 0, "Validity": "Valid", "MuAvailable": mu_pct, "MuUsed": 0.0, "SampleAge": 5,
            "Surface": surface(mu_pct), "ContactState": "Adhering",
            "Confidence": "Within1pp",
        }  # fmt: skip

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Pass a frame on."""
        self._controller.hear(can_id, data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """Say it where a frame is due, then let the controller act."""
        for m in self._messages:
            cycle_us = int(m.cycle_time or 0) * 1000
            if now_us % cycle_us == 0:
                data = m.encode({**self._values, "Counter": now_us // cycle_us % COUNTERS})
                self._controller.hear(m.frame_id, protect(data, data_id(m)), now_us)
        return self._controller.tick(now_us)
