"""Adhesion frames of one axle as the daemon sends them by its configuration, and frames that it would never send."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from wrcd.bus.dbc import find_message, find_signal, shortest_timeout_us
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.positions import fit_raw, span
from wrcd.bus.writers import Writer
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.reports import Report, surface
from wrcd.core.vocabulary import CONFIDENCES

HALF_WIDTHS = {name: most for most, name in CONFIDENCES}  # pp; of Wider infinite


@dataclass(frozen=True, slots=True)
class Says:
    """What a frame says of its axle. mu_pct None: not available."""

    mu_pct: float | None = 20.0
    confidence: str = "Within3pp"
    validity: Validity = Validity.VALID
    age_ms: int = 10

    def __str__(self) -> str:
        mu = "MuAvailable not available" if self.mu_pct is None else f"{self.mu_pct:g} %"
        age = "" if self.age_ms == 10 else f", SampleAge {self.age_ms} ms"
        return f"{self.validity.value} {mu} {self.confidence}{age}"

    @property
    def report(self) -> Report:
        """As the daemon's core has it."""
        mu, level = self.mu_pct, self.confidence
        used, contact = (None, "Unknown") if mu is None else (min(3.0, mu), "Adhering")
        return Report(self.validity, mu, used, self.age_ms, surface(mu), contact, level, Cause.NONE)


BASE = Says()
# as the daemon sends them
DEGRADED = Says(20.0, "None", Validity.DEGRADED)
NOTHING = Says(None, "None", Validity.NOT_AVAILABLE, 255)


class FrameMaker:
    """Makes frames of one axle."""

    def __init__(self, config: Config, axle: AxleConfig) -> None:
        output = axle.adhesion
        self._message = find_message(config.database, output.message)
        self._writer, self._data_id, self._sent = Writer(self._message, output), output.data_id, output.signals
        self._signals = {ours: find_signal(self._message, sent.name) for ours, sent in output.signals.items()}
        self.number, self.name, self.cycle_us = axle.number, self._message.name, output.cycle_us
        self.timeout_us = shortest_timeout_us(self._message, self._signals.values(), output.cycle_us)
        self.lacks = {} if output.data_id is not None else {"E2E": "has no E2E: no base for a controller"}
        self.lacks |= {
            name: f"has no {name}"
            for name in ("SampleAge", "Confidence", "Surface", "ContactState")
            if name not in output.signals
        }

    def frame(self, counter: int, says: Says = BASE) -> Frame:
        """Return the frame that the daemon would send."""
        return self._writer.frame(0, counter, says.report.values())

    def lower_end(self, says: Says, whole: bool = False) -> float:
        """Return the lower end of the interval that a frame claims, in percent, as a receiver reads it, at least 0;
        whole: MuAvailable itself. Where several levels of Confidence have one raw value the widest is meant."""
        sent = self._sent["MuAvailable"]
        values: Any = self._message.decode(self.frame(0, says).data, decode_choices=False)
        mu = float(values[sent.name]) / sent.factor
        words = (self._sent["Confidence"].words or {}) if "Confidence" in self._sent else {}
        alike = [word for word, raw in words.items() if raw == words.get(says.confidence) and word in HALF_WIDTHS]
        return mu if whole else max(mu - max(map(HALF_WIDTHS.__getitem__, alike), default=0.0), 0.0)

    def with_raw(self, frame: Frame, signal: str, raw: int) -> Frame:
        """Return the frame with another raw value of a signal, or a word of ours; its CRC is right."""
        values: Any = self._message.decode(frame.data, decode_choices=False, scaling=False)
        values[self._sent[signal].name] = fit_raw(self._signals[signal], raw)
        return self._writer.raw_frame(0, frame.data[1] & 0x0F, values)

    def word(self, signal: str, word: str) -> int:
        """Return the raw value of a word of ours."""
        return (self._sent[signal].words or {})[word]

    def again(self, frame: Frame, other_message: bool = False) -> Frame:
        """Return the frame with a right CRC over its present bytes; other_message: with that of another data id."""
        if self._data_id is None:
            return frame
        return replace(frame, data=protect(frame.data, self._data_id ^ other_message, frame.data[1] & 0x0F))

    def unknown_validities(self) -> list[tuple[str, int]]:
        """Return raw values of Validity but Valid, Degraded and NotAvailable, with what they are called."""
        words = self._sent["Validity"].words or {}
        known, error = {words[v.value] for v in Validity}, words.get("Error")
        values = range(1 << self._signals["Validity"].length)
        named = [] if error is None or error in known else [("Error", error)]
        free = [raw for raw in (values[-1], *values) if raw not in known and raw != error][:1]
        return named + [(f"the unknown value {raw}", raw) for raw in free]

    def no_numbers(self) -> Iterator[tuple[str, str, int]]:
        """Yield raw values of MuAvailable that are none: kind (not-available, error, beyond), words, value."""
        sent, signal = self._sent["MuAvailable"], self._signals["MuAvailable"]
        named = {int(raw): str(label) for raw, label in (signal.choices or {}).items()}
        absent = sent.not_available
        if absent is not None:
            yield "not-available", f"MuAvailable {absent} (not available)", absent
        for raw, label in named.items():
            if raw != absent:
                yield "error", f"MuAvailable {raw} ({label})", raw
        most = signal.maximum if sent.high is None else sent.high
        if most is None or float(most) / sent.factor < 100.0 - 1e-6:
            return
        first = round((float(most) - float(signal.offset)) / float(signal.scale)) + 1
        _, highest = span(signal)
        for raw in (first, (first + highest) // 2):
            if first <= raw < highest and raw not in named and raw != absent:
                yield "beyond", f"MuAvailable {raw}, beyond 100 %", raw
