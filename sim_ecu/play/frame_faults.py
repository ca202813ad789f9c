"""Faults of frames: what happens to them between sender and receiver."""

from collections.abc import Iterable, Sequence

from cantools.database.can import Message

from sim_ecu.play.encoder import FD_LENGTHS, MAX_CLASSICAL, SPACING_US, Sent, frame_length, is_fd
from sim_ecu.play.fault_at_work import FrameFault
from sim_ecu.play.faults import SILENT, Fault
from sim_ecu.play.frames_beside import Babble, ErrorFlood, Sender
from sim_ecu.play.train import PACKAGED, Carrier, Train

FIRST_PAYLOAD_BIT = 16  # behind CRC, counter and status


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

    def carriers(self) -> list[Carrier]:
        """It is of no message."""
        return []

    def hits(self, f: Sent) -> bool:
        """Every frame, the truth too."""
        return self.on(f.due_us)


class Crc(FrameFault):
    """A bit of the payload is flipped."""

    protected = True

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with its old CRC."""
        bit = int(self.rng.integers(FIRST_PAYLOAD_BIT, 8 * len(f.data)))
        data = bytearray(f.data)
        data[bit // 8] ^= 1 << bit % 8
        return (f._replace(data=bytes(data)),)


class Counter(FrameFault):
    """The counter stands."""

    protected = True

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        self._stands: dict[int, int] = {}

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with the counter of the first one."""
        data = bytearray(f.data)
        data[1] = data[1] & 0xF0 | self._stands.setdefault(f.key, data[1] & 0x0F)
        return self.resent(f, data)


class Dlc(FrameFault):
    """Too short or too long."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        for c in self.messages.values():
            length = frame_length(c.message)
            if self._length(length, is_fd(c.message)) == length:
                raise self.error(f"{c.message.name} cannot be longer than {length} bytes", "amount=-1")

    def _length(self, length: int, fd: bool) -> int:
        """The new length; that of a CAN FD frame is the next one that there is."""
        wanted = length + round(self.amount)
        if not fd:
            return min(max(wanted, 0), MAX_CLASSICAL)
        steps = [n for n in FD_LENGTHS if (n >= wanted if wanted > length else n <= wanted)]
        return (min(steps, default=64) if wanted > length else max(steps, default=0)) if wanted != length else length

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame cut or filled up."""
        length = self._length(len(f.data), f.fd)
        return (f._replace(data=f.data[:length].ljust(length, b"\0")),)


class NotAvailable(FrameFault):
    """The field's code for not available: as the DBC or the configuration says, else the lowest value of a signed one,
    all ones of an unsigned one."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        for c in self.messages.values():
            for name, code in c.not_available.items():
                if code is None:
                    raise self.error(
                        f"{c.message.name}.{name} has no raw value that says not available", "give it an `invalid` one"
                    )

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame without a value."""
        codes = self.messages[f.key].not_available
        return self.written(f, {name: code for name, code in codes.items() if code is not None})


class Status(FrameFault):
    """The sender says that it has failed."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        self._codes: dict[int, dict[str, float]] = {}
        for key, c in self.messages.items():
            if c.status is None:
                raise self.error(f"{c.message.name} has no status that counts", "give it one: status and ok")
            code = c.failed if fault.amount is None else round(fault.amount)
            if code is None or not 0 <= code < 1 << c.status.length:
                raise self.error(
                    f"{c.message.name}.{c.status.name} has no code {'that fails' if code is None else code}"
                )
            self._codes[key] = {c.status.name: code}

    def carriers(self) -> list[Carrier]:
        """The messages that carry the statuses."""
        return self.train.statuses(self.fault.signals, self.fault.axle)

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame with the status."""
        return self.written(f, self._codes[f.key])


class Swap(FrameFault):
    """The messages of two axles under each other's ids; the CRCs are those of the senders."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        theirs = {c.key: c for c in train.carriers(fault.signals, other)}
        if both := self.messages.keys() & theirs.keys():
            name = self.messages[min(both)].message.name
            raise self.error(f"{name} carries axle {fault.axle} and axle {other}", "swap-wiring swaps within it")
        pairs = list(zip(self.messages.values(), theirs.values(), strict=False))
        if len(self.messages) != len(theirs) or any(_form(a.message) != _form(b.message) for a, b in pairs):
            raise self.error(f"the messages of axle {fault.axle} and axle {other} are not alike")
        self._others = {x.key: y.message for a, b in pairs for x, y in ((a, b), (b, a))}
        self.messages |= theirs

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame under the other's id."""
        m = self._others[f.key]
        return (f._replace(can_id=m.frame_id, extended=m.is_extended_frame, fd=is_fd(m)),)


class Delay(FrameFault):
    """Held back. Afterwards what is still held is sent first: no frame overtakes another of its id."""

    def __init__(self, fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train) -> None:
        super().__init__(fault, seed, numbers, other, train)
        self._last: dict[int, int] = {}

    def hits(self, f: Sent) -> bool:
        """Also a frame that must not overtake."""
        return super().hits(f) or f.due_us <= self._last.get(f.key, 0)

    def change(self, f: Sent) -> Iterable[Sent]:
        """The frame at its later time."""
        due_us = f.due_us + round(self.amount * 1000) if self.on(f.due_us) else self._last[f.key] + SPACING_US
        self._last[f.key] = due_us
        return (f._replace(due_us=due_us),)


def _form(m: Message) -> tuple[int, bool]:
    """Length and kind of a message's frames."""
    return frame_length(m), is_fd(m)


_CLASSES: dict[str, type[FrameFault]] = {
    "loss": Loss, "burst": Burst, "crc": Crc, "counter": Counter, "dlc": Dlc, "nan": NotAvailable, "status": Status,
    "swap": Swap, "delay": Delay, "sender": Sender, "babble": Babble, "error-flood": ErrorFlood,
    **dict.fromkeys(SILENT, Silence),
}  # fmt: skip


def frame_fault(
    fault: Fault, seed: Sequence[int], numbers: Sequence[int], other: int, train: Train = PACKAGED
) -> FrameFault:
    """A fault at work; other is the axle that it swaps with. Raises InputError where the train leaves no way to it."""
    return _CLASSES[fault.kind](fault, seed, numbers, other, train)
