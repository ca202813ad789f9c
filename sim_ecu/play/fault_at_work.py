"""A fault of frames at work: which of the train's messages it is about, and what it can do with a frame."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from sim_ecu.play.encoder import Sample, Sent, protect
from sim_ecu.play.faults import Fault
from sim_ecu.play.train import Carrier, Train
from wrcd.errors import InputError


class FrameFault:
    """The frames of a fault's signals, one by one: change() says what becomes of one, beside() what else is sent.

    Raises InputError where the train's messages leave no way to make it.
    """

    protected = False  # whether it acts on what E2E protection adds

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        self.fault, self.other, self.train = fault, other, train
        self.numbers = list(numbers)
        self.messages = {c.key: c for c in self.carriers()}
        self.rng = np.random.default_rng(list(seed))
        self.amount = fault.size(fault.signals[0])
        for c in self.messages.values():
            if self.protected and c.data_id is None:
                raise self.error(f"{c.message.name} has no E2E protection, so nothing in it would tell")

    def carriers(self) -> list[Carrier]:
        """The messages that it is about."""
        return self.train.carriers(self.fault.signals, self.fault.axle)

    def error(self, reason: str, hint: str = "") -> InputError:
        """That it cannot be made."""
        return InputError(reason, key=f"fault {self.fault.kind}", hint=hint or "sim-ecu inject --list names others")

    def on(self, due_us: int) -> bool:
        """Whether it acts at that time."""
        return self.fault.on(due_us)

    def take(self, frames: Iterable[Sent]) -> list[Sent]:
        """What becomes of frames."""
        return [out for f in frames for out in (self.change(f) if self.hits(f) else (f,))]

    def hits(self, f: Sent) -> bool:
        """Whether a frame is one of the fault's."""
        return f.key in self.messages and not f.error and self.on(f.due_us)

    def change(self, f: Sent) -> Iterable[Sent]:
        """One of its frames, and what is received instead."""
        return (f,)

    def beside(self, _sample: Sample) -> Iterable[Sent]:
        """What else is sent during a sample."""
        return ()

    def resent(self, f: Sent, data: bytes | bytearray) -> tuple[Sent]:
        """Other contents under a right CRC."""
        identity = self.messages[f.key].data_id
        return (f._replace(data=bytes(data) if identity is None else protect(data, identity)),)

    def written(self, f: Sent, values: Mapping[str, float]) -> tuple[Sent]:
        """The same frame with other raw values of some signals, those of them that it has."""
        message = self.messages[f.key].message
        read = message.decode(f.data, decode_choices=False, scaling=False)
        assert isinstance(read, dict)
        changed: dict[str, Any] = {**read, **{name: raw for name, raw in values.items() if name in read}}
        return self.resent(f, message.encode(changed, scaling=False, strict=False).ljust(len(f.data), b"\0"))
