"""The CSV of `wrcd replay`: a row for each Adhesion frame."""

import csv
import math
from typing import IO, Any

from wrcd.bus.codec import message_key, position
from wrcd.bus.dbc import Message, find_message, find_signal
from wrcd.bus.positions import Position
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.configuration import Config
from wrcd.core.messages import Outgoing
from wrcd.estimator.design import Design
from wrcd.estimator.records import Estimate
from wrcd.tools.explain import sentence
from wrcd.tools.selection import Part

COLUMNS = (
    "time_s", "axle", "validity", "mu_available_pct", "mu_used_pct", "contact_state", "surface", "confidence",
    "sample_age_ms", "cause", "half_width_pp", "low_pct", "high_pct",
)  # fmt: skip
REASONS = ("winning_model", "dominant_rule", "rule_share")  # with --explain
# the signals of the columns behind the axle; the columns after them are the core's, whatever a frame carries
SIGNALS = ("Validity", "MuAvailable", "MuUsed", "ContactState", "Surface", "Confidence", "SampleAge")


class Rows:
    """The CSV: what the Adhesion frames say, in the words of the DBC's value tables."""

    def __init__(self, file: IO[str], config: Config, explained: bool, part: Part) -> None:
        self._writer = csv.writer(file, lineterminator="\n")
        self._writer.writerow((*COLUMNS, *REASONS) if explained else COLUMNS)
        self._design, self._explained = config.design, explained
        self._place = {a.number: place for place, a in enumerate(config.axles)}
        self._origin_us = part.origin_us
        self._messages: dict[int, tuple[Cells, int]] = {}  # by Frame.key
        for a in config.axles:
            if a.number in part.axles:
                message = find_message(config.database, a.adhesion.message)
                self._messages[message_key(message)] = Cells(message, a.adhesion), a.number

    def write(self, o: Outgoing) -> None:
        """One row for an Adhesion frame, nothing for others."""
        frame, why = o.frame, o.why
        found = self._messages.get(frame.key)
        if found is None:
            return
        cells, number = found
        stamp = _seconds(frame.stamp_us - self._origin_us)
        place = self._place[number]
        row = [stamp, number, *cells.of(frame.data), o.cause.words, *_interval(why, place)]
        if self._explained:
            row += _reasons(self._design, why, place)
        self._writer.writerow(row)


def _seconds(us: int) -> str:
    """Microseconds as seconds, exactly."""
    return f"{'-' * (us < 0)}{abs(us) // 1_000_000}.{abs(us) % 1_000_000:06d}"


class Cells:
    """The text of each signal of a message: what cantools makes of a raw value is looked up from the second time on.
    Words that the configuration gives are ours again."""

    def __init__(self, message: Message, output: Output) -> None:
        self._message = message
        self._known = [s for name in SIGNALS if (s := output.signals.get(name)) is not None]
        self._positions = [position(find_signal(message, s.name), message.length) for s in self._known]
        self._texts = [self._words(s, at) for s, at in zip(self._known, self._positions, strict=True)]
        self._columns = [column for column, name in enumerate(SIGNALS) if name in output.signals]

    @staticmethod
    def _words(sent: OutputSignal, at: Position) -> dict[int, str]:
        """What is known beforehand, by raw value as it lies in the frame."""
        words = {raw & at.mask: word for word, raw in (sent.words or {}).items()}
        return words if sent.not_available is None else {sent.not_available & at.mask: "", **words}

    def of(self, data: bytes) -> list[str]:
        """One text for each of SIGNALS, empty for those that the message lacks."""
        numbers = {"little": int.from_bytes(data, "little"), "big": int.from_bytes(data, "big")}
        out = [""] * len(SIGNALS)
        decoded: Any = None
        for signal, at, texts, column in zip(self._known, self._positions, self._texts, self._columns, strict=True):
            raw = numbers[at.order] >> at.shift & at.mask
            text = texts.get(raw)
            if text is None:
                decoded = decoded or self._message.decode(data)
                text = texts[raw] = _cell(decoded.get(signal.name), signal.factor, SIGNALS[column])
            out[column] = text
        return out


def _cell(value: Any, factor: float, of: str) -> str:
    if value is None:
        return ""
    if hasattr(value, "name"):
        # a name beside a percentage (65535) says that there is none; a class is its name
        return "" if of in ("MuAvailable", "MuUsed") else str(value.name)
    if factor != 1.0:
        value /= factor
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _interval(why: Estimate | None, place: int) -> list[str]:
    """The 90 % interval that was estimated: its half-width in percentage points, its ends in percent."""
    if why is None or not math.isfinite(why.half_width_pp[place]):
        return ["", "", ""]
    mu, half = float(why.mu_available_pct[place]), float(why.half_width_pp[place])
    return [f"{half:.2f}", f"{max(mu - half, 0.0):.2f}", f"{mu + half:.2f}"]


def _reasons(design: Design, why: Estimate | None, place: int) -> list[str]:
    """The model that fits best against its own range, the rule that weighs most, and its share."""
    if why is None:
        return ["", "", ""]
    winner, rule = int(why.winner[place]), int(why.rule[place])
    model = f"{winner}: {design.model_names[winner - 1]}" if winner else ""
    return [model, f"{rule}: {sentence(design, rule - 1)}" if rule else "", f"{why.rule_share[place]:.2f}"]
