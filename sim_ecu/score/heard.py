"""Many frames of one message, decoded at once: cantools takes a tenth of a score for it, frame by frame."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from sim_ecu.play.adhesion import AdhesionReader, Said
from wrcd.bus.dbc import find_message
from wrcd.bus.signals import Output
from wrcd.core.configuration import Config

FloatArray = NDArray[np.float64]


class Hears(Protocol):
    """The frames of a message, whoever has laid it out."""

    message: Message
    stamps_us: list[int]
    data: list[bytes]

    def numbers(self, signal: str) -> FloatArray:
        """Values (frames,) of a signal by the daemon's own name, NaN where there is none."""

    def words(self, signal: str) -> NDArray[np.str_]:
        """Words (frames,) of a signal; empty for no such signal."""


@dataclass(slots=True)
class Heard:
    """The frames of a message of 8 bytes: when (microseconds after the run's begin), and what."""

    message: Message
    stamps_us: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)

    def numbers(self, signal: str) -> FloatArray:
        """Values (frames,) in the signal's unit; NaN where the value stands for a word."""
        raw = self._raw(signal)
        s = self.message.get_signal_by_name(signal)
        known = ~np.isin(raw, list(s.choices or ()))
        return np.where(known, raw * float(s.scale) + float(s.offset), np.nan)

    def words(self, signal: str) -> NDArray[np.str_]:
        """Words (frames,) of the signal's value table, the number where it has none; empty for no such signal."""
        if signal not in {s.name for s in self.message.signals}:
            return np.full(len(self.data), "")
        values, place = np.unique(self._raw(signal), return_inverse=True)
        choices = dict(self.message.get_signal_by_name(signal).choices or {})
        return np.array([str(choices.get(v, v)) for v in values.tolist()], np.str_)[place]

    def _raw(self, signal: str) -> NDArray[np.int64]:
        s = self.message.get_signal_by_name(signal)
        assert s.byte_order == "little_endian"
        assert self.message.length == 8
        bits = np.frombuffer(b"".join(self.data), "<u8") >> np.uint64(s.start)
        raw = (bits & np.uint64(2**s.length - 1)).astype(np.int64)
        return np.where(s.is_signed & (raw >= 2 ** (s.length - 1)), raw - 2**s.length, raw)


class HeardOwn:
    """The frames of an output that a train's own DBC lays out, by the daemon's names. To be read when all are there."""

    def __init__(self, message: Message, output: Output) -> None:
        self.message, self.stamps_us, self.data = message, list[int](), list[bytes]()
        self._reader = AdhesionReader(message, output)

    def numbers(self, signal: str) -> FloatArray:
        """As of Heard."""
        values = [said.get(signal) for said in self._said]
        return np.array([v if isinstance(v, float) else math.nan for v in values], np.float64)

    def words(self, signal: str) -> NDArray[np.str_]:
        """As of Heard."""
        values = [said.get(signal) for said in self._said]
        return np.array([v if isinstance(v, str) else "" for v in values], np.str_)

    @cached_property
    def _said(self) -> list[Said]:
        return [self._reader.read(data) for data in self.data]


def heard_own(config: Config, axle: int) -> tuple[HeardOwn, HeardOwn | None]:
    """Adhesion and, where it is mapped, AdhesionDetail of an axle, as a configuration lays them out."""
    outputs = next(a for a in config.axles if a.number == axle)
    said, detail = (
        None if output is None else HeardOwn(find_message(config.database, output.message), output)
        for output in (outputs.adhesion, outputs.detail)
    )
    assert said is not None
    return said, detail
