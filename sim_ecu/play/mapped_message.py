"""A message that a configuration maps, as the rig sends it: by cantools and the autosar-e2e package."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from cantools.database.can import Message, Signal

from sim_ecu.play.claims import Claim, Place, cycle_us
from sim_ecu.play.encoder import COUNTERS, SAMPLE_US, Sent, frame_length, is_fd, protect
from wrcd.bus.dbc import find_signal

Raws = frozenset[int]


@dataclass(slots=True)
class Plan:
    """A message to send: what is mapped in it, what stands in the rest of it, and the values of its multiplexers, one
    frame for each."""

    message: Message
    claims: list[Claim] = field(default_factory=list)
    statuses: dict[str, Raws] = field(default_factory=dict)  # by signal: the raw values that are good
    degraded: dict[str, Raws] = field(default_factory=dict)
    of_status: list[Claim] = field(default_factory=list)  # that its statuses are about
    data_id: int | None = None

    @property
    def every_us(self) -> int:
        """Its cycle."""
        if self.claims or not self.message.cycle_time:
            return min(cycle_us(part) for part in (self.claims, self.of_status) if part)
        return max(int(self.message.cycle_time) * 1000, SAMPLE_US)


class Messages:
    """Encodes one message."""

    def __init__(self, plan: Plan, counter: int = 0) -> None:
        self.every_us = plan.every_us
        self._message, self._data_id = plan.message, plan.data_id
        self._by_signal: dict[str, list[Claim]] = {}
        for c in plan.claims:
            self._by_signal.setdefault(c.signal.name, []).append(c)
        self._counter = counter
        start = {s.name: _start(s) for s in plan.message.signals}
        start |= {name: min(usable) for name, usable in plan.statuses.items()}
        names = [*(c.signal.name for c in plan.claims), *plan.statuses]
        branches = [_branch(plan.message, find_signal(plan.message, name)) for name in names]
        start |= {name: _selected(plan.message, name, start[name]) for name in _multiplexers(plan.message)}
        chosen = [b for k, b in enumerate(branches) if b and b not in branches[:k]] or [{}]
        self._starts = [{**start, **branch} for branch in chosen]

    @property
    def at_once(self) -> int:
        """Frames of a cycle."""
        return len(self._starts)

    def frames(self, due_us: int, at_us: int, spacing_us: int, values: Mapping[Place, float]) -> Iterator[Sent]:
        """Those of a cycle that ends at due_us, from at_us on."""
        m, several, length = self._message, len(self._starts), frame_length(self._message)
        number = (due_us // self.every_us - 1) * several + self._counter
        raws = {name: of[0].raw(_mean(of, values)) for name, of in self._by_signal.items()}
        for k, start in enumerate(self._starts):
            data = m.encode({**start, **raws}, scaling=False, strict=False).ljust(length, b"\0")
            if self._data_id is not None:
                counted = bytearray(data)
                counted[1] = counted[1] & 0xF0 | (number + k) % COUNTERS
                data = protect(counted, self._data_id)
            yield Sent(at_us + k * spacing_us, m.frame_id, data, extended=m.is_extended_frame, fd=is_fd(m))


def _mean(claims: Sequence[Claim], values: Mapping[Place, float]) -> float:
    """The physical value of a signal: the mean of what is mapped to it, of the axles that run."""
    physical = [values[place] / c.factor for c in claims for place in c.places if place in values]
    return physical[0] if min(physical) == max(physical) else sum(physical) / len(physical)


def _start(s: Signal) -> float:
    """The raw value of a signal that nobody maps."""
    start = s.raw_initial or 0
    return float(start) if s.is_float else int(start)


def _multiplexers(message: Message) -> list[str]:
    return [s.name for s in message.signals if s.is_multiplexer]


def _branch(message: Message, s: Signal) -> dict[str, int]:
    """What the multiplexers must say in a frame that has a signal."""
    out: dict[str, int] = {}
    while s.multiplexer_signal and s.multiplexer_ids:
        out[s.multiplexer_signal] = s.multiplexer_ids[0]
        s = find_signal(message, s.multiplexer_signal)
    return out


def _selected(message: Message, multiplexer: str, start: float) -> int:
    """A value of a multiplexer that there is: its start value, else the lowest."""
    ids = {k for s in message.signals if s.multiplexer_signal == multiplexer for k in s.multiplexer_ids or ()}
    return int(start) if int(start) in ids or not ids else min(ids)
