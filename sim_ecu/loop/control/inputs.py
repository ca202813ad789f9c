"""What a controller's process tells of its inputs: which are silent, which are heard again, what was not taken."""

from collections.abc import Sequence

from sim_ecu.loop.control.controller import CYCLE_US
from sim_ecu.loop.counted import counted, times
from sim_ecu.loop.messages import Heard, driver_demand, rig_message
from sim_ecu.loop.silence import News, Silence, together


class Inputs:
    """The rig's messages that a controller lives by, each with its time-out. It judges nothing for the controller."""

    def __init__(self, axles: Sequence[int]) -> None:
        names = ["DriverDemand", *(f"{kind}_A{n}" for n in axles for kind in ("WheelSpeed", "BrakePressure"))]
        self._heard = {name: Heard(rig_message(name)) for name in names[1:]}
        self._heard = {names[0]: driver_demand(), **self._heard}
        self._by_id = {h.message.frame_id: h for h in self._heard.values()}
        self._silences = {name: Silence(CYCLE_US) for name in names}
        self._taken = dict.fromkeys(names, 0)

    @property
    def ids(self) -> tuple[int, ...]:
        """Of the messages."""
        return tuple(self._by_id)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus; those of other messages are ignored."""
        heard = self._by_id.get(can_id)
        if heard is not None:
            self._taken[heard.message.name] += heard.take(data, stamp_us)

    def look(self, now_us: int) -> list[str]:
        """The lines of what has fallen silent, or is heard again, in this cycle."""

        def text(news: News, s: Silence) -> str:
            if news in (News.SILENT, News.NONE_YET):
                return "silent" if news is News.SILENT else "not heard yet"
            return f"{'again' if news is News.AGAIN else 'heard'} after {s.lasted_us * 1e-6:.2f} s"

        told = ((name, s, s.look(now_us, not self._heard[name].fresh(now_us))) for name, s in self._silences.items())
        grouped = together(((name, s, news) for name, s, news in told if news is not None), text)
        return [f"{', '.join(names)}: {what}" for what, names in grouped.items()]

    def summary(self) -> list[str]:
        """Lines for a person: what fell silent, frames that were not taken by reason."""
        out = []
        for name, heard in self._heard.items():
            s = self._silences[name]
            what = f"{self._taken[name]} frames" if s.heard else "never came"
            what += f", silent {times(s.silences)}, {s.longest_us * 1e-6:.2f} s the longest" if s.silences else ""
            out.append(f"{name:16} {what}{counted(heard.rejected.counts())}")
        return out
