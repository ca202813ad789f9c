"""An axle's inputs: how often each comes, how old it is, what it says, and why some of it was refused."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from wrcd.bus.codec import Receiver
from wrcd.bus.dbc import find_message
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.tools.monitor.watched import REASONS, Watched
from wrcd.tools.story.records import Health

REFUSED_OVER_US = 1_000_000
MAX_AGE_US = 1_000_000  # a value older than that is not shown
MAX_LOOKED = 20  # frames without a usable value, as of another branch of a multiplexed message
OF_VEHICLE = (Quantity.SPEED, Quantity.DIRECTION)
TOLD = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.SPEED)  # that InputHealth tells of, in order
# what a person reads: a unit and its factor from SI
UNITS: Mapping[Quantity, tuple[str, float]] = {
    Quantity.YAW_RATE: ("rad/s", 1.0), Quantity.LAT_ACCEL: ("m/s²", 1.0), Quantity.TORQUE: ("kN m", 1e-3),
    Quantity.BRAKE_TORQUE: ("kN m", 1e-3), Quantity.SPEED: ("km/h", 3.6), Quantity.AXLE_LOAD: ("kN", 1e-3),
    Quantity.WHEEL_RADIUS: ("mm", 1e3), Quantity.DIRECTION: ("", 1.0),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class InputNow:
    """One input at a time. NaN and None: not known."""

    quantity: Quantity
    signal: str  # Message.Signal
    rate_hz: float
    age_ms: float | None
    timeout_ms: float
    reach: int | None  # of the daemon: eight bits, newest lowest
    refused: str  # by reason: "crc 12/s", as counted here; else the daemon's newest reason
    value: float | None
    unit: str

    @property
    def is_stale(self) -> bool:
        """Whether it is past its time-out, or never came."""
        return self.age_ms is None or self.age_ms > self.timeout_ms


class Inputs:
    """Of all axles."""

    def __init__(self, config: Config, hold_us: int) -> None:
        sources = [i.source for i in config.inputs]
        self._config = config
        self._receiver = Receiver(config.database, sources, config.data_ids)
        readers = self._receiver.readers
        self.watched: dict[int, Watched] = {}
        for key, reader in readers.items():
            message = find_message(config.database, reader.name)
            w = self.watched[key] = Watched(message, None, hold_us, keeps_data=True)
            w.start = None if reader.checker is None else reader.checker.start
        self._by_name = {w.name: w for w in self.watched.values()}

    def at(self, axle: int, health: Health, row: int | None, at_us: int) -> list[InputNow]:
        """Those of an axle (its place), and of the vehicle. row: of health, at the time; None: nothing is known."""
        out = []
        for number, i in enumerate(self._config.inputs):
            source = i.source
            if axle not in source.axles:
                continue
            w = self._by_name[source.message]
            age_us = w.age_us(at_us)
            reach, told = None, ""
            if row is not None and source.quantity in TOLD:
                place = TOLD.index(source.quantity)
                reach, reason = int(health.reach[row, place]), int(health.refused[row, place])
                told = REASONS[reason] if 0 < reason < len(REASONS) else ""
            here = w.refused_within(at_us, REFUSED_OVER_US)
            counted = [f"{REASONS[place]} {n}/s" for place, n in here.items()]
            if told and not any(c.startswith(told) for c in counted):
                counted.append(told)
            unit, scale = UNITS[source.quantity]
            value = self._value(number, at_us)
            out.append(
                InputNow(
                    source.quantity, f"{source.message}.{source.signal}", w.rate_hz(at_us),
                    None if age_us is None else age_us / 1000, i.timeout_us / 1000, reach, ", ".join(counted),
                    None if value is None else value * scale, unit,
                )
            )  # fmt: skip
        return out

    def any_frame(self, axle: int) -> bool:
        """Whether a frame has come of a message that is of this axle (its place) alone."""
        of_axles = [s for i in self._config.inputs if (s := i.source).quantity not in OF_VEHICLE]
        others = {s.message for s in of_axles if set(s.axles) != {axle}}
        own = {s.message for s in of_axles if axle in s.axles} - others
        return any(len(self._by_name[name].arrived["time_us"]) for name in own)

    def _value(self, number: int, at_us: int) -> float | None:
        """Of the newest frame at a time that carries a usable one."""
        w = self._by_name[self._config.inputs[number].source.message]
        reader, times = self._receiver.readers[w.key], w.arrived["time_us"]
        newest = int(np.searchsorted(times, at_us, side="right")) - 1
        for k in range(newest, max(newest - MAX_LOOKED, -1), -1):
            if at_us - int(times[k]) > MAX_AGE_US:
                break
            reader.reset()  # its counter is another question
            read = reader.read(w.frame(k))
            if not isinstance(read, Reason):
                value = next((s.value for s in read if s.source == number), None)
                if value is not None:
                    return value
        return None
