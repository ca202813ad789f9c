"""Faults of frames: what happens to them between sender and receiver, or beside them."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from cantools.database.can import Message, Signal

from sim_ecu.play.encoder import SAMPLE_US, SPACING_US, Encoder, Sample, Sent, data_id, databases, protect
from sim_ecu.play.faults import SIGNALS, SILENT, Fault

BESIDE_US = 2_500  # by how much a second sender's frames come later than the first's
SECOND_COUNTER = 7  # at which a second sender begins to count
UNMAPPED_ID = 0x000
ERROR_CLASS = 0x80  # CAN_ERR_BUSERROR of linux/can/error.h
FIRST_PAYLOAD_BIT = 16  # behind CRC, counter and status


def messages(signals: Sequence[str], axle: int) -> dict[int, Message]:
    """By id, the messages that carry signals of an axle."""
    production, _ = databases()
    names = [SIGNALS[s] if s == "speed" else f"{SIGNALS[s]}_A{axle}" for s in signals]
    return {m.frame_id: m for m in map(production.get_message_by_name, names)}


class FrameFault:
    """The frames of a fault's signals, one by one: change() says what becomes of one, beside() what else is sent."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        self.fault, self.other = fault, other
        self.numbers = list(numbers)
        self.messages = messages(fault.signals, fault.axle)
        self.rng = np.random.default_rng(list(seed))
        self.amount = fault.size(fault.signals[0])

    def on(self, due_us: int) -> bool:
        """Whether it acts at that time."""
        return self.fault.on(due_us)

    def take(self, frames: Iterable[Sent]) -> list[Sent]:
        """What becomes of frames."""
        return [out for f in frames for out in (self.change(f) if self.hits(f) else (f,))]

    def hits(self, f: Sent) -> bool:
        """Whether a frame is one of the fault's."""
        return f.can_id in self.messages and self.on(f.due_us)

    def change(self, f: Sent) -> Iterable[Sent]:
        """One of its frames, and what is received instead."""
        return (f,)

    def beside(self, _sample: Sample) -> Iterable[Sent]:
        """What else is sent during a sample."""
        return ()

    def resent(self, f: Sent, data: bytes | bytearray) -> tuple[Sent]:
        """Other contents under a right CRC."""
        return (Sent(f.due_us, f.can_id, protect(data, data_id(self.messages[f.can_id]))),)


class Loss(FrameFault):
    """Lost with a probability."""

    def change(self, f: Sent) -> Iterable[Sent]:
        """Nothing, or the frame."""
        return () if self.rng.random() < self.amount else (f,)


class Burst(FrameFault):
    """All lost."""

    def change(self, _f: Sent) -> Iterable[Sent]:
        """Nothing."""
        return ()


class Silence(Burst):
    """The bus is away: nobody's frames get through."""

    def hits(self, f: Sent) -> bool:
        """Every frame, the truth too."""
        return self.on(f.due_us)


class Crc(FrameFault):
    """A bit of the payload is flipped."""

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with its old CRC."""
        bit = int(self.rng.integers(FIRST_PAYLOAD_BIT, 8 * len(f.data)))
        data = bytearray(f.data)
        data[bit // 8] ^= 1 << bit % 8
        return (Sent(f.due_us, f.can_id, bytes(data)),)


class Counter(FrameFault):
    """The counter stands."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        super().__init__(fault, seed, numbers, other)
        self._stands: dict[int, int] = {}

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with the counter of the first one."""
        data = bytearray(f.data)
        data[1] = data[1] & 0xF0 | self._stands.setdefault(f.can_id, data[1] & 0x0F)
        return self.resent(f, data)


class Dlc(FrameFault):
    """Too short or too long."""

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame cut or filled up."""
        length = min(max(len(f.data) + round(self.amount), 0), 8)
        return (Sent(f.due_us, f.can_id, f.data[:length].ljust(length, b"\0")),)


class NotAvailable(FrameFault):
    """The field's code for not available: the lowest value of a signed one, all ones of an unsigned one."""

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame without a value."""
        message = self.messages[f.can_id]
        values = message.decode(f.data, decode_choices=False, scaling=False)
        assert isinstance(values, dict)
        (signal,) = (s for s in message.signals if s.name not in ("Crc", "Counter", "Status"))
        return self.resent(f, message.encode({**values, signal.name: _no_value(signal)}, scaling=False, strict=False))


def _no_value(s: Signal) -> int:
    return -(1 << s.length - 1) if s.is_signed else (1 << s.length) - 1


class Status(FrameFault):
    """The sender says that it has failed."""

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with the status."""
        data = bytearray(f.data)
        data[1] = round(self.amount) << 4 | data[1] & 0x0F
        return self.resent(f, data)


class Swap(FrameFault):
    """The messages of two axles under each other's ids; the CRCs are those of the senders."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        super().__init__(fault, seed, numbers, other)
        theirs = messages(fault.signals, other)
        self._id = dict(zip(self.messages, theirs, strict=True)) | dict(zip(theirs, self.messages, strict=True))
        self.messages |= theirs

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame under the other's id."""
        return (Sent(f.due_us, self._id[f.can_id], f.data),)


class Delay(FrameFault):
    """Held back. Afterwards what is still held is sent first: no frame overtakes another of its id."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        super().__init__(fault, seed, numbers, other)
        self._last: dict[int, int] = {}

    def hits(self, f: Sent) -> bool:
        """Also a frame that must not overtake."""
        return super().hits(f) or f.due_us <= self._last.get(f.can_id, 0)

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame at its later time."""
        due_us = f.due_us + round(self.amount * 1000) if self.on(f.due_us) else self._last[f.can_id] + SPACING_US
        self._last[f.can_id] = due_us
        return (Sent(due_us, f.can_id, f.data),)


class Sender(FrameFault):
    """Somebody else sends the same messages."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        super().__init__(fault, seed, numbers, other)
        self._encoder = Encoder(self.numbers, truth=False, counter=SECOND_COUNTER)

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """The other's frames."""
        for f in self._encoder.frames(sample.scaled(self.amount)):
            if f.can_id in self.messages:
                yield Sent(f.due_us + BESIDE_US, f.can_id, f.data)


class Babble(FrameFault):
    """A node that does not stop."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> None:
        super().__init__(fault, seed, numbers, other)
        self._copied: Sent | None = None

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame as it is, remembered."""
        self._copied = f
        return (f,)

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """The unmapped id and the copy in turn."""
        for k, due_us in _every(sample.due_us, self.amount):
            if k % 2 == 0:
                yield Sent(due_us, UNMAPPED_ID, bytes(8))
            elif self._copied is not None:
                yield Sent(due_us, self._copied.can_id, self._copied.data)


class ErrorFlood(FrameFault):
    """Error frames, as the controller reports bus errors."""

    def beside(self, sample: Sample) -> Iterator[Sent]:
        """Error frames."""
        for _, due_us in _every(sample.due_us, self.amount):
            yield Sent(due_us, ERROR_CLASS, bytes(8), error=True)


def _every(due_us: int, per_second: float) -> Iterator[tuple[int, int]]:
    """Number and time, within a sample, of what comes so often from the scenario's start on."""
    first, last = (math.ceil(t * per_second / 1e6) for t in (due_us, due_us + SAMPLE_US))
    for k in range(first, last):
        yield k, round(k * 1e6 / per_second)


_CLASSES: dict[str, type[FrameFault]] = {
    "loss": Loss, "burst": Burst, "crc": Crc, "counter": Counter, "dlc": Dlc, "nan": NotAvailable, "status": Status,
    "swap": Swap, "delay": Delay, "sender": Sender, "babble": Babble, "error-flood": ErrorFlood,
    **dict.fromkeys(SILENT, Silence),
}  # fmt: skip


def frame_fault(fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int) -> FrameFault:
    """A fault at work; other is the axle that it swaps with."""
    return _CLASSES[fault.kind](fault, seed, numbers, other)
