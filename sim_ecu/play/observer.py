"""A third party on the demo's bus: writes the log, and decodes what anyone could decode, by cantools alone."""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import can

from sim_ecu.play.encoder import databases, message_key
from sim_ecu.play.pace import Clock
from sim_ecu.play.train import AdhesionReader, MessageValues
from wrcd.bus.candump import format_line
from wrcd.bus.dbc import Message, find_message
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config


@dataclass(slots=True)
class ObservedTrace:
    """One axle as seen on the bus: rows of (time, what a frame says)."""

    truth: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    adhesion: list[tuple[float, MessageValues]] = field(default_factory=list)


class BusObserver:
    """Takes every frame. Times are seconds from the first one."""

    def __init__(
        self, bus: can.BusABC, log: Path, channel: str, config: Config, numbers: list[int], clock: Clock = time
    ) -> None:
        self._clock = clock
        _, rig = databases()
        self._bus, self._channel = bus, channel
        self._file = log.open("w", encoding="ascii")
        self.traces = {n: ObservedTrace() for n in numbers}
        outputs = {a.number: a.adhesion for a in config.axles}
        self._truth: dict[int, tuple[Message, ObservedTrace]] = {}
        self._adhesion: dict[int, tuple[AdhesionReader, ObservedTrace]] = {}
        for n, trace in self.traces.items():
            truth = rig.get_message_by_name(f"SimTruth_A{n}")
            self._truth[message_key(truth)] = truth, trace
            message = find_message(config.database, outputs[n].message)
            self._adhesion[message_key(message)] = AdhesionReader(message, outputs[n]), trace
        self.first_s: float | None = None  # since 1970: the first frame

    def drain(self) -> None:
        """Take all that is on the bus."""
        while (m := self._bus.recv(0.0)) is not None:
            # the virtual bus stamps by the computer's time what the daemon sends, which may be ahead of the demo's
            stamp_us = min(round(m.timestamp * 1e6), self._clock.time_ns() // 1000)
            frame = Frame(
                stamp_us, m.arbitration_id, bytes(m.data), extended=m.is_extended_id,
                remote=m.is_remote_frame, error=m.is_error_frame, fd=m.is_fd,
            )  # fmt: skip
            self._file.write(format_line(frame, self._channel) + "\n")
            self.first_s = stamp_us * 1e-6 if self.first_s is None else self.first_s
            t = stamp_us * 1e-6 - self.first_s
            if (truth := self._truth.get(frame.key)) is not None:
                true: Any = truth[0].decode(frame.data)
                truth[1].truth.append((t, true))
            elif (adhesion := self._adhesion.get(frame.key)) is not None:
                adhesion[1].adhesion.append((t, adhesion[0].read(frame.data)))

    def close(self) -> None:
        """Finish the log."""
        self.drain()
        self._file.close()
