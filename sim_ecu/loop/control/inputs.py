"""What a controller's process tells of its inputs: which are silent, which are heard again, what was not taken."""

from collections.abc import Sequence

from sim_ecu.loop.counted import counted, times
from sim_ecu.loop.messages import Heard, rig_message


class Inputs:
    """The rig's messages that a controller lives by, each with its time-out. It judges nothing for the controller."""

    def __init__(self, axles: Sequence[int]) -> None:
        names = ["DriverDemand", *(f"{kind}_A{n}" for n in axles for kind in ("WheelSpeed", "BrakePressure"))]
        self._heard = {name: Heard(rig_message(name)) for name in names}
        self._by_id = {h.message.frame_id: h for h in self._heard.values()}
        self._silent = dict.fromkeys(names, True)
        self._since_us = dict.fromkeys(names, 0)
        self._taken = dict.fromkeys(names, 0)
        self._silences = dict.fromkeys(names, 0)

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
        """The lines of what has fallen silent, or is heard again, since the last look."""
        fallen, back = [], dict[str, list[str]]()
        for name, heard in self._heard.items():
            silent = not heard.fresh(now_us)
            if silent == self._silent[name]:
                continue
            if silent:
                fallen.append(name)
                self._silences[name] += 1
            else:
                again = "again" if self._silences[name] else "heard"
                back.setdefault(f"{again} after {(now_us - self._since_us[name]) * 1e-6:.1f} s", []).append(name)
            self._silent[name], self._since_us[name] = silent, now_us
        lines = [f"silent: {', '.join(fallen)}"] if fallen else []
        return lines + [f"{', '.join(names)} {what}" for what, names in back.items()]

    def summary(self) -> list[str]:
        """Lines for a person: what fell silent, frames that were not taken by reason."""
        out = []
        for name, heard in self._heard.items():
            silences = self._silences[name]
            what = "never came" if not self._taken[name] else f"{self._taken[name]} frames"
            what += f", silent {times(silences)}" if silences else ""
            out.append(f"{name:16} {what}{counted(heard.rejected.counts())}")
        return out
