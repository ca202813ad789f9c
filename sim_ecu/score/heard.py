"""Many frames of one message, decoded at once: cantools takes a tenth of a score for it, frame by frame."""

from dataclasses import dataclass, field

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


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
