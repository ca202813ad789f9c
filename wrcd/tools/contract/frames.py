"""Adhesion frames of one axle, as the daemon sends them by its configuration, and frames that it would never send."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from wrcd.bus.codec import Writer
from wrcd.bus.dbc import Message, attribute, find_message, find_signal, timeout_ms
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.bus.positions import Numbers, frame_length, position
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.messages import Report, surface
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
        used = None if self.mu_pct is None else min(3.0, self.mu_pct)
        contact = "Unknown" if self.mu_pct is None else "Adhering"
        return Report(
            self.validity, self.mu_pct, used, self.age_ms, surface(self.mu_pct), contact, self.confidence, Cause.NONE
        )


# as the daemon sends them
DEGRADED = Says(20.0, "None", Validity.DEGRADED)
NOTHING = Says(None, "None", Validity.NOT_AVAILABLE, 255)


class FrameMaker:
    """Makes frames of one axle."""

    def __init__(self, config: Config, axle: AxleConfig) -> None:
        self.number, self._output = axle.number, axle.adhesion
        self._message: Message = find_message(config.database, axle.adhesion.message)
        self._writer = Writer(self._message, axle.adhesion)
        self.cycle_us = axle.adhesion.cycle_us
        self.name = self._message.name
        self.timeout_us = self._timeout_us()
        self.protected = axle.adhesion.data_id is not None

    def _timeout_us(self) -> int:
        """The shortest time-out that the DBC states of a signal that is sent, else three cycles."""
        signals = [find_signal(self._message, sent.name) for sent in self._output.signals.values()]
        stated = [timeout_ms(self._message, s) for s in signals if attribute(s, "GenSigTimeoutTime")]
        return min((1000 * ms for ms in stated if ms is not None), default=3 * self.cycle_us)

    def has(self, signal: str) -> bool:
        """Whether the configuration sends a signal, by our name."""
        return signal in self._output.signals

    def frame(self, counter: int, says: Says) -> Frame:
        """The frame that the daemon would send."""
        return self._writer.frame(0, counter, says.report.values())

    def lower_end(self, says: Says, whole: bool = False) -> float:
        """The lower end of the interval that a frame claims, in percent, as a receiver reads it; at least 0. whole:
        MuAvailable itself.

        Where several levels of Confidence have one raw value the widest is meant.
        """
        signal = self._output.signals["MuAvailable"]
        field = find_signal(self._message, signal.name)
        mu = (self.raw(self.frame(0, says), "MuAvailable") * float(field.scale) + float(field.offset)) / signal.factor
        return mu if whole else max(mu - self._half_width(says.confidence), 0.0)

    def _half_width(self, confidence: str) -> float:
        if not self.has("Confidence"):
            return 0.0
        words = self._output.signals["Confidence"].words or {}
        raw = words.get(confidence)
        return max((HALF_WIDTHS[w] for w, r in words.items() if r == raw and w in HALF_WIDTHS), default=0.0)

    def raw(self, frame: Frame, signal: str) -> int:
        """A signal's raw value in a frame."""
        at = position(find_signal(self._message, self._output.signals[signal].name), frame_length(self._message))
        return at.raw(Numbers(frame.data).of(at.order))

    def with_raw(self, frame: Frame, signal: str, raw: int) -> Frame:
        """The frame with another raw value of a signal; its counter stays, its CRC is right."""
        at = position(find_signal(self._message, self._output.signals[signal].name), frame_length(self._message))
        number = int.from_bytes(frame.data, at.order) & ~(at.mask << at.shift) | (raw & at.mask) << at.shift
        return self.again(replace(frame, data=number.to_bytes(len(frame.data), at.order)))

    def word(self, signal: str, word: str) -> int:
        """The raw value of a word of ours."""
        return (self._output.signals[signal].words or {})[word]

    def again(self, frame: Frame, other_message: bool = False) -> Frame:
        """The frame with a right CRC over its present bytes; other_message: with that of another data id."""
        if self._output.data_id is None:
            return frame
        data_id = self._output.data_id ^ (1 if other_message else 0)
        return replace(frame, data=protect(frame.data, data_id, frame.data[1] & 0x0F))

    def unknown_validities(self) -> list[tuple[str, int]]:
        """Raw values of Validity that are none of Valid, Degraded and NotAvailable, with what they are called."""
        words = self._output.signals["Validity"].words or {}
        signal = find_signal(self._message, self._output.signals["Validity"].name)
        known = {words[v.value] for v in Validity}
        values = range(1 << signal.length)
        error = words.get("Error")
        named = [] if error is None or error in known else [("Error", error)]
        free = [raw for raw in (values[-1], *values) if raw not in known and raw != error][:1]
        return named + [(f"the unknown value {raw}", raw) for raw in free]

    def no_numbers(self) -> Iterator[tuple[str, str, int]]:
        """Raw values of MuAvailable that are no percentage: kind (not-available, error, beyond), words, raw value."""
        sent = self._output.signals["MuAvailable"]
        signal = find_signal(self._message, sent.name)
        named = {int(raw): str(label) for raw, label in (signal.choices or {}).items()}
        absent = sent.not_available
        if absent is not None:
            yield "not-available", f"MuAvailable {absent} (not available)", absent
        for raw, label in named.items():
            if raw != absent:
                yield "error", f"MuAvailable {raw} ({label})", raw
        most = signal.maximum if sent.high is None else sent.high
        if most is None:
            return
        percent = float(most) / sent.factor
        first = round((float(most) - float(signal.offset)) / float(signal.scale)) + 1
        highest = (1 << signal.length - bool(signal.is_signed)) - 1
        for raw in (first, (first + highest) // 2):
            if percent >= 100.0 - 1e-6 and first <= raw < highest and raw not in named and raw != absent:
                yield "beyond", f"MuAvailable {raw}, beyond 100 %", raw
