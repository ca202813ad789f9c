"""What the rig's frames say of its sensors, each value until its next usable frame."""

from collections.abc import Iterable
from dataclasses import dataclass

from sim_ecu.loop.fmu.variables import VALID, Variable
from sim_ecu.loop.messages import Heard, rig_message
from sim_ecu.play.encoder import Sent, databases
from sim_ecu.play.train import USABLE_STATUS, end_of_field


@dataclass(slots=True)
class _Sensor:
    """One of them. usable: what its newest good frame says."""

    name: str
    signal: str
    heard: Heard
    usable: bool = False

    def take(self, frame: Sent) -> float | None:
        """Its new value, if there is one."""
        if not self.heard.take(frame.data, frame.due_us):
            return None
        signal = self.heard.message.get_signal_by_name(self.signal)
        value = float(self.heard.values[self.signal])
        raw = round((value - float(signal.offset)) / float(signal.scale))
        self.usable = int(self.heard.values["Status"]) in USABLE_STATUS and raw != end_of_field(signal)
        return value if self.usable else None


class Sensors:
    """Those of an FMU's variables that have a signal."""

    def __init__(self, among: Iterable[Variable]) -> None:
        production = databases()[0]
        names = {m.name for m in production.messages}
        self._by_id: dict[int, _Sensor] = {}
        for v in among:
            if v.signal is not None:
                name, signal = v.signal
                message = production.get_message_by_name(name) if name in names else rig_message(name)
                self._by_id[message.frame_id] = _Sensor(v.name, signal, Heard(message))

    def take(self, frames: Iterable[Sent], now_us: int) -> dict[str, float | bool]:
        """New values after a sample, and of every sensor whether its value may be used."""
        out: dict[str, float | bool] = {}
        for f in frames:
            if f.can_id in self._by_id and not (f.error or f.extended):
                sensor = self._by_id[f.can_id]
                value = sensor.take(f)
                if value is not None:
                    out[sensor.name] = value
        for sensor in self._by_id.values():
            out[sensor.name + VALID] = sensor.usable and sensor.heard.fresh(now_us)
        return out
