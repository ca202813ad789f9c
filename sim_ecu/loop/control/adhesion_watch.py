"""What a controller's process tells of adhesion: on which axle it may be used, and why it may not."""

from collections.abc import Sequence
from dataclasses import dataclass

from sim_ecu.loop.control.consumer import AdhesionReceiver, receiver
from sim_ecu.loop.counted import counted
from sim_ecu.play.adhesion import AdhesionReader
from wrcd.bus.dbc import find_message
from wrcd.core.configuration import Config

EVERY_US = 1_000_000  # of an axle's lines: one at the most
NOTHING_YET = "nothing heard yet"


@dataclass(slots=True)
class _Axle:
    number: int
    can_id: int
    receiver: AdhesionReceiver
    reader: AdhesionReader
    timeout_us: int
    stamp_us: int | None = None
    said: str = ""  # Validity of the newest good frame
    used_cycles: int = 0
    told: str = NOTHING_YET
    told_us: int | None = None


class AdhesionWatch:
    """Hears the adhesion messages of a configuration beside the controller, with a receiver of its own."""

    def __init__(self, config: Config, axles: Sequence[int]) -> None:
        self._axles = []
        self._cycles = 0
        for a in config.axles:
            if a.number in axles:
                message = find_message(config.database, a.adhesion.message)
                self._axles.append(
                    _Axle(
                        a.number, message.frame_id, receiver(config, a), AdhesionReader(message, a.adhesion),
                        3 * a.adhesion.cycle_us,
                    )
                )  # fmt: skip
        self._by_id = {a.can_id: a for a in self._axles}

    @property
    def ids(self) -> tuple[int, ...]:
        """Of the messages."""
        return tuple(self._by_id)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus; those of other messages are ignored."""
        a = self._by_id.get(can_id)
        if a is not None and a.receiver.hear(can_id, data, stamp_us):
            a.stamp_us, a.said = stamp_us, str(a.reader.read(data).get("Validity"))

    def look(self, now_us: int) -> list[str]:
        """The lines of what has changed, at most one a second of each axle."""
        self._cycles += 1
        lines = []
        for a in self._axles:
            why = self._why(a, now_us)
            a.used_cycles += why == ""
            if why != a.told and (a.told_us is None or now_us - a.told_us >= EVERY_US):
                a.told, a.told_us = why, now_us
                lines.append(f"axle {a.number}: adhesion {f'not used: {why}' if why else 'used'}")
        return lines

    def _why(self, a: _Axle, now_us: int) -> str:
        """Why it may not be used; "" where it may."""
        r = a.receiver
        if r.unusable is not None:
            return str(r.unusable)
        if r.adhesion(now_us) is not None:
            return ""
        if a.stamp_us is None:
            return NOTHING_YET
        if now_us - a.stamp_us > a.timeout_us:
            return f"silent for {a.timeout_us // 1000} ms"
        if a.said != "Valid":
            return a.said
        return "frames were dropped, or its values are not for use"

    def summary(self) -> list[str]:
        """Lines for a person: the share of cycles in which it might be used, frames that were not taken by reason."""
        out = []
        for a in self._axles:
            rejected = counted(a.receiver.dropped.counts())
            share = a.used_cycles / max(self._cycles, 1)
            out.append(f"adhesion, axle {a.number}: usable in {share:.0%} of the cycles{rejected}")
        return out
