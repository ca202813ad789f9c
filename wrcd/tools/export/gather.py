"""Gathers what a core takes and makes, some seconds of it at once, for exported files."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import Sample
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.messages import Outgoing
from wrcd.estimator.records import Estimate, StepResult, Ticks
from wrcd.tools.export.groups import change_group, input_groups, sent_groups
from wrcd.tools.export.records import About, Column, Exporter, Group, Rows
from wrcd.tools.said import Said
from wrcd.tools.selection import Part

BLOCK_US = 10_000_000  # of the log, held in memory
PLACES = {v: place for place, v in enumerate(Validity)}
CAUSE_PLACES = {c: place for place, c in enumerate(Cause)}


@dataclass(slots=True)
class _Samples:
    """Accepted samples of one input."""

    group: Group
    stamps_us: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def take(self) -> Rows:
        """All of them; they are let go of."""
        rows = Rows(self.group, np.array(self.stamps_us, np.int64), (np.array(self.values, np.float64),))
        self.stamps_us, self.values = array("q"), array("d")
        return rows


@dataclass(slots=True)
class _Frames:
    """Frames made of one message."""

    said: Said
    group: Group
    stamps_us: "array[int]" = field(default_factory=lambda: array("q"))
    data: bytearray = field(default_factory=bytearray)

    @property
    def axle(self) -> int:
        """Whose they are; 0: the daemon's own."""
        return self.said.kind.axle if self.said.kind else 0

    def take(self) -> Rows:
        """All of them, decoded; they are let go of."""
        data = np.frombuffer(bytes(self.data), np.uint8).reshape(len(self.stamps_us), -1)
        values = self.said.read(data)
        rows = Rows(self.group, np.array(self.stamps_us, np.int64), [values[c.name] for c in self.group.channels])
        self.stamps_us, self.data = array("q"), bytearray()
        return rows


class Gather:
    """An observer of a core: what it takes and makes within a part of a log goes to exporters. A context manager: its
    end writes what is left and closes them."""

    def __init__(self, config: Config, exporters: Sequence[Exporter]) -> None:
        self._config, self._exporters = config, exporters
        self._samples = [_Samples(group) for group in input_groups(config)]
        self._frames = {said.key: _Frames(said, group) for said, group in sent_groups(config)}
        self._changes: dict[int, list[Change]] = {}  # by axle
        self._begin_us, self._end_us = -(1 << 62), 1 << 62
        self._due_us: int | None = None  # when the block is full
        self._core: Core | None = None
        self._told = 0

    def begin(self, core: Core, part: Part, about: About) -> None:
        """What is gathered from now on, and whose it is. What the core goes on from is not of this log."""
        self._core, self._told = core, core.events.total
        self._begin_us = self._begin_us if part.begin_us is None else part.begin_us
        self._end_us = self._end_us if part.end_us is None else part.end_us
        places = [place for place, a in enumerate(self._config.axles) if a.number in part.axles]
        self._wanted = [not set(places).isdisjoint(i.source.axles) for i in self._config.inputs]
        self._frames = {key: f for key, f in self._frames.items() if f.axle in (0, *part.axles)}
        self._changes = {number: [] for number in sorted(part.axles)}
        for exporter in self._exporters:
            exporter.begin(about)

    def accepted(self, samples: Sequence[Sample], stamp_us: int) -> None:
        """Keep the samples of an accepted frame."""
        if not self._begin_us <= stamp_us < self._end_us:
            return
        for s in samples:
            if self._wanted[s.source]:
                held = self._samples[s.source]
                held.stamps_us.append(stamp_us)
                held.values.append(s.value)
        if self._due_us is None:
            self._due_us = stamp_us + BLOCK_US
        elif not 0 <= self._due_us - stamp_us <= BLOCK_US:  # a block is full, or the clock has stepped
            self.flush()
            self._due_us = stamp_us + BLOCK_US

    def stepped(self, ticks: Ticks, first: int, result: StepResult) -> None:
        """Keep nothing: what comes of it is in the frames."""

    def was_reset(self, axle: int) -> None:
        """Keep nothing."""

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """Keep nothing."""

    def sent(self, o: Outgoing) -> None:
        """Keep a frame that was made."""
        held = self._frames.get(o.frame.key)
        if held is not None:
            held.stamps_us.append(o.frame.stamp_us)
            held.data += o.frame.data

    def look(self) -> None:
        """Keep the changes of Validity since the look before."""
        assert self._core is not None
        events = self._core.events
        if events.total == self._told:
            return
        for change in events.since(self._told):
            if change.axle in self._changes and self._begin_us <= change.time_us < self._end_us:
                self._changes[change.axle].append(change)
        self._told = events.total

    def flush(self) -> None:
        """Hand on what there is."""
        held: list[_Samples | _Frames] = [*self._samples, *self._frames.values()]
        rows = [_in_order(h.take()) for h in held if len(h.stamps_us)]
        rows += [_rows_of(axle, changes) for axle, changes in self._changes.items() if changes]
        for changes in self._changes.values():
            changes.clear()
        if rows:
            for exporter in self._exporters:
                exporter.write(rows)

    def close(self) -> None:
        """Finish the files."""
        self.flush()
        for exporter in self._exporters:
            exporter.close()


def _in_order(rows: Rows) -> Rows:
    """Rows by time: jitter between queues may have swapped some."""
    if (np.diff(rows.time_us) >= 0).all():
        return rows
    order = np.argsort(rows.time_us, kind="stable")
    return Rows(rows.group, rows.time_us[order], [_taken(c, order) for c in rows.columns])


def _taken(column: Column, order: NDArray[np.int64]) -> Column:
    return [column[k] for k in order] if isinstance(column, list) else column[order]


def _rows_of(axle: int, changes: Sequence[Change]) -> Rows:
    return Rows(
        change_group(axle),
        np.array([c.time_us for c in changes], np.int64),
        (
            np.array([PLACES[c.after] for c in changes], np.int8),
            np.array([CAUSE_PLACES[c.cause] for c in changes], np.int8),
            [c.detail if c.cause else "" for c in changes],
        ),
    )
