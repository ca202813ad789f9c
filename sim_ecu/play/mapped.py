"""The train that a configuration maps: which of its messages are sent when, and what faults need to know of them.

One general way, frame by frame. What the configuration does not map stays at its start value.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import (
    FAST_SPACING_US,
    MAX_SLOW_AXLES,
    SAMPLE_US,
    SPACING_US,
    Channel,
    SensorSample,
    Sent,
    databases,
    is_fd,
    message_key,
)
from sim_ecu.play.mapped_message import Claim, MessagePlan, Messages, Place, Split, claim
from sim_ecu.play.train import Carrier, PackagedTrain, end_of_field
from wrcd.bus.dbc import Message, data_id, find_message, find_signal
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.errors import InputError


class MappedEncoder:
    """All frames of a mapped train, sample by sample."""

    def __init__(
        self, messages: Sequence[Messages | Channel], truth_of: Mapping[Channel, int], split: Split,
        constants: Mapping[Place, float], spacing_us: int,
    ) -> None:  # fmt: skip
        self._messages, self._truth_of = messages, truth_of
        self._split, self._constants, self._spacing_us = split, constants, spacing_us

    def frames(self, sample: SensorSample) -> Iterator[Sent]:
        """The frames of a sample, each message at its own cycle, or at the first sample after it."""
        at = due_us = sample.due_us
        values: dict[Place, float] = {}
        for messages in self._messages:
            if due_us // messages.every_us == (due_us - SAMPLE_US) // messages.every_us:
                continue
            if isinstance(messages, Channel):
                r = next(r for r in sample.readings if r.number == self._truth_of[messages])
                yield messages.encode(due_us, r.truth)._replace(due_us=at)
                at += self._spacing_us
                continue
            values = values or self._values(sample)
            for frame in messages.frames(due_us, at, self._spacing_us, values):
                yield frame
                at += self._spacing_us

    def _values(self, sample: SensorSample) -> dict[Place, float]:
        values = dict(self._constants)
        for r in sample.readings:
            values[Quantity.YAW_RATE, r.number, 0] = r.yaw_rate
            values[Quantity.LAT_ACCEL, r.number, 0] = r.lat_accel
            values[Quantity.SPEED, r.number, 0] = sample.speed_m_s
        return values | self._split.parts({r.number: r.torque for r in sample.readings})


class MappedTrain:
    """The messages that a configuration maps. wheelset: whose load and wheel radius they report."""

    def __init__(self, config: Config, wheelset: Wheelset) -> None:
        self._file, self._database = config.file, config.database
        self._constant = {
            Quantity.AXLE_LOAD: 2 * wheelset.normal_N,
            Quantity.WHEEL_RADIUS: wheelset.r_0,
            Quantity.DIRECTION: 1.0,
        }
        self._axles = [a.number for a in config.axles]
        self._plans: dict[str, MessagePlan] = {}
        for i in config.inputs:
            message = find_message(config.database, i.source.message)
            found = claim(message, find_signal(message, i.source.signal), i, self._axles)
            self._plan(config, message.name).claims.append(found)
            for rule in found.source.statuses or ():
                plan = self._plan(config, rule.message)
                known = plan.statuses.get(rule.signal, rule.ok)
                if not known & rule.ok:
                    raise InputError(
                        f"the rules of {rule.message}.{rule.signal} leave no value that is good for all",
                        file=self._file, key=i.source.quantity.key,
                    )  # fmt: skip
                plan.statuses[rule.signal] = known & rule.ok
                plan.degraded[rule.signal] = plan.degraded.get(rule.signal, frozenset()) | rule.degraded
                plan.of_status.append(found)
        used = {message_key(m) for m in self._database.messages}
        self.idle_id = next(k for k in range(1 << 11) if k not in used)

    @property
    def has_fd(self) -> bool:
        """Whether any of its messages is a CAN FD one."""
        return any(is_fd(plan.message) for plan in self._plans.values())

    def _plan(self, config: Config, name: str) -> MessagePlan:
        if name not in self._plans:
            message = find_message(config.database, name)
            stated = config.data_ids[name] if name in config.data_ids else data_id(message)
            self._plans[name] = MessagePlan(message, data_id=stated)
        return self._plans[name]

    def encoder(self, numbers: Sequence[int], truth: bool = True, counter: int = 0) -> MappedEncoder:
        """Of some of the configuration's axles."""
        for n in numbers:
            if n not in self._axles:
                raise InputError(
                    f"maps no axle {n}, which the scenario has", file=self._file, key="axle",
                    hint=f"it maps {', '.join(map(str, self._axles))}: write [[axle]], or other axles in the scenario",
                )  # fmt: skip
        messages: list[Messages | Channel] = []
        truth_of: dict[Channel, int] = {}
        begun: set[str] = set()

        def begin(plans: Sequence[MessagePlan]) -> None:
            for plan in plans:
                if plan.message.name not in begun:
                    begun.add(plan.message.name)
                    messages.append(Messages(self._only(plan, numbers), counter))

        for n in numbers:
            of_axle = (Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.BRAKE_TORQUE)
            for q in (*of_axle, Quantity.AXLE_LOAD, Quantity.WHEEL_RADIUS):
                begin(self._of(q.key, n))
            if truth:
                channel = Channel(self._truth_message(n))
                truth_of[channel] = n
                messages.append(channel)
        for q in (Quantity.SPEED, Quantity.DIRECTION):
            begin(self._of(q.key, numbers[0]))
        split = Split([c for plan in self._plans.values() for c in plan.claims], numbers)
        constants = {(q, n, 0): value for q, value in self._constant.items() for n in numbers}
        most = SPACING_US if len(numbers) <= MAX_SLOW_AXLES else FAST_SPACING_US
        together = sum(m.at_once if isinstance(m, Messages) else 1 for m in messages)
        return MappedEncoder(messages, truth_of, split, constants, min(most, SAMPLE_US // (together + 1)))

    def _of(self, signal: str, axle: int) -> list[MessagePlan]:
        """The messages of a quantity of an axle, and behind them those of its statuses."""
        carrying = [p for p in self._plans.values() if _carries(p.claims, signal, axle)]
        return carrying + [p for p in self._plans.values() if _carries(p.of_status, signal, axle)]

    @staticmethod
    def _only(plan: MessagePlan, numbers: Sequence[int]) -> MessagePlan:
        """Without the signals of axles that do not run: they stay at their start value."""
        running = [c for c in plan.claims if any(n in numbers for n in c.axles)]
        return replace(plan, claims=running)

    def _truth_message(self, axle: int) -> Message:
        truth = databases()[1].get_message_by_name(f"SimTruth_A{axle}")
        taken = next((m for m in self._database.messages if message_key(m) == message_key(truth)), None)
        if taken is not None and taken.name != truth.name:
            raise InputError(
                f"{taken.name} has the id 0x{truth.frame_id:X}, with which the rig sends the truth of axle {axle}",
                file=self._file, hint="--no-truth leaves the truth out",
            )  # fmt: skip
        return truth

    def carriers(self, signals: Sequence[str], axle: int) -> list[Carrier]:
        """The messages that carry signals of an axle."""
        codes: dict[str, dict[str, float | None]] = {}
        for signal in signals:
            for plan in self._mapped(signal, axle):
                of_signal = [c for c in plan.claims if c.source.quantity.key == signal and axle in c.axles]
                codes.setdefault(plan.message.name, {}).update({c.signal.name: not_available(c) for c in of_signal})
        return [Carrier(self._plans[name].message, self._plans[name].data_id, of) for name, of in codes.items()]

    def statuses(self, signals: Sequence[str], axle: int) -> list[Carrier]:
        """The messages that say how the senders of these are; the messages themselves where nothing says it."""
        out: dict[str, Carrier] = {}
        for signal in signals:
            mapped = self._mapped(signal, axle)
            saying = [p for p in self._plans.values() if p.statuses and _carries(p.of_status, signal, axle)]
            for plan in saying or mapped:
                name = self._status_of(plan, signal, axle)
                status = None if name is None else find_signal(plan.message, name)
                usable = frozenset() if name is None else plan.statuses[name] | plan.degraded[name]
                out[plan.message.name] = Carrier(plan.message, plan.data_id, {}, status, usable)
        return list(out.values())

    def _status_of(self, plan: MessagePlan, signal: str, axle: int) -> str | None:
        """The status in a message that is about an axle's signal: with multiplexers another axle has another one."""
        about = [c for c in plan.of_status if c.source.quantity.key == signal and axle in c.axles]
        return next(
            (r.signal for c in about for r in (c.source.statuses or ()) if r.message == plan.message.name), None
        )

    def cycle_us(self, signal: str, axle: int) -> int:
        """Return the cycle of the message that carries it."""
        return min(plan.every_us for plan in self._mapped(signal, axle))

    def _mapped(self, signal: str, axle: int) -> list[MessagePlan]:
        """The messages of a fault's signal."""
        found = [p for p in self._plans.values() if _carries(p.claims, signal, axle)]
        if not found:
            raise InputError(
                f"is not mapped for axle {axle}: nothing of it can be at fault", file=self._file, key=signal
            )
        return found


Train: TypeAlias = PackagedTrain | MappedTrain


def not_available(c: Claim) -> float | None:
    """Return the raw value that stands for not available; None where no value is left for that."""
    if c.avoided:
        return min(c.invalid or c.avoided)
    if c.signal.is_float:
        return math.nan
    end = end_of_field(c.signal)
    return None if c.low <= end * c.scale + c.offset <= c.high else end


def _carries(claims: Sequence[Claim], signal: str, axle: int) -> bool:
    return any(c.source.quantity.key == signal and axle in c.axles for c in claims)
