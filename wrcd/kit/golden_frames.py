"""The CAN frames of a track: what a configuration's sensors send on it, with what goes wrong on a bus."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped, MappedMessage, MappedSignal
from wrcd.bus.positions import fit_raw
from wrcd.bus.signals import Output
from wrcd.bus.units import Quantity
from wrcd.bus.writers import Writer
from wrcd.core.configuration import Config, Input
from wrcd.core.records import Ticks

MEASURED = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)  # sent in every tick
# Of all frames, the first and each so-manieth after it: not sent, twice, with a bit turned over, asked for, too short
_LOST, _TWICE, _DAMAGED, _REMOTE, _SHORT = (307, 307), (400, 401), (100, 211), (500, 503), (600, 601)


def frames(config: Config, mapped: Mapped, ticks: Ticks) -> Iterator[list[Frame]]:
    """Those of each tick, by their time stamps."""
    period_us = round(config.design.tick_s * 1e6)
    senders = [_MessageOfTrack(config, mapped, m, period_us) for m in mapped.messages]
    apart_us = period_us // (1 + sum(s.frames for s in senders))
    sent = 0
    for k in range(len(ticks)):
        at_us, of_tick = (ticks.number + k) * period_us, list[Frame]()
        for sender in (s for s in senders if k % s.every == 0):
            for frame in sender.send(ticks, k):
                sent, at_us = sent + 1, at_us + apart_us
                of_tick += _on_the_bus(replace(frame, stamp_us=at_us), sent, sender.is_protected)
        yield of_tick


def _on_the_bus(f: Frame, number: int, is_protected: bool) -> list[Frame]:
    """What becomes of a frame. Without E2E nobody would see a bit that is turned over."""
    lost, twice, damaged, remote, short = (
        number >= first and (number - first) % every == 0 for first, every in (_LOST, _TWICE, _DAMAGED, _REMOTE, _SHORT)
    )
    if damaged and is_protected:
        f = replace(f, data=f.data[:-1] + bytes([f.data[-1] ^ 0x40]))
    if remote and not f.fd:
        f = replace(f, data=b"", remote=True, extra=len(f.data))
    if short:
        f = replace(f, data=f.data[:-1])
    return [] if lost else [f, f] if twice else [f]


class _MessageOfTrack:
    """A mapped message, as its sensors send it: a frame for each choice of its multiplexers."""

    def __init__(self, config: Config, mapped: Mapped, m: MappedMessage, period_us: int) -> None:
        self._config, self._inputs, self._counter = config, config.inputs, 0
        message, self._signals = find_message(config.database, m.name), m.signals
        self._writer = Writer(message, Output(m.name, 0, m.data_id))
        statuses = [s for rule, s in mapped.statuses.items() if rule.message == m.name]
        self._statuses = {
            s.rule.signal: fit_raw(find_signal(message, s.rule.signal), min(s.rule.ok or s.rule.degraded))
            for s in statuses
        }
        branches = [*(s.branch for s in m.signals), *(s.branch for s in statuses)]
        choices = [{name: min(ids) for name, _, ids in branch.conditions} for branch in branches]
        self._choices = [c for k, c in enumerate(choices) if c not in choices[:k]]
        after_us = min([config.inputs[s.number].timeout_us for s in m.signals] + [s.timeout_us for s in statuses])
        self.is_protected = m.data_id is not None
        measured = any(s.source.quantity in MEASURED for s in m.signals)
        self.every = 1 if measured else max(1, after_us // 3 // period_us)  # ticks

    @property
    def frames(self) -> int:
        """Of a tick in which it sends."""
        return len(self._choices)

    def send(self, ticks: Ticks, k: int) -> Iterator[Frame]:
        """Its frames of a tick; none where a value is not present."""
        values = {s.source.signal: (s, self._value(self._inputs[s.number], ticks, k)) for s in self._signals}
        present = all(value == value for _, value in values.values())
        for choice in self._choices if present else ():
            raws = {name: raw_of(s, value) for name, (s, value) in values.items()}
            yield self._writer.raw_frame(0, self._counter, {**raws, **self._statuses, **choice})
            self._counter += 1

    def _value(self, i: Input, ticks: Ticks, k: int) -> float:
        """In SI units; of a signal of several axles that of the first."""
        design, axle = self._config.design, i.source.axles[0]
        known = {
            Quantity.YAW_RATE: ticks.z[k, 0, axle], Quantity.LAT_ACCEL: ticks.z[k, 1, axle],
            Quantity.TORQUE: ticks.torque_ratio[k, axle] * 2 * design.normal_N * design.r_0,
            Quantity.SPEED: ticks.speeds_m_s[k], Quantity.AXLE_LOAD: 2 * design.normal_N,
            Quantity.WHEEL_RADIUS: design.r_0, Quantity.DIRECTION: 1.0,
        }  # fmt: skip
        return 0.0 if i.source.part else float(known.get(i.source.quantity, 0.0))


def raw_of(s: MappedSignal, si: float) -> float:
    """A signal's raw value nearest to an SI value that is usable; of a direction, one that means ahead."""
    lowest, highest = -s.field.position.sign, s.field.position.mask - s.field.position.sign
    if s.source.quantity is Quantity.DIRECTION:
        raws: list[int] = [*s.words, *range(max(lowest, -128), min(highest, 255) + 1)]
        return next(filter(partial(_is_ahead, s), raws), 0)
    raw = float((si / s.factor - s.offset) / s.scale)
    if s.field.is_float:
        return raw
    whole: int = min(max(round(raw), lowest), highest)
    near = (whole + sign * k for k in range(len(s.unusable) + 1) for sign in (-1, 1))
    return next((r for r in near if lowest <= r <= highest and r not in s.unusable), whole)


def _is_ahead(s: MappedSignal, raw: int) -> bool:
    physical = raw * s.scale + s.offset
    is_reverse = s.words.get(raw, not s.only_words and physical < 0.0)
    return raw not in s.unusable and s.low <= physical <= s.high and is_reverse == (s.factor < 0.0)
