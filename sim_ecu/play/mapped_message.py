"""The messages that a configuration maps, as the rig sends them: which value stands in which signal, in which unit,
within what limits, and what the words of value tables mean, which is the rig's own opinion beside the daemon's.

Frames are made by cantools and the autosar-e2e package.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from sim_ecu.play.encoder import COUNTERS, SAMPLE_US, Sent, frame_length, is_fd, protect
from wrcd.bus.dbc import Message, Signal, find_signal
from wrcd.bus.signals import Source
from wrcd.bus.units import Quantity, factor
from wrcd.core.configuration import Input

# letters only, lower case
NO_MEASUREMENT = (
    "notavail", "unavail", "notsupported", "notinstalled", "notvalid", "invalid", "sna", "error", "fault", "fail",
    "init", "undefined", "notdefined", "nodata", "nosignal", "unknown", "reserved", "fehler", "ungueltig", "ungültig",
    "nichtverbaut", "nichtverfuegbar", "nichtverfügbar", "stoerung", "störung", "defekt", "selftest", "selbsttest",
)  # fmt: skip
FAILED = ("error", "fault", "fail", "fehler", "stoerung", "störung", "defekt")
FORWARD, BACKWARD = ("forw", "fwd", "ahead", "vorw"), ("rev", "back", "rück", "rueck")


def letters(label: object) -> str:
    """A word of a value table as lower-case letters."""
    return "".join(c for c in str(label).lower() if c.isalpha())


def says(label: object, words: Iterable[str]) -> bool:
    """Return whether a label has one of some words in it."""
    text = letters(label)
    return any(word in text for word in words)


def no_measurement(s: Signal) -> frozenset[int]:
    """Return the raw values whose label means that there is no measurement."""
    return frozenset(
        int(raw)
        for raw, label in (s.choices or {}).items()
        if letters(label) == "na" or (says(label, NO_MEASUREMENT) and letters(label) != "default")
    )


def forward(s: Signal) -> int | None:
    """Return the raw value of a direction signal that means forwards; None where it has no value table."""
    labelled = {int(raw): label for raw, label in (s.choices or {}).items()}
    for raw, label in labelled.items():
        if says(label, FORWARD):
            return raw
    unusable = no_measurement(s)
    return next((raw for raw, label in labelled.items() if raw not in unusable and not says(label, BACKWARD)), None)


def backward(s: Signal) -> int | None:
    """Return the one that means backwards; None where none does."""
    return next((int(raw) for raw, label in (s.choices or {}).items() if says(label, BACKWARD)), None)


# How often a sensor sends where its DBC does not say.
NATURAL_US = {
    Quantity.YAW_RATE: 5_000, Quantity.LAT_ACCEL: 5_000, Quantity.TORQUE: 10_000, Quantity.BRAKE_TORQUE: 10_000,
    Quantity.SPEED: 20_000,
}  # fmt: skip
SLOW_US = 100_000  # of axle load, wheel radius, direction
MAX_WAYS = 256  # raw values of a direction that are looked at
TORQUES = (Quantity.TORQUE, Quantity.BRAKE_TORQUE)
Place = tuple[Quantity, int, int]  # quantity, number of the axle, part


@dataclass(frozen=True, slots=True)
class Claim:
    """What is mapped to a signal: raw = (value / factor - offset) / scale, value being that of a place in SI units.

    low and high are physical, avoided the raw values that are no measurement.
    """

    message: Message
    signal: Signal
    source: Source
    axles: tuple[int, ...]  # numbers
    scale: float
    offset: float
    factor: float
    low: float
    high: float
    invalid: frozenset[int]  # of them those that the configuration names
    avoided: frozenset[int]
    timeout_us: int

    @property
    def places(self) -> tuple[Place, ...]:
        """Whose values it carries."""
        return tuple((self.source.quantity, n, self.source.part) for n in self.axles)

    @property
    def reach(self) -> tuple[float, float]:
        """The least and the largest value that it can carry, in SI units."""
        ends = self.low * self.factor, self.high * self.factor
        return min(ends), max(ends)

    def raw(self, physical: float) -> float:
        """Return the raw value for a value: the end of its range for what lies beyond, as a converter would."""
        if self.source.quantity is Quantity.DIRECTION and (word := self._ahead()) is not None:
            return word
        raw = (min(max(physical, self.low), self.high) - self.offset) / self.scale
        if self.signal.is_float:
            return raw
        whole, half = round(raw), self.signal.is_signed << self.signal.length - 1
        toward_0, most = -1 if whole > 0 else 1, len(self.avoided) + 1
        near = (*range(whole, whole + most * toward_0, toward_0), *range(whole, whole - most * toward_0, -toward_0))
        fits = (r for r in near if r not in self.avoided and 0 <= r + half < 1 << self.signal.length)
        return next(fits, whole)

    def _ahead(self) -> int | None:
        """Of a direction: the raw value that means forwards, turned round where the factor is below 0; None where the
        value's own sign says it."""
        reverse, turned = self.source.reverse, self.factor < 0.0
        if reverse is None:
            return backward(self.signal) if turned else forward(self.signal)
        raws = (*sorted(reverse), *range(min(1 << self.signal.length, MAX_WAYS)))
        usable = (r for r in raws if r not in self.avoided and self.low <= r * self.scale + self.offset <= self.high)
        return next((r for r in usable if (r in reverse) is turned), None)


def claim(message: Message, signal: Signal, i: Input, axles: Sequence[int]) -> Claim:
    """Of an input of the configuration; axles: the numbers of all that the configuration has."""
    s = i.source
    scale = float(signal.scale) if s.scale is None else s.scale
    offset = float(signal.offset) if s.offset is None else s.offset
    low = signal.minimum if s.low is None else s.low
    high = signal.maximum if s.high is None else s.high
    first, last = -math.inf, math.inf
    if not signal.is_float:
        bits = signal.length - signal.is_signed
        ends = [raw * scale + offset for raw in (-(1 << bits) if signal.is_signed else 0, (1 << bits) - 1)]
        first, last = min(ends), max(ends)
    invalid = frozenset(_fit(signal, raw) for raw in s.invalid)
    return Claim(
        message, signal, s, tuple(axles[place] for place in s.axles), scale, offset,
        factor(signal.unit, s.quantity) if s.factor is None else s.factor,
        first if low is None else max(first, float(low)), last if high is None else min(last, float(high)),
        invalid, invalid | no_measurement(signal), i.timeout_us,
    )  # fmt: skip


def _fit(signal: Signal, raw: int) -> int:
    """A raw value as cantools takes it: 0x8000 of a signed signal of 16 bits is -32768."""
    whole = 1 << signal.length
    return raw - whole if signal.is_signed and not signal.is_float and whole // 2 <= raw < whole else raw


def cycle_us(claims: Sequence[Claim]) -> int:
    """How often the message of some claims is sent: as its DBC says, else as often as its fastest sensor. Not oftener
    than the rig's samples."""
    stated = claims[0].message.cycle_time
    if stated:
        return max(int(stated) * 1000, SAMPLE_US)
    natural = min(min(NATURAL_US.get(c.source.quantity, SLOW_US), c.timeout_us // 3) for c in claims)
    return max(natural // SAMPLE_US * SAMPLE_US, SAMPLE_US)


class Split:
    """The parts that carry the torques of some axles: traction by the first that can say it, braking by all that
    can, each its equal share; what one has no room for goes to the next.

    A signal of several axles carries their mean, and the axles' own signals the rest.
    """

    def __init__(self, claims: Sequence[Claim], axles: Sequence[int]) -> None:
        order = {q: k for k, q in enumerate(TORQUES)}
        of_torque = sorted(
            (c for c in claims if c.source.quantity in TORQUES), key=lambda c: (order[c.source.quantity], c.source.part)
        )
        self._reach: dict[int, dict[Place, tuple[float, float]]] = {n: {} for n in axles}
        by_signal: dict[tuple[str, str], list[tuple[Place, float]]] = {}
        for c in of_torque:
            for place in (p for p in c.places if p[1] in self._reach):
                self._reach[place[1]][place] = c.reach
                by_signal.setdefault((c.message.name, c.signal.name), []).append((place, c.factor))
        self._shared = [group for group in by_signal.values() if len(group) > 1]
        common = {place for group in self._shared for place, _ in group}
        self._own = {
            n: {place: reach for place, reach in of_axle.items() if place not in common}
            for n, of_axle in self._reach.items()
        }

    def parts(self, torques_Nm: Mapping[int, float]) -> dict[Place, float]:
        """The torque of each part, of torques by axle."""
        out: dict[Place, float] = {}
        for n, torque in torques_Nm.items():
            self._give(out, self._reach[n], torque)
        for group in self._shared:
            physical = sum(out[place] / factor for place, factor in group) / len(group)
            out.update({place: physical * factor for place, factor in group})
        for n, torque in torques_Nm.items() if self._shared else ():
            carried = sum(out[place] for place in self._reach[n] if place not in self._own[n])
            self._give(out, self._own[n], torque - carried)
        return out

    @staticmethod
    def _give(out: dict[Place, float], reach: Mapping[Place, tuple[float, float]], torque_Nm: float) -> None:
        """Share a torque out between parts."""
        out.update(dict.fromkeys(reach, 0.0))
        able = [p for p, (low, high) in reach.items() if (low < 0.0 if torque_Nm < 0.0 else high > 0.0)]
        left = torque_Nm
        rounds = (torque_Nm / len(able), None) if able and torque_Nm < 0.0 else (None,)
        for share in rounds:  # each its share, then what is left
            for place in able:
                low, high = reach[place]
                given = min(max(out[place] + (left if share is None else share), low), high)
                left -= given - out[place]
                out[place] = given


Raws = frozenset[int]


@dataclass(slots=True)
class MessagePlan:
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

    def __init__(self, plan: MessagePlan, counter: int = 0) -> None:
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
        start |= {
            s.name: _selected(plan.message, s.name, start[s.name]) for s in plan.message.signals if s.is_multiplexer
        }
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


def _branch(message: Message, s: Signal) -> dict[str, int]:
    """Return what the multiplexers must be in a frame that has a signal."""
    out: dict[str, int] = {}
    while s.multiplexer_signal and s.multiplexer_ids:
        out[s.multiplexer_signal] = s.multiplexer_ids[0]
        s = find_signal(message, s.multiplexer_signal)
    return out


def _selected(message: Message, multiplexer: str, start: float) -> int:
    """A value of a multiplexer that there is: its start value, else the lowest."""
    ids = {k for s in message.signals if s.multiplexer_signal == multiplexer for k in s.multiplexer_ids or ()}
    return int(start) if int(start) in ids or not ids else min(ids)
