"""The frames of a slot: one writer for each message that the daemon sends."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from wrcd.bus.codec import Value, Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.report import NOT_AVAILABLE_REPORT, Report
from wrcd.core.values import health_values, link_values, reject_values
from wrcd.estimator.estimator import Estimate


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A frame to send, and the length of its slot: after the slot it is worthless."""

    frame: Frame
    cycle_us: int
    why: Estimate | None = None  # what the frame was made from
    cause: Cause = Cause.NONE  # of an axle's adhesion not being Valid


class Outbox:
    """Turns reports and counters into frames. A message that the DBC lacks is left out."""

    STATE = ("_rejected_before",)

    def __init__(self, config: Config) -> None:
        def writer(name: str | None) -> Writer | None:
            return Writer(find_message(config.database, name), ()) if name else None

        self._config = config
        self._adhesion = [writer(a.adhesion) for a in config.axles]
        self._detail = [writer(a.detail) for a in config.axles]
        self._inputs = [writer(a.inputs) for a in config.axles]
        self._status, self._rejects, self._link = map(writer, (config.status, config.rejects, config.link))
        self._rejected_before: Counter[Reason] = Counter()  # at the newest WrcdRejects

    def adhesion(self, end_us: int, reports: Sequence[Report], why: Estimate | None) -> Iterator[Outgoing]:
        """An axle's adhesion, every slot."""
        cycle_us = self._config.adhesion_cycle_us
        for writer, r in zip(self._adhesion, reports, strict=True):
            if writer:
                yield Outgoing(writer.frame(end_us, end_us // cycle_us, r.values()), cycle_us, why, r.cause)

    def detail(
        self, end_us: int, explained: Sequence[Mapping[str, Value]], inputs: Sequence[Mapping[str, Value]]
    ) -> Iterator[Outgoing]:
        """Why an axle's adhesion is what it is, and what came of its inputs."""
        yield from _frames(self._detail, end_us, self._config.detail_cycle_us, explained)
        yield from _frames(self._inputs, end_us, self._config.detail_cycle_us, inputs)

    def status(self, end_us: int, counts: Counts, health: Health, outliers: int) -> Iterator[Outgoing]:
        """How the daemon itself is."""
        new, self._rejected_before = counts.rejected - self._rejected_before, counts.rejected.copy()
        writers = (self._status, self._rejects, self._link)
        values = (
            health_values(health, counts, self._config.design.checksum),
            reject_values(new),
            link_values(health.link, counts, outliers),
        )
        yield from _frames(writers, end_us, self._config.status_cycle_us, values)

    def shutdown_frames(self, now_us: int, counts: Counts, health: Health) -> Iterator[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        # the present slot's frames have gone out: the next counter, or a receiver takes these for repeats
        slot = now_us // self._config.adhesion_cycle_us + 1
        yield from (w.frame(now_us, slot, NOT_AVAILABLE_REPORT.values()) for w in self._adhesion if w)
        if self._status:
            values = health_values(health, counts, self._config.design.checksum)
            yield self._status.frame(now_us, now_us // self._config.status_cycle_us + 1, values)


def _frames(
    writers: Sequence[Writer | None],
    end_us: int,
    cycle_us: int,
    values: Iterable[Mapping[str, Value]],
) -> Iterator[Outgoing]:
    for writer, v in zip(writers, values, strict=True):
        if writer:
            yield Outgoing(writer.frame(end_us, end_us // cycle_us, v), cycle_us)
