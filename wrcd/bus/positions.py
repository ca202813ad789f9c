"""Where a signal lies in a frame: worked out once; a frame is then one whole number that is shifted and masked."""

import struct
from typing import Literal, NamedTuple

from wrcd.bus.dbc import CLASSICAL_BYTES, Message, Signal, find_signal
from wrcd.bus.frame import EXTENDED

MAX_BITS = 64  # of a signal that is mapped
Order = Literal["little", "big"]

_FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)  # that a DLC of CAN FD can say
_FLOATS = {16: "<e", 32: "<f", 64: "<d"}


class Position(NamedTuple):
    """Where a signal's bits lie: shift and mask of the frame as one whole number, and its sign bit (0: none)."""

    order: Order
    shift: int
    mask: int
    sign: int

    def raw(self, frame: int) -> int:
        """The raw value."""
        raw = (frame >> self.shift) & self.mask
        return raw - ((raw & self.sign) << 1)


class Numbers:
    """A frame's data as one whole number, in either byte order."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._known: dict[Order, int] = {}

    def of(self, order: Order) -> int:
        """With the first byte lowest (little) or highest."""
        number = self._known.get(order)
        if number is None:
            number = self._known[order] = int.from_bytes(self._data, order)
        return number


class Field:
    """A signal in a frame, coded as a whole number or as a floating-point one."""

    def __init__(self, signal: Signal, length: int) -> None:
        self.position = position(signal, length)
        self._float = _FLOATS.get(signal.length) if signal.is_float else None

    @property
    def is_float(self) -> bool:
        """Whether it is coded as a floating-point number."""
        return self._float is not None

    def holds(self, raw: int) -> bool:
        """Whether a whole number is one of its raw values; a float's are whole only up to 63 bits here."""
        sign, mask = (1 << 63, (1 << 64) - 1) if self.is_float else (self.position.sign, self.position.mask)
        return -sign <= raw <= mask - sign

    def raw(self, numbers: Numbers) -> int | float:
        """The raw value in a frame."""
        raw = self.position.raw(numbers.of(self.position.order))
        if self._float is None:
            return raw
        bits = raw & self.position.mask
        value: float = struct.unpack(self._float, bits.to_bytes(struct.calcsize(self._float), "little"))[0]
        return value


class Branch:
    """What a frame's multiplexers must say for it to carry a signal. Without one it always does."""

    def __init__(self, message: Message, signal: Signal, length: int) -> None:
        self.conditions: list[tuple[str, Position, frozenset[int]]] = []
        while signal.multiplexer_signal is not None and len(self.conditions) < len(message.signals):
            ids = frozenset(signal.multiplexer_ids or ())
            signal = find_signal(message, signal.multiplexer_signal)
            self.conditions.append((signal.name, position(signal, length), ids))

    def carried(self, numbers: Numbers) -> bool:
        """Whether a frame carries the signal."""
        return all(at.raw(numbers.of(at.order)) in ids for _, at, ids in self.conditions)

    def covers(self, other: "Branch") -> bool:
        """Whether every frame of the message that carries the other's signal carries this one's, too."""
        theirs = {name: ids for name, _, ids in other.conditions}
        return all(name in theirs and theirs[name] <= ids for name, _, ids in self.conditions)

    def excludes(self, other: "Branch") -> bool:
        """Whether no frame carries both."""
        theirs = {name: ids for name, _, ids in other.conditions}
        return any(name in theirs and not theirs[name] & ids for name, _, ids in self.conditions)

    def __str__(self) -> str:
        """As the configuration's reader says it: Page = 2."""
        parts = [f"{name} = {' or '.join(map(str, sorted(ids)))}" for name, _, ids in reversed(self.conditions)]
        return ", ".join(parts) or "every frame"


def position(signal: Signal, length: int) -> Position:
    """Of a signal in a frame of so many bytes."""
    mask = (1 << signal.length) - 1
    sign = 1 << signal.length - 1 if signal.is_signed and not signal.is_float else 0
    if signal.byte_order == "little_endian":
        return Position("little", signal.start, mask, sign)
    first = 8 * (signal.start // 8) + 7 - signal.start % 8  # of its highest bit, counted from the frame's first
    return Position("big", 8 * length - first - signal.length, mask, sign)


def branch(message: Message, signal: str) -> Branch:
    """That of a signal by its name."""
    return Branch(message, find_signal(message, signal), frame_length(message))


def message_key(message: Message) -> int:
    """Identity of a message, as Frame.key."""
    return message.frame_id | EXTENDED if message.is_extended_frame else message.frame_id


def is_fd(message: Message) -> bool:
    """Whether a message's frames are CAN FD: where the DBC says so, or where a classical one has no room for it."""
    return message.is_fd or message.length > CLASSICAL_BYTES


def frame_length(message: Message) -> int:
    """Bytes of a message's frames: CAN FD fills up to the next length that its DLC can say."""
    if not is_fd(message):
        return message.length
    return next((n for n in _FD_LENGTHS if n >= message.length), message.length)


def fit_raw(signal: Signal, raw: int) -> int:
    """A raw value as a frame gives it: 0x8000 of a signed signal of 16 bits is -32768."""
    bits = 1 << signal.length
    return raw - bits if signal.is_signed and not signal.is_float and bits // 2 <= raw < bits else raw


def span(signal: Signal) -> tuple[int, int]:
    """The lowest and the highest raw value that the field can hold."""
    bits = signal.length - signal.is_signed
    return (-(1 << bits) if signal.is_signed else 0), (1 << bits) - 1
