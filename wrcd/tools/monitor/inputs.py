"""An axle's inputs: how often each comes, how old it is, what it says, and why some of it was refused."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import Receiver
from wrcd.bus.dbc import find_message
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.tools.monitor.batch import Batch
from wrcd.tools.monitor.table import Table
from wrcd.tools.monitor.watched import REASONS, Watched
from wrcd.tools.story.records import Health, Times

REFUSED_OVER_US = 1_000_000
SAMPLE_US = 100_000  # values are kept so often
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
            w = self.watched[key] = Watched(message, None, hold_us)
            w.start = None if reader.checker is None else reader.checker.start
        rows = hold_us // SAMPLE_US * 5 // 4 + 100
        self._values = [Table({"time_us": (np.int64, 0), "value": (np.float32, 0)}, rows) for _ in sources]
        self._by_name = {w.name: w for w in self.watched.values()}
        self._sampled_us: dict[int, int] = dict.fromkeys(readers, 0)

    def take(self, key: int, times: Times, batch: Batch, rows: Times) -> None:
        """Good frames of a message: rows of a batch. Some are read, the newest of each tenth of a second."""
        reader = self._receiver.readers[key]
        last = len(rows) - 1
        for k in np.flatnonzero(np.diff(times // SAMPLE_US, append=-1)).tolist():
            if k == last and times[k] - self._sampled_us[key] < SAMPLE_US:
                continue
            reader.reset()
            read = reader.read(batch.frame(int(rows[k])))
            self._sampled_us[key] = int(times[k])
            if not isinstance(read, Reason):
                for sample in read:
                    self._values[sample.source].append(time_us=times[k : k + 1], value=[sample.value])

    def series(self, axle: int, quantity: Quantity) -> tuple[Times, NDArray[np.float64]] | None:
        """The values of an axle's quantity as they were sampled, in SI units; None unless one signal carries it."""
        found = [
            k for k, i in enumerate(self._config.inputs) if axle in i.source.axles and i.source.quantity is quantity
        ]
        if len(found) != 1 or not len(self._values[found[0]]):
            return None
        table = self._values[found[0]]
        return table["time_us"], table["value"].astype(np.float64)

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

    def _value(self, number: int, at_us: int) -> float | None:
        times = self._values[number]["time_us"]
        k = int(np.searchsorted(times, at_us, side="right")) - 1
        if k < 0 or at_us - int(times[k]) > 10 * SAMPLE_US:
            return None
        return float(self._values[number]["value"][k])
