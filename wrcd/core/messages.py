"""Messages out: what an axle's estimate and the daemon's counts are in the DBC's words, and the frames of a slot.

A message, or a signal, that the DBC lacks is left out.
"""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.codec import Value, Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.link import LinkHealth
from wrcd.bus.reasons import Reason
from wrcd.bus.signals import Output
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.inputs import LAT, SPEED, TORQUE, YAW
from wrcd.core.records import Estimate
from wrcd.core.terms import MODELS
from wrcd.core.vocabulary import CONFIDENCES, SURFACES


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
    short: bool = False  # for a window of too little track: nothing was lost

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


ROOM = 0.9  # of a level's half-width
NOT_AVAILABLE_REPORT = Report(Validity.NOT_AVAILABLE, None, None, 255, "Unknown", "Unknown", "None", Cause.NONE)


def surface(mu_available_pct: float | None) -> str:
    """The DBC's class of an adhesion."""
    if mu_available_pct is None:
        return "Unknown"
    return next(name for low, name in SURFACES if mu_available_pct >= low)


def confidence(half_width_pp: float | None, before: str) -> str:
    """The DBC's level of a half-width: the narrowest that holds it. From the level before to a narrower one it goes
    only where there is room, or it would go up and down with every frame."""
    if half_width_pp is None:
        return "None"
    names = [name for _, name in CONFIDENCES]
    level, roomy = (names[_level(x)] for x in (half_width_pp, half_width_pp / ROOM))
    if before not in names or names.index(level) >= names.index(before):
        return level
    return min(roomy, before, key=names.index)


def _level(half_width_pp: float) -> int:
    return next(k for k, (most, _) in enumerate(CONFIDENCES) if half_width_pp <= most)


def nan_to_none(x: float) -> float | None:
    """NaN as None."""
    return float(x) if math.isfinite(x) else None


NAMES = {YAW: "YawRate", LAT: "LatAccel", TORQUE: "Torque", SPEED: "Speed"}  # as the DBC's signals end


def explanation(estimate: Estimate | None, axle: int, stale: Iterable[int], cause: str) -> dict[str, Value]:
    """AdhesionDetail of an axle; without an estimate only the cause and which inputs (quantities) are stale."""
    values: dict[str, Value] = {f"Stale{name}": float(q in stale) for q, name in NAMES.items()}
    values["Cause"] = cause
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


def reject_values(new: Mapping[Reason, int], foreign: int) -> dict[str, Value]:
    """WrcdRejects, of the rejections since the last, and of the daemon's own messages that somebody else sent."""
    rejected: dict[str, Value] = {f"Rejected{r.label}": float(min(new.get(r, 0), 15)) for r in Reason}
    return {**rejected, "ForeignFrames": float(min(max(foreign, 0), 15))}


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
    why: Estimate | None = None  # what an axle's adhesion was estimated as; None while it has no estimate
    cause: Cause = Cause.NONE  # of an axle's adhesion not being Valid


class Outbox:
    """Turns reports and counters into frames. A message that the DBC lacks is left out."""

    _rejected_before: Counter[Reason]  # at the newest WrcdRejects
    _foreign_before: int = 0

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
        self._rejected_before = Counter()

    @property
    def of_axles(self) -> Mapping[str, Sequence[Writer | None]]:
        """What is sent of each axle, by its key in the vocabulary, in a slot's order."""
        return {"adhesion": self._adhesion, "detail": self._detail, "inputs": self._inputs}

    @property
    def others(self) -> Sequence[Writer]:
        """All else that is sent."""
        return [w for w in (self._status, self._rejects, self._link) if w]

    def adhesion_due(self, due: Sequence[int]) -> tuple[int, ...]:
        """The axles (places) whose adhesion is due with these cycles."""
        return tuple([axle for axle, w in enumerate(self._adhesion) if w and w.cycle_us in due])

    def detail_due(self, due: Sequence[int]) -> bool:
        """Whether any frame is that explains it."""
        return any(w and w.cycle_us in due for w in (*self._detail, *self._inputs))

    def inputs_cycle_us(self, axle: int) -> int:
        """How often it is reported what came of an axle's inputs; 0: never."""
        writer = self._inputs[axle]
        return writer.cycle_us if writer else 0

    def adhesion(
        self, end_us: int, due: Sequence[int], reports: Sequence[Report], why: Estimate | None
    ) -> Iterator[Outgoing]:
        """The adhesion of the axles whose slot it is."""
        for w, r in zip(self._adhesion, reports, strict=True):
            if w and w.cycle_us in due:
                estimate = None if r.validity is Validity.NOT_AVAILABLE else why
                yield Outgoing(w.frame(end_us, end_us // w.cycle_us, r.values()), w.cycle_us, estimate, r.cause)

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
            rejected, foreign = counts.rejected, health.link.foreign_frames
            values = reject_values(rejected - self._rejected_before, foreign - self._foreign_before)
            self._rejected_before, self._foreign_before = rejected.copy(), foreign
            yield from _frames((self._rejects,), end_us, due, (values,))
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
