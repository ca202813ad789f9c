"""The careful receiver of a train's advice: what docs/reference/what-a-controller-does.md demands of one."""

from sim_ecu.loop.rig_messages import ProtectedFrames
from sim_ecu.play.train import AdhesionReader
from wrcd.bus.dbc import find_message
from wrcd.core.configuration import Config
from wrcd.errors import InputError

TIMEOUT_CYCLES = 3
NEEDED = ("Validity", "Deceleration", "DecelerationLow")


class AdviceReceiver(ProtectedFrames):
    """Follows a configuration's AdhesionAdvice. valid: lower end and deceleration (m/s2) of the newest good frame, if
    that is Valid. Raises InputError where the configuration sends none, or lacks what a driver needs of it."""

    def __init__(self, config: Config) -> None:
        advice = config.advice
        if advice is None:
            raise InputError("the configuration has no [advice]: nothing for a driver", hint="write [advice] in it")
        missing = [name for name in NEEDED if name not in advice.output.signals]
        if missing or advice.output.data_id is None:
            what = f"lacks {', '.join(missing)}" if missing else "is not under E2E"
            raise InputError(f"the message {advice.output.message} {what}: no base for a driver", key="advice")
        message = find_message(config.database, advice.output.message)
        super().__init__(message.length, advice.output.data_id, TIMEOUT_CYCLES * advice.output.cycle_us)
        self.can_id = message.frame_id
        self._reader = AdhesionReader(message, advice.output, "advice")
        self.valid: tuple[float, float] | None = None

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> bool:
        """Take a frame from the bus; True if it is a good one of this message."""
        if can_id != self.can_id or not self.check(data, stamp_us):
            return False
        self.stamp_us = stamp_us
        values = self._reader.read(data)
        low, middle = values.get("DecelerationLow"), values.get("Deceleration")
        self.valid = None
        if values.get("Validity") == "Valid" and isinstance(low, float) and isinstance(middle, float):
            self.valid = low, middle
        return True
