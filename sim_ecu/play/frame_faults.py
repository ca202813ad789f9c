"""Faults of frames at work: what happens to frames between sender and receiver, and what is sent beside them."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from sim_ecu.play.encoder import (
    FD_LENGTHS,
    MAX_CLASSICAL,
    SAMPLE_US,
    SPACING_US,
    SensorSample,
    Sent,
    frame_length,
    is_fd,
    protect,
)
from sim_ecu.play.faults import SILENT, Fault
from sim_ecu.play.mapped import Train
from sim_ecu.play.train import PACKAGED, Carrier
from wrcd.bus.dbc import Message
from wrcd.errors import InputError

FIRST_PAYLOAD_BIT = 16  # behind CRC, counter and status
BESIDE_US = 2_500  # by how much a second sender's frames come later than the first's
SECOND_COUNTER = 7  # at which a second sender begins to count
ERROR_CLASS = 0x80  # CAN_ERR_BUSERROR of linux/can/error.h


class FrameFault:
    """The frames of a fault's signals, one by one: take() returns what becomes of them, beside() what else is sent.

    other is the axle that it swaps with. Raises InputError where the train's messages leave no way to make it.
    """

    protected = False  # whether it acts on what E2E protection adds

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        self.fault, self.other, self.train = fault, other, train
        self.numbers = list(numbers)
        self.messages = {c.key: c for c in self._carriers()}
        self.rng = np.random.default_rng(list(seed))
        self.amount = fault.size(fault.signals[0])
        for c in self.messages.values():
            if self.protected and c.data_id is None:
                raise self._error(f"{c.message.name} has no E2E protection, so nothing in it would tell")
        self._prepare()

    def on(self, due_us: int) -> bool:
        """Return whether it acts at that time."""
        return self.fault.on(due_us)

    def take(self, frames: Iterable[Sent]) -> list[Sent]:
        """Return what becomes of frames."""
        return [out for f in frames for out in (self._change(f) if self._hits(f) else (f,))]

    def beside(self, _sample: SensorSample) -> Iterable[Sent]:
        """Return what else is sent during a sample."""
        return ()

    def _carriers(self) -> list[Carrier]:
        """Return the messages that it is about."""
        return self.train.carriers(self.fault.signals, self.fault.axle)

    def _prepare(self) -> None:
        """Check the messages, and make what is needed."""

    def _hits(self, f: Sent) -> bool:
        return f.key in self.messages and not f.error and self.on(f.due_us)

    def _change(self, f: Sent) -> Iterable[Sent]:
        """Return what is received instead of one of its frames."""
        return (f,)

    def _error(self, reason: str, hint: str = "") -> InputError:
        return InputError(reason, key=f"fault {self.fault.kind}", hint=hint or "sim-ecu list names others")

    def _resent(self, f: Sent, data: bytes | bytearray) -> tuple[Sent]:
        """Return other contents under a right CRC."""
        identity = self.messages[f.key].data_id
        return (f._replace(data=bytes(data) if identity is None else protect(data, identity)),)

    def _written(self, f: Sent, values: Mapping[str, float]) -> tuple[Sent]:
        """Return the frame with other raw values of some signals, those of them that it has."""
        message = self.messages[f.key].message
        read = message.decode(f.data, decode_choices=False, scaling=False)
        assert isinstance(read, dict)
        changed: dict[str, Any] = {**read, **{name: raw for name, raw in values.items() if name in read}}
        return self._resent(f, message.encode(changed, scaling=False, strict=False).ljust(len(f.data), b"\0"))


class _Loss(FrameFault):
    def _change(self, f: Sent) -> Iterable[Sent]:
        return () if self.rng.random() < self.amount else (f,)


class _Burst(FrameFault):
    def _change(self, _f: Sent) -> Iterable[Sent]:
        return ()


class _Silence(_Burst):
    """The bus is away: nobody's frames get through, the truth neither."""

    def _carriers(self) -> list[Carrier]:
        return []

    def _hits(self, f: Sent) -> bool:
        return self.on(f.due_us)


class _Crc(FrameFault):
    """A bit of the payload is flipped under the old CRC."""

    protected = True

    def _change(self, f: Sent) -> Iterable[Sent]:
        bit = int(self.rng.integers(FIRST_PAYLOAD_BIT, 8 * len(f.data)))
        data = bytearray(f.data)
        data[bit // 8] ^= 1 << bit % 8
        return (f._replace(data=bytes(data)),)


class _Counter(FrameFault):
    """The counter stays that of the first frame."""

    protected = True

    def _prepare(self) -> None:
        self._stands: dict[int, int] = {}

    def _change(self, f: Sent) -> Iterable[Sent]:
        data = bytearray(f.data)
        data[1] = data[1] & 0xF0 | self._stands.setdefault(f.key, data[1] & 0x0F)
        return self._resent(f, data)


class _Dlc(FrameFault):
    """Frames are cut or filled up."""

    def _prepare(self) -> None:
        for c in self.messages.values():
            length = frame_length(c.message)
            if self._length(length, is_fd(c.message)) == length:
                raise self._error(f"{c.message.name} cannot be longer than {length} bytes", "amount=-1")

    def _length(self, length: int, fd: bool) -> int:
        """Return the new length; that of a CAN FD frame is the next one that there is."""
        wanted = length + round(self.amount)
        if not fd:
            return min(max(wanted, 0), MAX_CLASSICAL)
        if wanted > length:
            return min((n for n in FD_LENGTHS if n >= wanted), default=64)
        return length if wanted == length else max((n for n in FD_LENGTHS if n <= wanted), default=0)

    def _change(self, f: Sent) -> Iterable[Sent]:
        length = self._length(len(f.data), f.fd)
        return (f._replace(data=f.data[:length].ljust(length, b"\0")),)


class _NotAvailable(FrameFault):
    """The field's code for not available: as the DBC or the configuration says, else the lowest value of a signed one,
    all ones of an unsigned one."""

    def _prepare(self) -> None:
        for c in self.messages.values():
            for name in (name for name, code in c.not_available.items() if code is None):
                raise self._error(
                    f"{c.message.name}.{name} has no raw value that says not available", "give it an `invalid` one"
                )

    def _change(self, f: Sent) -> Iterable[Sent]:
        codes = self.messages[f.key].not_available
        return self._written(f, {name: code for name, code in codes.items() if code is not None})


class _Status(FrameFault):
    """The sender reports that it has failed."""

    def _prepare(self) -> None:
        self._codes: dict[int, dict[str, float]] = {}
        for key, c in self.messages.items():
            if c.status is None:
                raise self._error(f"{c.message.name} has no status that counts", "give it one: status and ok")
            code = c.failed if self.fault.amount is None else round(self.fault.amount)
            if code is None or not 0 <= code < 1 << c.status.length:
                raise self._error(
                    f"{c.message.name}.{c.status.name} has no code {'that fails' if code is None else code}"
                )
            self._codes[key] = {c.status.name: code}

    def _carriers(self) -> list[Carrier]:
        return self.train.statuses(self.fault.signals, self.fault.axle)

    def _change(self, f: Sent) -> Iterable[Sent]:
        return self._written(f, self._codes[f.key])


class _Swap(FrameFault):
    """The messages of two axles under each other's ids; the CRCs are those of the senders."""

    def _prepare(self) -> None:
        axle, other = self.fault.axle, self.other
        theirs = {c.key: c for c in self.train.carriers(self.fault.signals, other)}
        if both := self.messages.keys() & theirs.keys():
            name = self.messages[min(both)].message.name
            raise self._error(f"{name} carries axle {axle} and axle {other}", "swap-wiring swaps within it")
        pairs = list(zip(self.messages.values(), theirs.values(), strict=False))
        if len(self.messages) != len(theirs) or any(_form(a.message) != _form(b.message) for a, b in pairs):
            raise self._error(f"the messages of axle {axle} and axle {other} are not alike")
        self._others = {x.key: y.message for a, b in pairs for x, y in ((a, b), (b, a))}
        self.messages |= theirs

    def _change(self, f: Sent) -> Iterable[Sent]:
        m = self._others[f.key]
        return (f._replace(can_id=m.frame_id, extended=m.is_extended_frame, fd=is_fd(m)),)


class _Delay(FrameFault):
    """Held back. Afterwards what is still held is sent first: no frame overtakes another of its id."""

    def _prepare(self) -> None:
        self._last: dict[int, int] = {}

    def _hits(self, f: Sent) -> bool:
        return super()._hits(f) or f.due_us <= self._last.get(f.key, 0)

    def _change(self, f: Sent) -> Iterable[Sent]:
        due_us = f.due_us + round(self.amount * 1000) if self.on(f.due_us) else self._last[f.key] + SPACING_US
        self._last[f.key] = due_us
        return (f._replace(due_us=due_us),)


class _Sender(FrameFault):
    """Somebody else sends the same messages."""

    def _prepare(self) -> None:
        self._encoder = self.train.encoder(self.numbers, truth=False, counter=SECOND_COUNTER)

    def beside(self, sample: SensorSample) -> Iterator[Sent]:
        for f in self._encoder.frames(sample.scaled(self.amount)):
            if f.key in self.messages:
                yield f._replace(due_us=f.due_us + BESIDE_US)


class _Babble(FrameFault):
    """A node that does not stop: an unmapped id, and a copy of its last frame, in turn."""

    def _prepare(self) -> None:
        self._copied: Sent | None = None

    def _change(self, f: Sent) -> Iterable[Sent]:
        self._copied = f
        return (f,)

    def beside(self, sample: SensorSample) -> Iterator[Sent]:
        for k, due_us in _every(sample.due_us, self.amount):
            if k % 2 == 0:
                yield Sent(due_us, self.train.idle_id, bytes(8))
            elif self._copied is not None:
                yield self._copied._replace(due_us=due_us)


class _ErrorFlood(FrameFault):
    """Error frames, as the controller reports bus errors."""

    def _carriers(self) -> list[Carrier]:
        return []

    def beside(self, sample: SensorSample) -> Iterator[Sent]:
        for _, due_us in _every(sample.due_us, self.amount):
            yield Sent(due_us, ERROR_CLASS, bytes(8), error=True)


def _every(due_us: int, per_second: float) -> Iterator[tuple[int, int]]:
    """Yield number and time, within a sample, of what comes so often from the scenario's start on."""
    first, last = (math.ceil(t * per_second / 1e6) for t in (due_us, due_us + SAMPLE_US))
    for k in range(first, last):
        yield k, round(k * 1e6 / per_second)


def _form(m: Message) -> tuple[int, bool]:
    """Return length and kind of a message's frames."""
    return frame_length(m), is_fd(m)


_CLASSES: dict[str, type[FrameFault]] = {
    "loss": _Loss, "burst": _Burst, "crc": _Crc, "counter": _Counter, "dlc": _Dlc, "nan": _NotAvailable,
    "status": _Status, "swap": _Swap, "delay": _Delay, "sender": _Sender, "babble": _Babble,
    "error-flood": _ErrorFlood, **dict.fromkeys(SILENT, _Silence),
}  # fmt: skip


def frame_fault(
    fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train = PACKAGED
) -> FrameFault:
    """Return a fault at work. Raises InputError where the train leaves no way to it."""
    return _CLASSES[fault.kind](fault, seed, numbers, other, train)
