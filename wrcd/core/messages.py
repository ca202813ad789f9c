"""Messages out: what an axle's estimate and the daemon's counts are in the DBC's words, and the frames of a slot.

A message, or a signal, that the DBC lacks is left out.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.codec import Value, Writer
from wrcd.bus.dbc import Message, check_supported, find_message
from wrcd.bus.frame import Frame
from wrcd.bus.link import LinkHealth
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Output
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.inputs import LAT, SPEED, TORQUE, YAW
from wrcd.estimator.design import MODELS
from wrcd.estimator.records import Estimate

# MuAvailable (percent) from which a surface counts as that class.
SURFACES = ((25.0, "Dry"), (15.0, "Wet"), (8.0, "Reduced"), (4.0, "Low"), (-math.inf, "VeryLow"))
# Half-width of the 90 % interval (percentage points) up to which a level of Confidence holds.
CONFIDENCES = (
    (1.0, "Within1pp"), (2.0, "Within2pp"), (3.0, "Within3pp"), (5.0, "Within5pp"), (8.0, "Within8pp"),
    (12.0, "Within12pp"), (math.inf, "Wider"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Report:
    """One axle at one slot. Adhesion in percent; None is not available."""

    validity: Validity
    mu_available_pct: float | None
    mu_used_pct: float | None
    sample_age_ms: int
    surface: str
    contact_state: str
    confidence: str
    cause: Cause  # of not being Valid

    def values(self) -> dict[str, Value]:
        """By signal name of the DBC."""
        return {
            "Validity": self.validity.value,
            "MuAvailable": self.mu_available_pct,
            "MuUsed": self.mu_used_pct,
            "SampleAge": float(self.sample_age_ms),
            "Surface": self.surface,
            "ContactState": self.contact_state,
            "Confidence": self.confidence,
        }


NOT_AVAILABLE_REPORT = Report(Validity.NOT_AVAILABLE, None, None, 255, "Unknown", "Unknown", "None", Cause.NONE)


def surface(mu_available_pct: float | None) -> str:
    """The DBC's class of an adhesion."""
    if mu_available_pct is None:
        return "Unknown"
    return next(name for low, name in SURFACES if mu_available_pct >= low)


def confidence(half_width_pp: float | None) -> str:
    """The DBC's level of a half-width."""
    if half_width_pp is None:
        return "None"
    return next(name for most, name in CONFIDENCES if half_width_pp <= most)


def nan_to_none(x: float) -> float | None:
    """NaN as None."""
    return float(x) if math.isfinite(x) else None


# In which unit a report's numbers are, and which words it uses.
UNITS = {"MuAvailable": "%", "MuUsed": "%", "SampleAge": "ms"}
WORDS = {
    "Validity": tuple(v.value for v in Validity),
    "Surface": ("Unknown", *(name for _, name in SURFACES)),
    "ContactState": ("Unknown", "Adhering", "Saturated"),
    "Confidence": ("None", *(name for _, name in CONFIDENCES)),
    "Cause": tuple(c.label for c in Cause),
}


def sendable(message: Message) -> None:
    """Raises ValueError where a value would go out in a message as something else than it is."""
    check_supported(message)
    for s in message.signals:
        if s.name in (*UNITS, *WORDS) and s.is_float:
            raise ValueError(f"{message.name}.{s.name} is coded as a float; only whole numbers can be sent")
        if s.name in UNITS and (s.unit or "") != UNITS[s.name]:
            raise ValueError(f"{message.name}.{s.name} is in {s.unit!r}; it is sent in {UNITS[s.name]!r}")
        missing = [w for w in WORDS.get(s.name, ()) if w not in {str(c) for c in (s.choices or {}).values()}]
        if missing:
            raise ValueError(f"the value table of {message.name}.{s.name} lacks {', '.join(missing)}")


NAMES = {YAW: "YawRate", LAT: "LatAccel", TORQUE: "Torque", SPEED: "Speed"}  # as the DBC's signals end


def explanation(estimate: Estimate | None, axle: int, stale: Iterable[int], cause: Cause) -> dict[str, Value]:
    """AdhesionDetail of an axle; without an estimate only the cause and which inputs (quantities) are stale."""
    values: dict[str, Value] = {f"Stale{name}": float(q in stale) for q, name in NAMES.items()}
    values["Cause"] = cause.label
    values["WinningModel"] = float(estimate.winner[axle]) if estimate else 0.0
    values["DominantRule"] = float(estimate.rule[axle]) if estimate else None
    for m in range(MODELS):
        r = float(estimate.residuals[axle, m]) if estimate else math.nan
        values[f"Residual{m + 1}"] = 20 * math.log10(r) if math.isfinite(r) else None
    return values


def plausibility(estimate: Estimate | None, axle: int) -> str:
    """More in use than available is saturation, or something is wrong: which."""
    if estimate is None or not math.isfinite(estimate.mu_available_pct[axle]):
        return "Unknown"
    if estimate.contradicted[axle]:
        return "Contradiction"
    return "Saturated" if estimate.saturated[axle] else "Consistent"


def health_values(health: Health, counts: Counts, design_checksum: str) -> dict[str, Value]:
    """WrcdStatus."""
    return {
        "State": health.state,
        "Overruns": float(health.overruns % 256),
        "RejectedFrames": float(counts.rejected.total() % 1024),
        "LastReason": counts.last_reason,
        "ReceiveDrops": float(health.link.drops % 64),
        "Reopens": float(health.link.reopens % 16),
        "DesignChecksum": float(int(design_checksum[:4], 16)),
    }


def reject_values(new: Mapping[Reason, int]) -> dict[str, Value]:
    """WrcdRejects, of the rejections since the last."""
    return {f"Rejected{r.label}": float(min(new.get(r, 0), 15)) for r in Reason}


def link_values(link: LinkHealth, counts: Counts, outliers: int) -> dict[str, Value]:
    """WrcdLink."""
    return {
        "LinkState": link.state,
        "ErrorFrames": float(link.error_frames % 4096),
        "BusOffs": float(link.bus_offs % 16),
        "Unsent": float(link.unsent % 256),
        "TimeSteps": float(counts.time_steps % 16),
        "LateFrames": float(counts.late % 16),
        "Outliers": float(outliers % 256),
        "Restarts": float(counts.restarts % 256),
    }


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A frame to send, and the length of its slot: after the slot it is worthless."""

    frame: Frame
    cycle_us: int
    why: Estimate | None = None  # what the frame was made from
    cause: Cause = Cause.NONE  # of an axle's adhesion not being Valid


class Outbox:
    """Turns reports and counters into frames. A message that the DBC lacks is left out."""

    STATE = {"rejected_before": "_rejected_before"}

    def __init__(self, config: Config) -> None:
        def writer(output: Output | None) -> Writer | None:
            return Writer(find_message(config.database, output.message), output) if output else None

        self._config = config
        self._adhesion = [writer(a.adhesion) for a in config.axles]
        self._detail = [writer(a.detail) for a in config.axles]
        self._inputs = [writer(a.inputs) for a in config.axles]
        self._status, self._rejects, self._link = map(writer, (config.status, config.rejects, config.link))
        own = (self._status, self._rejects, self._link)
        every = (*self._adhesion, *self._detail, *self._inputs, *own)
        self.cycles_us = tuple(sorted({w.cycle_us for w in every if w}))
        self._rejected_before: Counter[Reason] = Counter()  # at the newest WrcdRejects

    def adhesion_due(self, due: Sequence[int]) -> tuple[int, ...]:
        """The axles (places) whose adhesion is due with these cycles."""
        return tuple([axle for axle, w in enumerate(self._adhesion) if w and w.cycle_us in due])

    def detail_due(self, due: Sequence[int]) -> bool:
        """Whether any frame is that explains it."""
        return any(w and w.cycle_us in due for w in (*self._detail, *self._inputs))

    def inputs_cycle_us(self, axle: int) -> int:
        """How often it is told what came of an axle's inputs; 0: never."""
        writer = self._inputs[axle]
        return writer.cycle_us if writer else 0

    def adhesion(
        self, end_us: int, due: Sequence[int], reports: Sequence[Report], why: Estimate | None
    ) -> Iterator[Outgoing]:
        """The adhesion of the axles whose slot it is."""
        for w, r in zip(self._adhesion, reports, strict=True):
            if w and w.cycle_us in due:
                yield Outgoing(w.frame(end_us, end_us // w.cycle_us, r.values()), w.cycle_us, why, r.cause)

    def detail(
        self,
        end_us: int,
        due: Sequence[int],
        explained: Sequence[Mapping[str, Value]],
        inputs: Sequence[Mapping[str, Value]],
    ) -> Iterator[Outgoing]:
        """Why an axle's adhesion is what it is, and what came of its inputs."""
        yield from _frames(self._detail, end_us, due, explained)
        yield from _frames(self._inputs, end_us, due, inputs)

    def status(
        self, end_us: int, due: Sequence[int], counts: Counts, health: Health, outliers: int
    ) -> Iterator[Outgoing]:
        """How the daemon itself is."""
        if self._status and self._status.cycle_us in due:
            values = health_values(health, counts, self._config.design.checksum)
            yield from _frames((self._status,), end_us, due, (values,))
        if self._rejects and self._rejects.cycle_us in due:
            new, self._rejected_before = counts.rejected - self._rejected_before, counts.rejected.copy()
            yield from _frames((self._rejects,), end_us, due, (reject_values(new),))
        if self._link and self._link.cycle_us in due:
            yield from _frames((self._link,), end_us, due, (link_values(health.link, counts, outliers),))

    def shutdown_frames(self, now_us: int, counts: Counts, health: Health) -> Iterator[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        status = health_values(health, counts, self._config.design.checksum)
        last = [(w, NOT_AVAILABLE_REPORT.values()) for w in self._adhesion]
        for writer, values in (*last, (self._status, status)):
            if writer:
                # the present slot's frames have gone out: the next counter, or a receiver takes these for repeats
                yield writer.frame(now_us, now_us // writer.cycle_us + 1, values)


def _frames(
    writers: Sequence[Writer | None],
    end_us: int,
    due: Sequence[int],
    values: Iterable[Mapping[str, Value]],
) -> Iterator[Outgoing]:
    for w, v in zip(writers, values, strict=True):
        if w and w.cycle_us in due:
            yield Outgoing(w.frame(end_us, end_us // w.cycle_us, v), w.cycle_us)
